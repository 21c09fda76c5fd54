"""Standard streams that can print any text, and whose errors name the stream."""

from __future__ import annotations

import errno
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import TextIOWrapper
from typing import IO

from ..errors import is_broken_pipe

__all__ = ["STANDARD_OUTPUT", "find_bar_stream", "ready_streams"]

STANDARD_OUTPUT = "standard output"
"""Stands in errors where the name of a file would."""


_CONTROLS = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""Control characters of terminals (ECMA-48), and of the direction of letters (UAX 9); no ends of lines and no tabs."""


class _SafeStream(TextIOWrapper):
    """A stream without control characters: names from other people's files may hold commands for the terminal."""

    def write(self, text: str) -> int:
        return super().write(_CONTROLS.sub(lambda match: ascii(match[0])[1:-1], text) if self.isatty() else text)


class _Output(_SafeStream):
    """Standard output. Its errors name it, as an error of a file names the file."""

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
    """Prepare the standard streams for any text.

    A stream that the shell has closed becomes the null device. Otherwise, one of our files would get its number, and the error
    messages of libraries would go there. Files and pipes get UTF-8, which JSON must be. On Windows they would get the code page
    of the machine, which lacks most characters.
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
    for name, kind in (("stdout", _Output), ("stderr", _SafeStream)):
        plain = getattr(sys, name)
        if plain is getattr(sys, f"__{name}__") and isinstance(plain, TextIOWrapper):  # it stays there, with its buffer
            setattr(sys, name, _wrap(plain, kind))


def _wrap(plain: TextIOWrapper, kind: type[TextIOWrapper]) -> TextIOWrapper:
    """The same stream as one of ours."""
    lines, through = plain.line_buffering, plain.write_through
    return kind(plain.buffer, plain.encoding, plain.errors, line_buffering=lines, write_through=through)


def find_bar_stream() -> IO[str]:
    """Standard error for a progress bar, which moves the cursor of a terminal."""
    plain = sys.__stderr__
    return plain if plain is not None and isinstance(sys.stderr, _SafeStream) else sys.stderr
