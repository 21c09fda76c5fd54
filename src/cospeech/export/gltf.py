"""Reading glTF 2.0 files without trusting them.

Read only what a moving character needs: buffers, accessors (also sparse, normalised and strided ones), the node tree. Section
numbers are those of the glTF 2.0 specification (Khronos, 2021).
"""

from __future__ import annotations

import base64
import binascii
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from typing import Any

import numpy as np

from ..errors import CospeechError, InputError
from ..limits import GLTF_VALUES, GLTF_ZEROS
from ..motion.rotations import Array
from .glb_container import split_glb
from .reading import read_bytes

__all__ = ["COMPONENTS", "WIDTHS", "GltfFile", "read_glb", "report_damage"]

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}  # 3.6.2.2
"""Code of a component type → numpy dtype."""
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Type of an accessor → numbers per element."""
_FREE, _PER_BYTE = 8_000_000, 16  # ours: numbers that all accessors together may have, and so many more per byte of the file


@contextmanager
def report_damage(name: str) -> Iterator[None]:
    """Turn errors that damaged JSON causes (wrong types, missing keys, indices out of range) into an `InputError`."""
    try:
        yield
    except CospeechError:
        raise
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError, MemoryError) as error:
        raise InputError(f"{name} is damaged: {type(error).__name__} {error}"[:160], "export it again") from None


class GltfFile:
    """A parsed glTF file: ``json`` is the document, `accessor` gives its arrays.

    Args:
        document: the parsed JSON.
        binary: the binary chunk.
        name: how messages call the file.
        size: bytes of the file; those of the binary chunk where not given.
    """

    def __init__(self, document: dict[str, Any], binary: bytes | memoryview, name: str, size: int | None = None) -> None:
        self.json, self.name, self.size = document, name, len(binary) if size is None else size
        self._binary, self._remaining = binary, _FREE + _PER_BYTE * self.size
        for key in ("nodes", "meshes", "accessors", "bufferViews", "buffers", "animations", "skins", "scenes"):
            value = document.get(key, [])
            if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
                raise InputError(f"{name} is damaged: {key!r} is not a list of objects", "export it again")
        self.parents = self._tree()
        self._buffers: dict[int, bytes | memoryview] = {}

    def _tree(self) -> list[int]:
        """Parent of every node (−1 for roots); a node with two parents or a loop is refused (5.25)."""
        nodes = self.list("nodes")
        parents = [-1] * len(nodes)
        for k, node in enumerate(nodes):
            for child in node.get("children", []):
                if not isinstance(child, int) or not 0 <= child < len(nodes) or parents[child] != -1 or child == k:
                    raise InputError(f"{self.name} is damaged: node {k} has child {child!r}", "export it again")
                parents[child] = k
        state = [0] * len(nodes)  # 0 not seen, 1 on the way up, 2 reaches a root
        for k in range(len(nodes)):
            path = []
            while k >= 0 and state[k] == 0:
                state[k] = 1
                path.append(k)
                k = parents[k]
            if k >= 0 and state[k] == 1:
                raise InputError(f"{self.name} is damaged: node {k} is its own ancestor", "export it again")
            for each in path:
                state[each] = 2
        return parents

    def curves(self, index: int) -> dict[tuple[int, str], Any] | None:
        """The curves of an animation, where they are not in the document (see `cospeech.export.tracks.read_animation`)."""
        return None

    def list(self, key: str) -> list[dict[str, Any]]:
        """A top-level list, empty where absent."""
        return self.json.get(key, [])

    def buffer(self, index: int) -> bytes | memoryview:
        """The bytes of a buffer: the binary chunk, or data embedded in the document."""
        if index not in self._buffers:
            uri = self.list("buffers")[index].get("uri")
            if uri is None:
                self._buffers[index] = self._binary
            elif isinstance(uri, str) and uri.startswith("data:") and ";base64," in uri[:100]:
                try:
                    self._buffers[index] = base64.b64decode(uri.split(";base64,", 1)[1], validate=True)
                except binascii.Error:
                    raise InputError(f"{self.name} is damaged: buffer {index} is not base64", "export it again") from None
            else:
                raise InputError(f"{self.name} keeps data in {str(uri)[:60]!r}", "export it as one .glb file")
        return self._buffers[index]

    def view(self, index: int) -> bytes:
        """The bytes of a buffer view, such as those of an embedded image; an `InputError` where it is out of bounds."""
        with report_damage(self.name):
            length = _natural(self.list("bufferViews")[_natural(index)]["byteLength"])
            return self._view(index, 0, 1, length, length).tobytes()

    def _view(self, index: int, offset: int, count: int, size: int, stride: int | None = None) -> Array:
        """(count, size) bytes out of a buffer view, bounds checked."""
        view = self.list("bufferViews")[_natural(index)]
        buffer = self.buffer(_natural(view["buffer"]))
        start, length = _natural(view.get("byteOffset", 0)), _natural(view["byteLength"])
        step = _natural(view.get("byteStride", size)) if stride is None else stride
        offset = _natural(offset)
        fits = step >= size and start + length <= len(buffer) and (count == 0 or offset + (count - 1) * step + size <= length)
        if not fits:
            raise InputError(f"{self.name} is damaged: data beyond the end of buffer view {index}", "is it cut off?")
        raw = np.frombuffer(buffer, np.uint8, length, start) if length else np.zeros(0, np.uint8)
        return np.lib.stride_tricks.as_strided(raw[offset:], (count, size), (step, 1), writeable=False)

    def accessor(self, index: int, width: int) -> Array:
        """Numbers of an accessor as ``(count, width)``: float32 where stored so or normalised, else integers.

        Raises:
            InputError: another width than asked for, data out of bounds, numbers that are not finite.
        """
        with report_damage(self.name):
            entry = self.list("accessors")[_natural(index)]
            dtype, count = np.dtype(COMPONENTS[entry["componentType"]]), _natural(entry["count"])
            if WIDTHS[entry["type"]] != width:
                raise InputError(f"{self.name} is damaged: accessor {index} is {entry['type']}", f"expected {width} components")
            if count * width > (GLTF_VALUES if "bufferView" in entry else GLTF_ZEROS):
                raise InputError(f"{self.name}: accessor {index} has {count} elements", "is it damaged?")
            self._remaining -= count * width
            if self._remaining < 0:  # accessors may share their bytes, or have none
                most = _FREE + _PER_BYTE * self.size
                raise InputError(f"{self.name} asks for more than {most:,} numbers in {self.size:,} bytes", "is it damaged?")
            size = dtype.itemsize * width
            if "bufferView" in entry:
                raw = self._view(entry["bufferView"], entry.get("byteOffset", 0), count, size)
                values = np.ascontiguousarray(raw).view(dtype)
            else:
                values = np.zeros((count, width), dtype)
            if "sparse" in entry:
                values = self._sparse(values.copy(), entry["sparse"], size)
            return _as_numbers(values, bool(entry.get("normalized", False)), self.name)

    def _sparse(self, values: Array, sparse: dict[str, Any], size: int) -> Array:
        """Replace the listed elements (3.6.2.3)."""
        count, indices = _natural(sparse["count"]), sparse["indices"]
        kind = np.dtype(COMPONENTS[indices["componentType"]])
        at = np.ascontiguousarray(self._view(indices["bufferView"], indices.get("byteOffset", 0), count, kind.itemsize))
        at = at.view(kind)[:, 0].astype(np.int64)
        replacement = self._view(sparse["values"]["bufferView"], sparse["values"].get("byteOffset", 0), count, size)
        if kind.kind == "f" or (count and (at.min() < 0 or at.max() >= len(values))):
            raise InputError(f"{self.name} is damaged: sparse accessor points outside", "export it again")
        values[at] = np.ascontiguousarray(replacement).view(values.dtype)
        return values


def _natural(value: object) -> int:
    """``value`` if it is an index or a size."""
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 1 << 48:
        raise ValueError(f"{value!r} is no index")
    return value


def _as_numbers(values: Array, normalized: bool, name: str) -> Array:
    if values.dtype.kind == "f":
        if not np.isfinite(values).all():
            raise InputError(f"{name} holds values that are not finite", "is it damaged?")
        return values
    if not normalized:
        return values
    numbers = values.astype(np.float32) / np.iinfo(values.dtype).max  # 3.11, "dequantisation"
    return np.maximum(numbers, -1) if values.dtype.kind == "i" else numbers


def read_glb(path: str | PathLike[str]) -> GltfFile:
    """Read a ``.glb``, ``.vrm`` or ``.vrma``; a text ``.gltf`` works where its buffers are embedded.

    Raises:
        InputError: not glTF 2.0, truncated, or damaged.
    """
    name = repr(str(path))
    data = read_bytes(path)
    document, binary = split_glb(data, name)
    with report_damage(name):
        version = document.get("asset", {}).get("version")
        if version != "2.0":
            raise InputError(f"{name} is glTF {str(version)[:20]}", "only glTF 2.0 can be read")
        return GltfFile(document, binary, name, len(data))
