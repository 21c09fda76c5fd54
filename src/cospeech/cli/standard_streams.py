"""Standard streams that take whatever is said, and whose errors tell that they are theirs."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import TextIOWrapper

from ..errors import is_broken_pipe

__all__ = ["STANDARD_OUTPUT", "ready_streams"]

STANDARD_OUTPUT = "standard output"
"""In place of the name of a file, in errors."""


class _Output(TextIOWrapper):
    """Standard output: an error of it has a name, as one of a file may have."""

    def write(self, text: str) -> int:
        with _name_errors():
            return super().write(text)

    def flush(self) -> None:
        with _name_errors():
            super().flush()


@contextmanager
def _name_errors() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if is_broken_pipe(error):
            raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE), STANDARD_OUTPUT) from None
        error.filename = STANDARD_OUTPUT
        raise


def ready_streams() -> None:
    """Make the standard streams fit for what is said.

    What the shell has closed becomes the null device: a file of ours would get its number else, and a library's complaints.
    Files and pipes get UTF-8, which JSON must be. On Windows they would get the code page of the machine, which lacks most
    characters.
    """
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            null = open(os.devnull, "r" if name == "stdin" else "w", encoding="utf-8")  # noqa: SIM115, PTH123  # open to the end
            setattr(sys, name, null)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal that cannot show a character does not end the program
            if os.name == "nt" and not stream.isatty() and "PYTHONIOENCODING" not in os.environ:
                stream.reconfigure(encoding="utf-8")
    plain = sys.stdout
    if plain is sys.__stdout__ and isinstance(plain, TextIOWrapper):  # which stays there, so that its buffer stays open
        sys.stdout = _Output(
            plain.buffer, plain.encoding, plain.errors, line_buffering=plain.line_buffering, write_through=plain.write_through
        )
