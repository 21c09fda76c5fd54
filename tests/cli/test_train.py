"""The commands of training: options arrive, what was done is said, PyTorch's absence is told."""

from __future__ import annotations

import sys
from contextlib import contextmanager

import pytest
import typer
from typer.testing import CliRunner

from cospeech.cli.train import register
from cospeech.errors import InputError
from tests.support.tiny_store import make_store

RECIPE = """
[model]
name = "gesture-autoencoder"
frames = 32
width = 4

[train]
steps = 4
batch = 4
validate_every = 2
validate_batches = 1
threads = 1
"""


@pytest.fixture
def app(monkeypatch):
    steps = []

    @contextmanager
    def progress(title, quiet):
        yield None if quiet else lambda *what: steps.append((title, *what))

    typer_app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    monkeypatch.setattr("cospeech.cli.train.show_progress", progress)
    register(typer_app)
    typer_app.steps = steps
    return typer_app


@pytest.fixture
def place(tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text(RECIPE)
    make_store(tmp_path / "store")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_train_and_go_on(app, place):
    pytest.importorskip("torch", reason="training needs torch (cospeech[train])")
    line = ["train", "mine.toml", "--store", "store"]
    result = CliRunner().invoke(app, line, catch_exceptions=False)
    assert result.exit_code == 0
    assert "4 steps" in result.stdout
    assert "best: autoencoder" in result.stdout
    assert [row[:3] for row in app.steps] == [("training", n, 4) for n in (1, 2, 3, 4)]
    assert app.steps[0][3].startswith("autoencoder ")
    with pytest.raises(InputError, match="there is a run in"):
        CliRunner().invoke(app, line, catch_exceptions=False)
    result = CliRunner().invoke(app, [*line, "--set", "train.steps=6", "--resume", "--quiet"], catch_exceptions=False)
    assert (result.exit_code, result.stdout) == (0, "")
    assert '"step": 6' in (place / "runs" / "mine" / "log.jsonl").read_text()
    with pytest.raises(InputError, match=r"train\.lr"):
        CliRunner().invoke(app, [*line, "--set", "train.lr=1", "--resume"], catch_exceptions=False)
    (place / "mine.toml").write_text(RECIPE.replace('"gesture-autoencoder"', '"stylised-flow"'))
    with pytest.raises(InputError, match="is of the model 'gesture-autoencoder', the recipe of 'stylised-flow'"):
        CliRunner().invoke(app, [*line, "--resume"], catch_exceptions=False)
    (place / "mine.toml").write_text(RECIPE)
    with pytest.raises(InputError, match=r"did you mean 'steps'"):
        CliRunner().invoke(app, [*line, "--set", "train.step=1"], catch_exceptions=False)


def test_a_run_goes_on_with_the_changes_that_it_began_with(app, place):
    pytest.importorskip("torch", reason="training needs torch (cospeech[train])")
    line = ["train", "mine.toml", "--store", "store", "--resume"]
    first_line = [*line, "--set", "train.steps=3", "--set", "train.validate_every=1", "--set", "train.save_every=1"]
    assert "3 steps" in CliRunner().invoke(app, first_line, catch_exceptions=False).stdout
    again = CliRunner().invoke(app, line, catch_exceptions=False)
    assert "3 steps" in again.stdout  # not the 4 of the file
    assert "note: the run keeps its own values: train.save_every 1 (the file says " in again.stderr
    assert "train.steps 3 (the file says 4)" in again.stderr
    assert "(--set changes train.steps, train.device, " in again.stderr  # and nothing else: another key is an error
    assert ": 3, now 4" not in again.stderr  # that read as if 4 held
    assert CliRunner().invoke(app, [*line, "--quiet"], catch_exceptions=False).stderr == ""
    longer = CliRunner().invoke(app, [*line, "--set", "train.steps=5"], catch_exceptions=False)
    assert "5 steps" in longer.stdout
    assert "train.steps 5" not in longer.stderr
    assert "5 steps" in CliRunner().invoke(app, line, catch_exceptions=False).stdout  # what was changed holds
    with pytest.raises(InputError, match=r"train\.validate_every: 1, now 2"):
        CliRunner().invoke(app, [*line, "--set", "train.validate_every=2"], catch_exceptions=False)


@pytest.mark.parametrize("line", [["train", "mine.toml", "--store", "store"], ["bundle", "run", "-o", "a.cospeech"]])
def test_without_torch_it_says_what_to_install(app, place, monkeypatch, line):
    for name in [name for name in sys.modules if name.partition(".")[0] == "torch"]:
        monkeypatch.delitem(sys.modules, name)
    for name in ("train", "export.bundles", "checkpoint", "dataset", "objective_optimiser", "processes"):
        monkeypatch.delitem(sys.modules, f"cospeech.training.{name}", raising=False)
    monkeypatch.delitem(sys.modules, "cospeech.models.nn.norm", raising=False)
    monkeypatch.setattr(sys, "meta_path", [_NoTorch(), *sys.meta_path])
    with pytest.raises(InputError, match=r'needs torch, which is not installed \(in a clone: pip install -e "\.\[train\]"\)'):
        CliRunner().invoke(app, line, catch_exceptions=False)


class _NoTorch:
    """Finds no torch, whatever is installed."""

    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "torch":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def test_where_the_store_is_looked_for(app, place):
    pytest.importorskip("torch", reason="training needs torch (cospeech[train])")
    with pytest.raises(InputError, match="no store is named"):
        CliRunner().invoke(app, ["train", "mine.toml"], catch_exceptions=False)
    with pytest.raises(InputError, match="no store in 'stores/beat'"):
        CliRunner().invoke(app, ["train", "mine.toml", "--set", "data.corpus=beat"], catch_exceptions=False)
    result = CliRunner().invoke(app, ["train", "mine.toml", "--set", "data.store=store", "--out", "a"], catch_exceptions=False)
    assert "4 steps" in result.stdout
    (place / "stores").mkdir()
    (place / "store").rename(place / "stores" / "beat")
    line = ["train", "mine.toml", "--set", "data.corpus=beat", "--out", "b"]
    assert "4 steps" in CliRunner().invoke(app, line, catch_exceptions=False).stdout
    moved_line = ["train", "mine.toml", "--store", "stores/beat", "--out", "a", "--resume", "--set", "train.steps=6"]
    assert "6 steps" in CliRunner().invoke(app, moved_line, catch_exceptions=False).stdout
