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
    titles = []

    @contextmanager
    def progress(title, quiet):
        titles.append((title, quiet))
        yield None

    typer_app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    monkeypatch.setattr("cospeech.cli.corpora.show_progress", progress)
    register(typer_app)
    typer_app.titles = titles
    return typer_app


@pytest.mark.slow
def test_synthesise_and_prepare(app, tmp_path):
    samples, rate = soundfile.read(EXAMPLE, dtype="float32")
    (tmp_path / "speech").mkdir()
    soundfile.write(tmp_path / "speech" / "a.wav", samples[: 6 * rate], rate)
    raw, store = str(tmp_path / "raw"), str(tmp_path / "store")
    line = ["synthesise", raw, "--layout", "trinity", "--speech", str(tmp_path / "speech"), "--hours", "0.004", "--no-tts"]
    result = CliRunner().invoke(app, line, catch_exceptions=False)
    assert result.exit_code == 0
    assert "speakers: 1" in result.output
    assert "synthetic" in result.output
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
    result = CliRunner().invoke(app, line, catch_exceptions=False)
    assert result.exit_code == 0
    assert "clips: 3, speakers: 4, of derived speakers: 3, by augmentation: 12" in result.output
    assert Store(store).fps == 10
    empty = [name for name in SPLITS if all(entry.split != name for entry in Store(store).clips)]
    assert [name for name in SPLITS if f"note: no clip is in the {name} split" in result.output] == empty != []
    assert app.titles == [("synthesising", False), ("preparing", False)]
    with pytest.raises(InputError, match="--overwrite"):
        CliRunner().invoke(app, line, catch_exceptions=False)
    result = CliRunner().invoke(app, [*line, "--overwrite", "-q"], catch_exceptions=False)
    assert (result.exit_code, result.output) == (0, "")


@pytest.mark.parametrize("command", ["prepare", "synthesise"])
def test_help_says_what_each_option_does(app, command):
    result = CliRunner().invoke(app, [command, "--help"], terminal_width=200)
    assert result.exit_code == 0
    assert "cospeech " + command in result.output
