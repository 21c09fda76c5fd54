"""The container of binary glTF: a header, a JSON chunk, a binary chunk (glTF 2.0, section 4.4)."""

from __future__ import annotations

import struct
from typing import Any

from ..errors import InputError
from ..files import parse_json
from ..limits import GLTF_JSON_VALUES

__all__ = ["BIN", "JSON", "MAGIC", "split_glb"]

MAGIC, JSON, BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
"""``glTF``, ``JSON`` and ``BIN\\0`` as little-endian numbers."""


def split_glb(data: bytes, name: str) -> tuple[dict[str, Any], bytes | memoryview]:
    """The JSON document and the binary chunk of a GLB (4.4); the chunk is no copy."""
    if data[:1] in (b"{", b" ", b"\n"):
        return _parse_json(data, name), b""
    if len(data) < 20 or struct.unpack_from("<I", data)[0] != MAGIC:
        raise InputError(f"{name} is not a binary glTF file", "expected .glb, .vrm or .vrma")
    _, version, length, json_length, kind = struct.unpack_from("<5I", data)
    if version != 2 or kind != JSON:
        raise InputError(f"{name} is not a glTF 2.0 binary file", "export it again")
    if length > len(data) or 20 + json_length > length:
        raise InputError(f"{name} is cut off: {len(data)} of {length} bytes", "copy or export it again")
    document = _parse_json(data[20 : 20 + json_length], name)
    at = 20 + json_length + -json_length % 4
    if at + 8 > length:
        return document, b""
    size, kind = struct.unpack_from("<II", data, at)
    if kind != BIN:
        return document, b""
    if at + 8 + size > length:
        raise InputError(f"{name} is cut off inside its binary chunk", "copy or export it again")
    return document, memoryview(data)[at + 8 : at + 8 + size]


def _parse_json(text: bytes, name: str) -> dict[str, Any]:
    """The document, which has to be an object."""
    document = parse_json(text, f"the JSON of {name}", GLTF_JSON_VALUES)
    if not isinstance(document, dict):
        raise InputError(f"{name} is damaged: its JSON is no object", "export it again")
    return document
