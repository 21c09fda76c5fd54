"""Opening what somebody names: only real files, never pipes or devices, which could block for ever; never more than is due."""

from __future__ import annotations

import os
import stat
from os import PathLike
from pathlib import Path
from typing import BinaryIO

from .errors import InputError
from .files import describe_os_error

__all__ = ["open_regular", "read_regular", "regular_file"]


def regular_file(path: str | PathLike[str], what: str = "a sound file") -> Path:
    """The path, made absolute, if a regular file with something in it is there.

    Args:
        path: as the user gave it.
        what: in words, for the hint.

    Raises:
        InputError: missing, a folder, a pipe or a device, empty, or it may not be read.
    """
    name = os.fsdecode(path)
    try:
        about = Path(name).stat()
    except (OSError, ValueError) as error:
        reason = describe_os_error(error) if isinstance(error, OSError) else str(error)
        raise InputError(f"cannot read {name!r}: {reason}", "is the name right?") from None
    if stat.S_ISDIR(about.st_mode):
        raise InputError(f"cannot read {name!r}: it is a folder", f"name {what}")
    if not stat.S_ISREG(about.st_mode):
        raise InputError(f"cannot read {name!r}: it is a pipe or a device", "save it to a file first")
    if about.st_size == 0:
        raise InputError(f"{name!r} is empty", "was it saved, recorded or downloaded to its end?")
    if not os.access(name, os.R_OK):
        raise InputError(f"cannot read {name!r}: Permission denied", "may you read it?")
    return Path(name).absolute()


def open_regular(path: str | PathLike[str], what: str, limit: int) -> BinaryIO:
    """A regular file of at most ``limit`` bytes, open for reading.

    Raises:
        InputError: as of `regular_file`, or it is larger; the limit is stated.
    """
    file = regular_file(path, what)
    try:
        size = file.stat().st_size
        if size > limit:
            shown = f"{limit >> 20} MiB" if limit >= 1 << 20 else f"{limit >> 10} KiB"
            raise InputError(f"{os.fsdecode(path)!r} is larger than {shown}: {size:,} bytes", f"is it {what}?")
        return file.open("rb")
    except OSError as error:
        raise InputError(f"cannot read {os.fsdecode(path)!r}: {describe_os_error(error)}", "may you read it?") from None


def read_regular(path: str | PathLike[str], what: str, limit: int) -> bytes:
    """The whole of a regular file of at most ``limit`` bytes (see `open_regular`)."""
    with open_regular(path, what, limit) as file:
        try:
            return file.read(os.fstat(file.fileno()).st_size)  # not the limit: so much memory would be taken at once
        except OSError as error:
            raise InputError(f"cannot read {os.fsdecode(path)!r}: {describe_os_error(error)}", "may you read it?") from None
