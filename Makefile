# cospeech: few verbs. `make demo` needs Python >= 3.11, git and make; `make test` installs everything else by itself.

VENV := .venv
BIN := $(VENV)/bin
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11 python; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

.PHONY: demo test check versions lint fix docs bench studio blender media lock clean

demo: $(VENV)/.core              ## install the core, generate from the example speech into demo/, say how to open it
	@echo "generating from the example speech into demo/ (the video takes longest)"
	@$(BIN)/cospeech demo

test: $(VENV)/.dev               ## install everything; linters, docs, and every test
	@$(BIN)/python tools/check.py

check: $(VENV)/.dev              ## the linters and the quick tests: under a minute on two cores
	@$(BIN)/python tools/check.py check

versions: $(VENV)/.dev           ## the quick tests with the lowest versions of the dependencies, then with the newest
	@$(BIN)/python tools/check_versions.py lowest
	@$(BIN)/python tools/check_versions.py newest

lint: $(VENV)/.dev               ## the linters alone
	@$(BIN)/python tools/check.py lint

fix: $(VENV)/.dev                ## let the linters mend what they can
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

docs: $(VENV)/.dev               ## rewrite generated pages, then build the site into site/
	$(BIN)/python tools/write_docs.py
	$(BIN)/mkdocs build --strict --quiet
	@echo "open site/index.html"

bench: $(VENV)/.dev              ## speed on this machine
	@$(BIN)/cospeech bench
	@$(BIN)/python benchmarks/store.py
	@$(BIN)/python benchmarks/flow.py
	@$(BIN)/python benchmarks/mix_stage.py
	@$(BIN)/python benchmarks/chain.py
	@$(BIN)/python benchmarks/live.py

studio: $(VENV)/.studio          ## all that `cospeech studio` and share files need: the extra studio, and the page, into src/cospeech/assets/studio/
	@$(BIN)/python tools/build_studio.py

blender: $(VENV)/.core           ## the Blender add-on: dist/cospeech-blender.zip
	@$(BIN)/python tools/build_blender.py

media: $(VENV)/.core             ## the README's moving picture
	$(BIN)/python tools/make_media.py

lock: $(VENV)/.dev               ## after a change of dependencies: uv.lock and the lists made from it
	$(BIN)/python tools/lock.py

clean:                           ## everything that these commands made
	rm -rf $(VENV) .venv-blender .venv-versions demo site dist .pytest_cache .ruff_cache .mypy_cache .hypothesis tests/node/node_modules web/node_modules src/cospeech/assets/studio

# Stamps: nothing is installed again, and no network is touched, while the lists are unchanged.
$(VENV)/.core: requirements/core.txt pyproject.toml
	@test -n "$(PYTHON)" || { echo "error: no Python >= 3.11 found (install one, or say make PYTHON=/path/to/python)"; exit 2; }
	@test -x $(BIN)/pip || $(PYTHON) -m venv $(VENV) || { echo "error: python -m venv failed (Debian, Ubuntu: install python3-venv)"; exit 2; }
	@echo "installing the core into $(VENV)"
	@$(PIP) install --no-compile --only-binary :all: --require-hashes -r requirements/core.txt
	@$(PIP) install --no-deps --no-build-isolation --editable .
	@touch $@

$(VENV)/.studio: $(VENV)/.core requirements/studio.txt
	@echo "installing what the studio needs into $(VENV)"
	@$(PIP) install --no-compile --only-binary :all: --require-hashes -r requirements/studio.txt
	@touch $@

$(VENV)/.dev: $(VENV)/.core uv.lock
	@echo "installing the tools of development into $(VENV) (on Linux 3 GB, most of it torch)"
	@$(PIP) install --only-binary :all: "uv==$$(sed -n '/^name = "uv"$$/{n;s/version = "\(.*\)"/\1/p;}' uv.lock)"
	@$(BIN)/uv sync --quiet --frozen --inexact --python $(BIN)/python --extra av --extra live --extra wav2vec --extra studio --group dev --group docs --group build
	@touch $@
