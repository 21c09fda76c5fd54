"""What a terminal shows: names from files of strangers may hold commands for it."""

from __future__ import annotations

import io
import sys

import pytest

from cospeech.cli.progress import show_progress
from cospeech.cli.standard_streams import find_bar_stream, ready_streams

NAME = "\x1b]0;title\x07 \x9b2J \u202egpj\tZoë"


class Screen(io.BytesIO):
    """Keeps what it was shown, also when it is closed."""

    is_terminal = True

    def isatty(self) -> bool:
        return self.is_terminal

    def close(self) -> None:
        pass

    def read_all(self) -> str:
        return self.getvalue().decode()


def open_streams(monkeypatch, screen: Screen) -> None:
    """Make a screen the standard streams. The test itself calls this, as pytest replaces the streams after the fixtures."""
    for name in ("stdout", "stderr"):
        plain = io.TextIOWrapper(screen, "utf-8", newline="\n", write_through=True)
        monkeypatch.setattr(sys, f"__{name}__", plain)
        monkeypatch.setattr(sys, name, plain)
    ready_streams()


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_terminal_shows_what_it_would_obey_and_a_pipe_gets_it_as_it_is(monkeypatch, is_terminal):
    screen = Screen()
    screen.is_terminal = is_terminal
    open_streams(monkeypatch, screen)
    for stream in (sys.stdout, sys.stderr):
        print(NAME, file=stream, flush=True)
    text = "\\x1b]0;title\\x07 \\x9b2J \\u202egpj\tZoë" if is_terminal else NAME
    assert screen.read_all() == f"{text}\n{text}\n"


def test_a_progress_bar_takes_names_as_they_are(monkeypatch):
    screen, times = Screen(), iter([0.0, *[10.0] * 1000])
    open_streams(monkeypatch, screen)
    monkeypatch.setattr("time.monotonic", lambda: next(times))
    assert find_bar_stream() is sys.__stderr__, "it moves the cursor"
    with show_progress("generating", quiet=False) as tell:
        assert tell is not None
        tell(1, 2, "x[/b]")
    assert "generating x[/b]" in screen.read_all()
