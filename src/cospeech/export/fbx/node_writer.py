"""Nodes of a binary FBX file, version 7.4: names, values and nodes in nodes, written in one pass.

Autodesk has not published the layout; this follows the description of the Blender Foundation (code.blender.org, "FBX binary
file format specification", 2013). A record has: its end, the number of its values and of their bytes, the length of its name
(uint32, uint32, uint32, uint8), the name, the values, and the nodes in it, which an empty record ends.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import BinaryIO

import numpy as np

from ...errors import InputError
from .tree import MAGIC, Node

__all__ = ["CREATION_TIME", "FILE_ID", "VERSION", "Long", "NodeWriter"]

VERSION = 7400
_EMPTY = bytes(13)  # a record of nothing ends the nodes of a node
# Readers of Autodesk check these against each other; these three belong together (description as above, "footer")
FILE_ID = bytes.fromhex("28b32aebb624ccc2bfc8b02aa92bfcf1")
CREATION_TIME = "1970-01-01 10:00:00:000"
_FOOTER_ID = bytes.fromhex("fabcab09d0c8d466b176fb831cf7267e")
_FOOTER_END = bytes.fromhex("f85a8c6adef5d97eece90ce3758f290b")
_ARRAYS = {"f4": b"f", "f8": b"d", "i4": b"i", "i8": b"l"}
_LEAST_PACKED = 128  # bytes from which an array is deflated; ours
_LEVEL = 1  # of deflating; ours: level 6 makes files 4 % smaller and takes three times as long
_MOST = 1 << 32  # bytes that a 32-bit place can reach


class Long(int):
    """A whole number of 64 bits; others have 32."""


def _pack(value: object) -> bytes:
    """A value with the letter of its type."""
    if isinstance(value, bool):
        return b"C" + struct.pack("<?", value)
    if isinstance(value, Long):
        return b"L" + struct.pack("<q", value)
    if isinstance(value, int):
        return b"I" + struct.pack("<i", value)
    if isinstance(value, float):
        return b"D" + struct.pack("<d", value)
    if isinstance(value, str):
        data = value.encode()
        return b"S" + struct.pack("<I", len(data)) + data
    if isinstance(value, bytes):
        return b"R" + struct.pack("<I", len(value)) + value
    if not isinstance(value, np.ndarray):
        raise TypeError(f"a value of type {type(value).__name__} in a node")
    data = np.ascontiguousarray(value, value.dtype.newbyteorder("<")).tobytes()
    body = zlib.compress(data, _LEVEL) if len(data) >= _LEAST_PACKED else data
    return _ARRAYS[value.dtype.str[1:]] + struct.pack("<III", value.size, body is not data, len(body)) + body


class NodeWriter:
    """Writes the nodes of a file one after another.

    Args:
        file: open for writing, at its beginning.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        file.write(MAGIC + struct.pack("<I", VERSION))

    @contextmanager
    def node(self, name: str, *values: object) -> Iterator[None]:
        """Write a node with ``values``; nodes that are written inside of the ``with`` block lie in it.

        Raises:
            InputError: the file is too large for its 32-bit places.
        """
        with self._open(name, len(values), b"".join(map(_pack, values)), ends=True):
            yield

    def leaf(self, name: str, *values: object) -> None:
        """Write a node without nodes in it."""
        with self._open(name, len(values), b"".join(map(_pack, values)), ends=False):
            pass

    def copy(self, node: Node) -> None:
        """Write a node of another file, with all that is in it."""
        with self._open(node.name, len(node.values), bytes(node.raw), ends=node.has_block):
            for inner in node.nodes:
                self.copy(inner)

    def properties(self, *rows: tuple[object, ...]) -> None:
        """Write a list of named properties: name, type, kind, flags, values."""
        with self.node("Properties70"):
            for row in rows:
                self.leaf("P", *row)

    def finish(self) -> None:
        """Write the end of a file."""
        self._file.write(_EMPTY + _FOOTER_ID + bytes(4))
        self._file.write(bytes(-self._file.tell() % 16 or 16))
        self._file.write(struct.pack("<I", VERSION) + bytes(120) + _FOOTER_END)

    @contextmanager
    def _open(self, name: str, count: int, values: bytes, *, ends: bool) -> Iterator[None]:
        """Write a record, and its end once it is known; ``ends``: an empty record ends the nodes in it."""
        start, label = self._file.tell(), name.encode()
        self._file.write(struct.pack("<IIIB", 0, count, len(values), len(label)) + label + values)
        yield
        self._file.write(_EMPTY if ends else b"")
        end = self._file.tell()
        if end >= _MOST:
            raise InputError("an FBX of more than 4 GiB is more than the format can hold", "export it in pieces")
        self._file.seek(start)
        self._file.write(struct.pack("<I", end))
        self._file.seek(end)
