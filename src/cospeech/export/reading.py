"""What every reader needs: opening what is really a file, and turning stray errors into one-line ones."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import BinaryIO

from ..errors import CospeechError, InputError
from ..files import describe_os_error

__all__ = ["MAX_BYTES", "open_file", "read_bytes"]

MAX_BYTES = 1 << 30  # ours: 1 GiB holds 4 hours of any of our formats; more is a mistake or an attack


@contextmanager
def open_file(path: str | PathLike[str], *, limit: int = MAX_BYTES) -> Iterator[BinaryIO]:
    """Open a regular file of at most ``limit`` bytes for reading.

    Raises:
        InputError: missing, a folder, a pipe or device (which could block for ever), empty, too large, unreadable; also when
            the block under it runs out of memory or of stack on what it read.
    """
    name = repr(str(path))
    try:
        mode = Path(path).stat()
        if not stat.S_ISREG(mode.st_mode):
            kind = "a folder" if stat.S_ISDIR(mode.st_mode) else "not a regular file"
            raise InputError(f"cannot read {name}: it is {kind}", "name a motion file")
        if mode.st_size > limit:
            raise InputError(f"{name} has {mode.st_size >> 20} MiB, more than {limit >> 20}", "cut it into pieces")
        if mode.st_size == 0:
            raise InputError(f"{name} is empty", "was the export interrupted?")
        with Path(path).open("rb") as file:
            yield file
    except CospeechError:
        raise
    except OSError as error:
        raise InputError(f"cannot read {name}: {describe_os_error(error)}", "does the file exist?") from None
    except ValueError as error:  # a NUL in the name
        raise InputError(f"cannot read {name}: {error}", "is it damaged?") from None
    except (RecursionError, MemoryError):
        raise InputError(f"cannot read {name}: too large or nested too deeply", "is it damaged?") from None


def read_bytes(path: str | PathLike[str], *, limit: int = MAX_BYTES) -> bytes:
    """The whole of a regular file of at most ``limit`` bytes (see `open_file`)."""
    with open_file(path, limit=limit) as file:
        return file.read(limit + 1)
