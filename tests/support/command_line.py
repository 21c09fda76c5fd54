"""Commands of cospeech: in the process of the tests, which has imported everything already, and in one that hears signals."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import pytest

__all__ = ["change_options", "heed", "type_command"]


def heed(number: signal.Signals) -> Callable[[], object]:
    """What a child does first (``preexec_fn``) so that a signal counts.

    A shell's ``&`` and nohup ignore one for all children, and the tests may run there.
    """
    return lambda: signal.signal(number, signal.SIG_DFL)


def change_options(line: str, options: str) -> str:
    """A command with other values of options that take one value, and with those that it lacks.

    >>> change_options("cospeech synthesise a --hours 2 --tts", "--hours 0.1 --no-act")
    'cospeech synthesise a --tts --hours 0.1 --no-act'
    """
    for name in re.findall(r"(--[\w-]+) [^-]", options):
        line = re.sub(rf" {name} \S+", "", line)
    return f"{line} {options}".strip()


def type_command(line: str, place: Path, code: int = 0) -> tuple[str, str]:
    """Run ``cospeech …`` in a folder; give what it says, and its errors and notes.

    That the same line works as a program is for tests/cli/test_process.py.

    Whatever it sets for its own process (signals, the folder, its arguments) is put back.

    Raises:
        AssertionError: it ends with another exit code.
    """
    from cospeech.cli.main import main

    output, errors, before = io.StringIO(), io.StringIO(), signal.getsignal(signal.SIGTERM)
    arguments = ["cospeech", *shlex.split(line.removeprefix("cospeech "))]
    with contextlib.ExitStack() as stack:
        stack.callback(signal.signal, signal.SIGTERM, before)
        for context in (contextlib.chdir(place), contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors)):
            stack.enter_context(context)
        stack.enter_context(mock.patch.object(sys, "argv", arguments))
        status = stack.enter_context(pytest.raises(SystemExit))
        main()
    assert int(status.value.code or 0) == code, f"{line}\n{errors.getvalue()}"
    return output.getvalue(), errors.getvalue()
