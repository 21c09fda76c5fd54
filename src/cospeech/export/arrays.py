"""Zips and arrays as NumPy writes them, from files that may be damaged or hostile: they are checked before anything is read.

NumPy's own reader of array headers runs Python's tokeniser over them. This one knows the form that NumPy writes.
"""

from __future__ import annotations

import math
import re
from typing import IO, BinaryIO

import numpy as np

from ..errors import InputError

__all__ = ["check_zip", "read_array", "read_array_head"]

_HEAD = re.compile(  # of a .npy: a dict as numpy itself writes it (numpy.lib.format, version 1.0 and 2.0)
    r"\{\s*'descr':\s*'([<>|=]?[a-zA-Z]\d{0,9})',\s*'fortran_order':\s*(True|False),"
    r"\s*'shape':\s*\(((?:\d{1,15}L?(?:,\s*\d{1,15}L?){0,31})?),?\s*\),?\s*\}\s*"  # L: written by Python 2
)
_ZIP_END = b"PK\x05\x06"  # of the list of a zip (APPNOTE 4.3.16)
_MAGIC = b"\x93NUMPY"
_KINDS = "?biufcSU"  # of numpy's types; not objects, which would be pickled


def check_zip(file: BinaryIO, members: int, name: str) -> None:
    """Check that the list of an open zip is no longer than one of so many members; `zipfile` would read any.

    Raises:
        InputError: it is longer, or the file is no zip.
    """
    end = file.seek(0, 2)
    file.seek(max(0, end - 22 - 65535))  # the end of the list, and the longest comment
    tail = file.read()
    at = tail.rfind(_ZIP_END)
    file.seek(0)
    if at < 0 or len(tail) - at < 22:
        raise InputError(f"{name} is not a readable zip", "is it cut off?")
    if tail[max(0, at - 20) : at].startswith(b"PK\x06\x07"):  # zip64 has a second list, which would count
        raise InputError(f"{name} is a zip of more than 4 GiB", "is it what it is called?")
    if int.from_bytes(tail[at + 12 : at + 16], "little") > members * 1024:  # ours: an entry has 46 bytes and a name
        raise InputError(f"{name} has more than {members} members", "is it what it is called?")


def read_array_head(file: IO[bytes], name: str) -> tuple[np.dtype, tuple[int, ...], str]:
    """Type, shape and order (C or F) of the array of a .npy; reads the file up to the numbers.

    Raises:
        InputError: it is no array, of a version that numpy does not write for plain numbers, or not of numbers.
    """
    start = file.read(8)
    size = {1: 2, 2: 4}.get(start[6] if len(start) == 8 and start[:6] == _MAGIC and start[7] == 0 else 0)
    if size is None:
        raise InputError(f"{name} is not an array that numpy has written", "save it again with numpy")
    length = int.from_bytes(file.read(size), "little")
    match = _HEAD.fullmatch(file.read(length).decode("latin-1")) if length <= 10_000 else None
    try:
        dtype = np.dtype(match[1]) if match else None
    except (TypeError, ValueError, OverflowError):
        dtype = None
    if match is None or dtype is None or dtype.kind not in _KINDS:
        raise InputError(f"{name} is not an array of plain numbers or text", "save it again with numpy")
    return dtype, tuple(int(n) for n in re.findall(r"\d+", match[3])), "F" if match[2] == "True" else "C"


def read_array(file: IO[bytes], size: int, name: str) -> np.ndarray:
    """Read the array of a .npy of ``size`` bytes; it fills the file exactly.

    Raises:
        InputError: as of `read_array_head`, or it does not fill the file.
    """
    dtype, shape, order = read_array_head(file, name)
    count = math.prod(shape)
    due = count * dtype.itemsize
    if due > size:
        raise InputError(f"{name} is {dtype} of shape {shape}, which does not fit {size} bytes"[:200], "is it damaged?")
    data = file.read(size)
    if len(data) != due:
        raise InputError(f"{name} is {dtype} of shape {shape}, which does not fit {len(data)} bytes"[:200], "is it damaged?")
    if count and not dtype.itemsize:
        raise InputError(f"{name} is text without letters", "is it damaged?")
    flat = np.frombuffer(data, dtype, count) if due else np.zeros(0, dtype)
    try:
        return flat.reshape(shape, order="F" if order == "F" else "C")
    except ValueError:  # no numbers at all, in a shape beyond numpy's
        raise InputError(f"{name} is of shape {shape}"[:200], "is it damaged?") from None
