"""Write glTF 2.0 binary files in one pass, with data that need not fit in memory.

Section numbers are those of the glTF 2.0 specification (Khronos, 2021).
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterable
from typing import Any, BinaryIO

import numpy as np

from ..errors import InputError, InternalError
from ..motion.rotations import Array
from .glb_container import BIN, JSON, MAGIC
from .gltf import COMPONENTS, WIDTHS

__all__ = ["GltfBuilder"]


class GltfBuilder:
    """Collects a document and its data, then writes both; data may come in blocks, so that it need not fit in memory.

    ``json`` is the document to fill in; ``first``: bytes at the start of the binary chunk (for copies of other files, whose
    buffer views stay valid).
    """

    def __init__(self, document: dict[str, Any], first: bytes = b"") -> None:
        self.json = document
        self._parts: list[tuple[int, Callable[[], Iterable[bytes]]]] = [(len(first), lambda: [first])]
        self._size = len(first)

    def add(self, array: Array, kind: str, *, target: int | None = None, bounds: bool = False, normalized: bool = False) -> int:
        """A new accessor of ``kind`` (``"VEC3"``) over ``array``, whose dtype picks the component type; returns its index."""
        array = np.ascontiguousarray(array)
        limits = (array.reshape(len(array), -1).min(0), array.reshape(len(array), -1).max(0)) if bounds else None
        data = array.tobytes()
        return self.add_blocks(
            lambda: [data], len(array), kind, array.dtype.str, target=target, limits=limits, normalized=normalized
        )

    def add_blocks(
        self, blocks: Callable[[], Iterable[bytes]], count: int, kind: str, dtype: str, *,
        target: int | None = None, limits: tuple[Array, Array] | None = None, normalized: bool = False,
    ) -> int:  # fmt: skip
        """A new accessor whose ``count`` elements are produced when the file is written."""
        component = next(code for code, name in COMPONENTS.items() if np.dtype(name) == np.dtype(dtype))
        view = self.add_view(blocks, count * WIDTHS[kind] * np.dtype(dtype).itemsize, target)
        entry: dict[str, Any] = {"bufferView": view, "componentType": component, "count": count, "type": kind}
        if normalized:
            entry["normalized"] = True
        if limits is not None:
            entry |= {"min": limits[0].tolist(), "max": limits[1].tolist()}
        return self.append("accessors", entry)

    def add_sparse(self, array: Array) -> int:
        """A VEC3 accessor of float32 offsets, most of which are zero (3.6.2.3)."""
        array = np.ascontiguousarray(array, "<f4")
        at = np.flatnonzero(np.any(array != 0, axis=1))
        at = at if len(at) else np.zeros(1, int)  # a sparse accessor has at least one element
        code, dtype = (5123, "<u2") if len(array) < 65536 else (5125, "<u4")
        indices, values = at.astype(dtype).tobytes(), array[at].tobytes()
        sparse = {
            "count": len(at),
            "indices": {"bufferView": self.add_view(lambda: [indices], len(indices)), "componentType": code},
            "values": {"bufferView": self.add_view(lambda: [values], len(values))},
        }
        entry = {"componentType": 5126, "count": len(array), "type": "VEC3", "sparse": sparse}
        low, high = array.min(0), array.max(0)
        return self.append("accessors", entry | {"min": low.tolist(), "max": high.tolist()})

    def add_view(self, blocks: Callable[[], Iterable[bytes]], size: int, target: int | None = None) -> int:
        """A new buffer view of ``size`` bytes on a multiple of four; returns its index."""
        pad = -self._size % 4
        if pad:
            self._parts.append((pad, lambda: [bytes(pad)]))
        view = {"buffer": 0, "byteOffset": self._size + pad, "byteLength": size}
        self._parts.append((size, blocks))
        self._size += pad + size
        return self.append("bufferViews", view | ({"target": target} if target else {}))

    def append(self, key: str, entry: dict[str, Any]) -> int:
        """Append to a top-level list and return the index."""
        entries = self.json.setdefault(key, [])
        entries.append(entry)
        return len(entries) - 1

    def write(self, file: BinaryIO) -> None:
        """Write the GLB.

        Raises:
            InputError: it would have more than 4 GiB, which the container cannot hold.
        """
        pad = -self._size % 4
        first, *others = self.json.get("buffers") or [{}]
        self.json["buffers"] = [first | {"byteLength": self._size + pad}, *others]
        text = json.dumps(self.json, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        length = 12 + 8 + len(text) + 8 + self._size + pad
        if length >= 1 << 32:
            raise InputError(f"a GLB of {length >> 20} MiB is more than the format can hold", "export it in pieces")
        file.write(struct.pack("<5I", MAGIC, 2, length, len(text), JSON) + text)
        file.write(struct.pack("<II", self._size + pad, BIN))
        for size, blocks in self._parts:
            for block in blocks():
                file.write(block)
                size -= len(block)
            if size:
                raise InternalError(f"{size} bytes are missing from a buffer view")
        file.write(bytes(pad))
