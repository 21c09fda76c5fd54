"""What every reader needs: opening only regular files, a limit to the size of the motion, and errors of one line."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from typing import BinaryIO

from ..errors import CospeechError, InputError
from ..files import describe_os_error, open_regular
from ..limits import JOINT_FRAMES, MOTION_BYTES, most_joint_frames

__all__ = ["check_frames", "open_file", "read_bytes", "size_of"]


@contextmanager
def open_file(path: str | PathLike[str], *, limit: int = MOTION_BYTES) -> Iterator[BinaryIO]:
    """Open a regular file of at most ``limit`` bytes for reading.

    Raises:
        InputError: the file is missing, a folder, a pipe or device (which could block for ever), empty, too large or
            unreadable; or the ``with`` block runs out of memory or of stack.
    """
    name = repr(str(path))
    try:
        with open_regular(path, "a motion file", limit) as file:
            yield file
    except CospeechError:
        raise
    except OSError as error:
        raise InputError(f"cannot read {name}: {describe_os_error(error)}", "does the file exist?") from None
    except (RecursionError, MemoryError):
        raise InputError(f"cannot read {name}: too large or nested too deeply", "is it damaged?") from None


def read_bytes(path: str | PathLike[str], *, limit: int = MOTION_BYTES) -> bytes:
    """The whole of a regular file of at most ``limit`` bytes (see `open_file`)."""
    with open_file(path, limit=limit) as file:
        return file.read(size_of(file))  # not the limit: read() would take so much memory at once


def size_of(file: BinaryIO) -> int:
    """Bytes of an open file."""
    return os.fstat(file.fileno()).st_size


def check_frames(name: str, frames: int, joints: int, size: int) -> None:
    """Check that a motion may become so large, before memory is taken for it.

    Args:
        name: how messages call the file.
        frames: after resampling.
        joints: of the skeleton onto which it is read.
        size: bytes of the file (`cospeech.limits.most_joint_frames`).

    Raises:
        InputError: it may not; the message states the limit.
    """
    most = most_joint_frames(size)
    if frames * joints > most:
        problem = f"{name} would become {frames:,} frames of {joints:,} joints; {most // max(joints, 1):,} frames is the most"
        if most == JOINT_FRAMES:
            raise InputError(problem, f"cut it into pieces of at most {JOINT_FRAMES:,} frames × joints")
        raise InputError(f"{problem} for a file of {size:,} bytes", "are its times damaged? Else cut it at its gaps")
