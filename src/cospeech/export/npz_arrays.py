"""Read the arrays of an ``.npz`` without trusting it: no pickle, no Python in heads, nothing beyond its announced size."""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import BinaryIO

import numpy as np

from ..errors import InputError
from ..limits import NPZ_BYTES, NPZ_MEMBERS
from .arrays import check_zip, read_array, read_array_head

__all__ = ["Arrays", "open_arrays"]


class Arrays:
    """The arrays of an open archive by name; each is read when it is needed.

    Args:
        archive: open for reading.
        name: how messages call the file.

    Raises:
        InputError: it has too many members, or they would unpack to too much.
    """

    def __init__(self, archive: zipfile.ZipFile, name: str) -> None:
        infos = archive.infolist()
        total = sum(info.file_size for info in infos)
        if len(infos) > NPZ_MEMBERS or total > NPZ_BYTES:
            problem = f"{name} unpacks to {total >> 20} MiB in {len(infos)} members"
            raise InputError(problem, f"at most {NPZ_BYTES >> 20} MiB in {NPZ_MEMBERS}; is this a motion file?")
        self._archive, self._name = archive, name
        self._members = {i.filename.removesuffix(".npy"): i for i in infos if i.filename.endswith(".npy")}

    def __contains__(self, key: object) -> bool:
        return key in self._members

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def shape(self, key: str) -> tuple[int, ...]:
        """The shape of an array, from its head alone."""
        with _report_damage(self._name), self._archive.open(self._members[key]) as member:
            return read_array_head(member, f"{key!r} of {self._name}")[1]

    def read(self, key: str) -> np.ndarray:
        """One array.

        Raises:
            InputError: it is damaged, or not of numbers or text.
        """
        info = self._members[key]
        with _report_damage(self._name), self._archive.open(info) as member:
            return read_array(member, info.file_size, f"{key!r} of {self._name}")


@contextmanager
def open_arrays(file: BinaryIO, name: str) -> Iterator[Arrays]:
    """The arrays of an open ``.npz``.

    Raises:
        InputError: it is no zip, or it is damaged.
    """
    check_zip(file, NPZ_MEMBERS, name)
    with _report_damage(name):
        archive = zipfile.ZipFile(file)
    with archive:
        yield Arrays(archive, name)


@contextmanager
def _report_damage(name: str) -> Iterator[None]:
    """Turn errors that `zipfile` raises on a damaged archive into an `InputError`."""
    try:
        yield
    except InputError:
        raise
    except (
        zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError, zlib.error, struct.error, ValueError,
        KeyError, OverflowError, IndexError,
    ) as error:  # fmt: skip
        raise InputError(f"{name} is not a readable .npz: {error}"[:200], "is it cut off?") from None
