"""The commands of corpora: options arrive, what was done is said, errors are the library's."""

from __future__ import annotations

from contextlib import contextmanager

import pytest
import soundfile
import typer
from typer.testing import CliRunner

from cospeech.cli.corpora import register
from cospeech.cli.demo import EXAMPLE
from cospeech.corpora.clip import SPLITS
from cospeech.corpora.store import Store
from cospeech.errors import InputError


@pytest.fixture
def app(monkeypatch):
    told = []

    @contextmanager
    def progress(title, quiet):
        told.append((title, quiet))
        yield None

    made = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    monkeypatch.setattr("cospeech.cli.corpora.show_progress", progress)
    register(made)
    made.told = told
    return made


@pytest.mark.slow
def test_synthesise_and_prepare(app, tmp_path):
    samples, rate = soundfile.read(EXAMPLE, dtype="float32")
    (tmp_path / "speech").mkdir()
    soundfile.write(tmp_path / "speech" / "a.wav", samples[: 6 * rate], rate)
    raw, store = str(tmp_path / "raw"), str(tmp_path / "store")
    line = ["synthesise", raw, "--layout", "trinity", "--speech", str(tmp_path / "speech"), "--hours", "0.004", "--no-tts"]
    done = CliRunner().invoke(app, line, catch_exceptions=False)
    assert done.exit_code == 0
    assert "speakers: 1" in done.output
    assert "synthetic" in done.output
    line = [
        "prepare",
        "trinity",
        raw,
        store,
        "--fps",
        "10",
        "--mirror",
        "--pitch",
        "2",
        "--speed",
        "1.1",
        "--derive-speaker",
        "leftarm",
    ]
    done = CliRunner().invoke(app, line, catch_exceptions=False)
    assert done.exit_code == 0
    assert "clips: 3, speakers: 4, of derived speakers: 3, by augmentation: 12" in done.output
    assert Store(store).fps == 10
    empty = [name for name in SPLITS if all(entry.split != name for entry in Store(store).clips)]
    assert [name for name in SPLITS if f"note: no clip is in the {name} split" in done.output] == empty != []
    assert app.told == [("synthesising", False), ("preparing", False)]
    with pytest.raises(InputError, match="--overwrite"):
        CliRunner().invoke(app, line, catch_exceptions=False)
    done = CliRunner().invoke(app, [*line, "--overwrite", "-q"], catch_exceptions=False)
    assert (done.exit_code, done.output) == (0, "")


@pytest.mark.parametrize("command", ["prepare", "synthesise"])
def test_help_says_what_each_option_does(app, command):
    done = CliRunner().invoke(app, [command, "--help"], terminal_width=200)
    assert done.exit_code == 0
    assert "cospeech " + command in done.output
