"""Standard streams that take whatever is said, and whose errors tell that they are theirs."""

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
"""In place of the name of a file, in errors."""


_CONTROLS = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""What a terminal obeys (ECMA-48), and what turns the direction of letters (UAX 9); no ends of lines, no tabs."""


class _Shown(TextIOWrapper):
    """A stream on which a terminal obeys nothing: names from strangers' files may hold commands for it."""

    def write(self, text: str) -> int:
        return super().write(_CONTROLS.sub(lambda found: ascii(found[0])[1:-1], text) if self.isatty() else text)


class _Output(_Shown):
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
    for name, kind in (("stdout", _Output), ("stderr", _Shown)):
        plain = getattr(sys, name)
        if plain is getattr(sys, f"__{name}__") and isinstance(plain, TextIOWrapper):  # it stays there, for what it buffers
            setattr(sys, name, _wrap(plain, kind))


def _wrap(plain: TextIOWrapper, kind: type[TextIOWrapper]) -> TextIOWrapper:
    """The same stream as one of ours."""
    lines, through = plain.line_buffering, plain.write_through
    return kind(plain.buffer, plain.encoding, plain.errors, line_buffering=lines, write_through=through)


def find_bar_stream() -> IO[str]:
    """Standard error for a progress bar, which moves the cursor of a terminal."""
    plain = sys.__stderr__
    return plain if plain is not None and isinstance(sys.stderr, _Shown) else sys.stderr
