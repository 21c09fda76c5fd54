"""The pages *Add a metric* and *Add a corpus*: their files are saved as a reader would save them, and run."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import soundfile

from cospeech.cli.demo import EXAMPLE
from tests.house.test_docs import ROOT, run

pytestmark = pytest.mark.slow

BLOCK = re.compile(r'^```python title="([\w.]+)"\n(.*?)^```', re.S | re.M)


def files(page: str) -> dict[str, str]:
    """Name → text of the files that a page tells to save."""
    return dict(BLOCK.findall((ROOT / "docs" / page).read_text("utf-8")))


def follow(page: str, place: Path) -> str:
    """Save the files of a page, run `try_it.py`, give what it prints."""
    soundfile.write(place / "talk.wav", *soundfile.read(EXAMPLE, frames=96_000))
    run("generate talk.wav -o talk.bvh -q", place)
    for name, text in files(page).items():
        (place / name).write_text(text, "utf-8")
    process = subprocess.run(
        [sys.executable, "try_it.py"], cwd=place, capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONIOENCODING": "utf-8"},
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    return process.stdout


def type_own(page: str, place: Path, *instead: str) -> str:
    """Run the line ``python -c`` of a page, or its code with other arguments; what it prints."""
    (line,) = re.findall(r"^python (-c .*)$", (ROOT / "docs" / page).read_text("utf-8"), re.M)
    arguments = shlex.split(line)
    process = subprocess.run(
        [sys.executable, *(arguments[:2] if instead else arguments), *instead], cwd=place, capture_output=True, text=True,
        check=False, env=os.environ | {"PYTHONIOENCODING": "utf-8"},
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    return process.stdout


def test_add_a_metric(tmp_path):
    pytest.importorskip("scipy", reason="metrics need scipy (cospeech[corpora])")
    table = follow("add_a_metric.md", tmp_path)
    (mark,) = [line for line in table.splitlines() if line.startswith("! wrist_height:")]
    assert "frozen pose is not worse" in mark, "the page says so"
    assert "white noise is not worse" in mark, "the page says so"
    rows = {line.split("  ")[0].strip(): line for line in table.splitlines()}
    for row in ("calm", "ground truth", "frozen pose", "white noise", "shuffled speech", "another clip"):
        assert row in rows, table
    assert "wrist_height" in type_own("add_a_metric.md", tmp_path, "list", "metrics")


def test_add_a_corpus(tmp_path):
    for name in ("h5py", "scipy"):
        pytest.importorskip(name, reason=f"corpora need {name} (cospeech[corpora])")
    output = follow("add_a_corpus.md", tmp_path)
    assert "'calm_1', 'lively_2', 'orator_3', 'seated_4'" in output
    assert "lost_5 dropped: 'lost_5.bvh' is not there" in output
    assert "clips: 4" in type_own("add_a_corpus.md", tmp_path)


def test_code_of_the_pages_is_as_tidy_as_ours(tmp_path):
    ruff = Path(sys.executable).parent / "ruff"
    if not ruff.is_file():
        pytest.skip("needs ruff")
    for page in ("add_a_metric.md", "add_a_corpus.md"):
        for name, text in files(page).items():
            (tmp_path / f"{page[:-3]}_{name}").write_text(text, "utf-8")
    options = ["--line-length", "128", "--isolated"]
    process = subprocess.run([ruff, "format", "--check", *options, str(tmp_path)], capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stdout
