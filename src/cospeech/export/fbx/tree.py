"""The nodes of a binary FBX file, read without trusting it.

Arrays stay packed until they are needed. Records are those of `node_writer`; from version 7.5 on, places and counts have 64
bits.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ...errors import InputError
from ...limits import FBX_DEPTH, FBX_FREE_UNPACKED, FBX_NODES, FBX_UNPACKED, FBX_UNPACKED_PER_BYTE
from ...motion.rotations import Array

__all__ = ["MAGIC", "Node", "PackedArray", "parse_fbx"]

MAGIC = b"Kaydara FBX Binary  \0\x1a\0"
_FIRST = len(MAGIC) + 4  # place of the first node, after the version
_OLDEST, _WIDE = 7000, 7500  # versions: with numbers and connections of objects; with places of 64 bits
_PLAIN = {b"C": "<?", b"B": "<?", b"Y": "<h", b"I": "<i", b"F": "<f", b"D": "<d", b"L": "<q"}
_ARRAYS = {b"f": "<f4", b"d": "<f8", b"i": "<i4", b"l": "<i8", b"b": "u1", b"c": "u1"}
_ADVICE = "export it again"


class Budget:
    """How many bytes all arrays of a file may still be unpacked to.

    Args:
        size: bytes of the file.
    """

    def __init__(self, size: int) -> None:
        self.whole = self.remaining = min(FBX_UNPACKED, FBX_FREE_UNPACKED + FBX_UNPACKED_PER_BYTE * size)


@dataclass(frozen=True, eq=False)
class PackedArray:
    """An array as it lies in the file."""

    dtype: str
    count: int
    is_deflated: bool
    data: memoryview
    budget: Budget

    def unpack(self) -> Array:
        """(count,) numbers.

        Raises:
            InputError: they are cut off, or are more than a file may have.
        """
        size = self.count * np.dtype(self.dtype).itemsize
        self.budget.remaining -= size
        if self.budget.remaining < 0:
            raise InputError(f"an FBX becomes more than {self.budget.whole >> 20:,} MiB", "is it damaged?")
        try:
            raw = zlib.decompressobj().decompress(self.data, size) if self.is_deflated and size else bytes(self.data[:size])
        except zlib.error:
            raw = b""
        if len(raw) != size:
            raise InputError("an FBX is damaged: an array is cut off", _ADVICE)
        return np.frombuffer(raw, self.dtype)


class Node:
    """A node.

    Args:
        name: of it.
        values: that it has.
        raw: the bytes of the values in the file.
        read: reads the nodes in it, when they are needed: a character with many clips has 100,000s; None: it has no block of
            nodes, not even an empty one.
    """

    def __init__(
        self,
        name: str,
        values: list[object] | None = None,
        raw: bytes | memoryview = b"",
        read: Callable[[], list[Node]] | None = None,
    ) -> None:
        self.name, self.values, self.raw, self._read = name, values or [], raw, read

    @cached_property
    def nodes(self) -> list[Node]:
        """The nodes in it.

        Raises:
            InputError: they are damaged.
        """
        return [] if self._read is None else self._read()

    @property
    def has_block(self) -> bool:
        """Whether there is a block of nodes in it, which may be empty."""
        return self._read is not None

    def find(self, name: str) -> Node | None:
        """The first node of that name in it."""
        return next((node for node in self.nodes if node.name == name), None)

    def all(self, name: str) -> Iterator[Node]:
        """The nodes of that name in it."""
        return (node for node in self.nodes if node.name == name)

    def value(self, name: str, default: object = None) -> object:
        """The first value of the first node of that name."""
        node = self.find(name)
        return default if node is None or not node.values else node.values[0]

    def count(self, name: str) -> int:
        """How many numbers `array` would give, without unpacking them."""
        value = self.value(name)
        return value.count if isinstance(value, PackedArray) else 0

    def array(self, name: str) -> Array:
        """The numbers of the first node of that name; none where there is no such node."""
        value = self.value(name)
        if value is None:
            return np.zeros(0)
        if not isinstance(value, PackedArray):
            raise InputError(f"an FBX is damaged: {name} is no array", _ADVICE)
        return value.unpack()


def parse_fbx(data: bytes, name: str) -> Node:
    """Parse a file; give the root of its nodes.

    Args:
        data: of the file.
        name: how messages call it.

    Raises:
        InputError: it is text, older than version 7, damaged or cut off.
    """
    if not data.startswith(MAGIC[:20]):
        if b"FBX" in data[:200]:
            raise InputError(f"{name} is an FBX as text", "export it as binary FBX")
        raise InputError(f"{name} is not a binary FBX file", _ADVICE)
    if len(data) < _FIRST:
        raise InputError(f"{name} is cut off", "copy or export it again")
    (version,) = struct.unpack_from("<I", data, len(MAGIC))
    if version < _OLDEST:
        raise InputError(f"{name} is FBX of version {version / 1000:.1f}", "export it as FBX 2011 or later (version 7)")
    return _Parser(memoryview(data), name, wide=version >= _WIDE).parse()


class _Parser:
    def __init__(self, data: memoryview, name: str, *, wide: bool) -> None:
        self._data, self._name = data, name
        self._head = struct.Struct("<QQQB" if wide else "<IIIB")
        self._budget, self._remaining = Budget(len(data)), FBX_NODES

    def parse(self) -> Node:
        return Node("", read=lambda: self._nodes(_FIRST, len(self._data), 0))

    def _nodes(self, at: int, end: int, depth: int) -> list[Node]:
        """The nodes between two places."""
        try:
            return self._read_nodes(at, end, depth)
        except struct.error:
            raise self._damage("a value is cut off") from None
        except UnicodeDecodeError:
            raise self._damage("a node has no name that can be read") from None

    def _read_nodes(self, at: int, end: int, depth: int) -> list[Node]:
        nodes: list[Node] = []
        if depth > FBX_DEPTH:
            raise self._damage("its nodes are nested too deeply")
        while at + self._head.size <= end:
            stop, count, size, length = self._head.unpack_from(self._data, at)
            if stop == 0:
                break
            start = at + self._head.size + length
            if not start + size <= stop <= end:
                raise self._damage("a node ends beyond its parent")
            self._remaining -= 1
            if self._remaining < 0:
                raise InputError(f"{self._name} has more than {FBX_NODES:,} nodes", "is it damaged?")
            name = bytes(self._data[start - length : start]).decode("utf-8")
            inside = partial(self._nodes, start + size, stop, depth + 1) if stop > start + size else None
            values = self._values(start, start + size, count)
            nodes.append(Node(name, values, self._data[start : start + size], inside))
            at = stop
        return nodes

    def _values(self, at: int, end: int, count: int) -> list[object]:
        values: list[object] = []
        for _ in range(count):
            if at >= end:
                raise self._damage("a node has fewer values than it says")
            kind = bytes(self._data[at : at + 1])
            at += 1
            if kind in _PLAIN:
                values.append(struct.unpack_from(_PLAIN[kind], self._data, at)[0])
                at += struct.calcsize(_PLAIN[kind])
            elif kind in (b"S", b"R"):
                (length,) = struct.unpack_from("<I", self._data, at)
                raw = bytes(self._data[at + 4 : at + 4 + length])
                values.append(raw.decode("utf-8", "replace") if kind == b"S" else raw)
                at += 4 + length
            elif kind in _ARRAYS:
                size, is_deflated, length = struct.unpack_from("<III", self._data, at)
                data = self._data[at + 12 : at + 12 + length]
                values.append(PackedArray(_ARRAYS[kind], size, is_deflated == 1, data, self._budget))
                at += 12 + length
            else:
                raise self._damage(f"a value of kind {kind!r}")
        if at > end:
            raise self._damage("a value is cut off")
        return values

    def _damage(self, what: str) -> InputError:
        return InputError(f"{self._name} is damaged: {what}", _ADVICE)
