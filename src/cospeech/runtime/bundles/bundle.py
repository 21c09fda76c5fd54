"""A trained system as one file, ``name.cospeech``: a zip of plain members that is safe to open, whoever made it.

``bundle.json`` (the manifest: format, model, sizes, facts, and the SHA-256 of every other member), ``*.safetensors``
(arrays), ``*.onnx`` (graphs without weights), ``card.md``. Members are stored, not compressed: what is read is never larger
than the file.
Everything is checked before it is used: names, sizes, hashes; there is no pickle, no program, and no path to another file.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
import struct
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike, fsdecode
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...export.arrays import check_zip
from ...files import atomic, parse_json, read_regular
from ...limits import (  # fmt: skip
    BUNDLE_CARD_BYTES,
    BUNDLE_GRAPH_BYTES,
    BUNDLE_MANIFEST_BYTES,
    BUNDLE_MEMBERS,
    BUNDLE_WEIGHTS_BYTES,
    TENSORS_HEAD_BYTES,
)
from ...motion.rotations import Array

__all__ = ["FORMAT", "MANIFEST", "Bundle", "pack_arrays", "read_bundle", "write_bundle"]

FORMAT = 2
"""Of the container and its manifest; a later one is refused with the advice to update."""
MANIFEST = "bundle.json"
_LARGEST = {
    ".json": BUNDLE_MANIFEST_BYTES, ".md": BUNDLE_CARD_BYTES, ".onnx": BUNDLE_GRAPH_BYTES, ".safetensors": BUNDLE_WEIGHTS_BYTES,
}  # fmt: skip
_LARGEST_NUMBER = 2**53  # of a manifest; ours: floats hold all whole numbers up to there
_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,40}\.(json|md|onnx|safetensors)")
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the same contents, the same bytes
_HINT = "is the file damaged, or not a bundle of ours?"


@dataclass(frozen=True)
class Bundle:
    """The content of a file: checked, but not yet interpreted."""

    name: str
    manifest: Mapping[str, Any]
    members: Mapping[str, bytes]

    def fact(self, key: str, kind: type | tuple[type, ...]) -> Any:
        """A value of the manifest.

        Raises:
            InputError: it is missing or of another type.
        """
        value = self.manifest.get(key)
        if not isinstance(value, kind) or isinstance(value, bool):
            raise InputError(f"{self.name!r}: {key!r} of its manifest is {str(value)[:60]!r}", _HINT)
        return value

    def arrays(self, member: str) -> dict[str, Array]:
        """The arrays of a safetensors member.

        Raises:
            InputError: there is no such member, or it is damaged.
        """
        from safetensors import SafetensorError
        from safetensors.numpy import load

        if member not in self.members:
            raise InputError(f"{self.name!r} has no {member}", _HINT)
        data = self.members[member]
        if int.from_bytes(data[:8], "little") > TENSORS_HEAD_BYTES:  # of its list of arrays (safetensors, "Format")
            raise InputError(f"{member} of {self.name!r} lists more than {TENSORS_HEAD_BYTES >> 20} MiB of arrays", _HINT)
        try:
            return load(data)
        except (SafetensorError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{member} of {self.name!r} cannot be read: {error}"[:200], _HINT) from None

    def graphs(self) -> dict[str, bytes]:
        """The ONNX members, by their names without the suffix."""
        return {name.removesuffix(".onnx"): data for name, data in self.members.items() if name.endswith(".onnx")}


def pack_arrays(arrays: Mapping[str, Array]) -> bytes:
    """Arrays as a safetensors member."""
    from safetensors.numpy import save

    return save({name: np.ascontiguousarray(value) for name, value in arrays.items()})


def write_bundle(path: str | PathLike[str], manifest: Mapping[str, Any], members: Mapping[str, bytes]) -> None:
    """Write a bundle; it appears whole or not at all, and the same contents give the same bytes.

    Args:
        manifest: facts; ``format`` and ``members`` are added.
        members: name → bytes.

    Raises:
        InputError: a name or a size that no bundle can have, or the file cannot be written.
    """
    hashes = {name: hashlib.sha256(data).hexdigest() for name, data in members.items()}
    head = json.dumps({**manifest, "format": FORMAT, "members": hashes}, indent=1, sort_keys=True, ensure_ascii=False)
    everything = {MANIFEST: head.encode(), **members}
    _check_names({name: len(data) for name, data in everything.items()}, fsdecode(path))
    with atomic(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED) as archive:
        for name, data in everything.items():
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), data)


def read_bundle(path: str | PathLike[str], format: int = FORMAT) -> Bundle:
    """Read a bundle of a format, trusting nothing in it.

    Raises:
        InputError: it cannot be read, is none of ours or of a later version, damaged, or was tampered with.
    """
    label = Path(fsdecode(path)).name
    members = _unzip(read_regular(path, "a bundle", sum(_LARGEST.values())), label)
    manifest = _manifest(members.pop(MANIFEST, b""), label, format)
    hashes = manifest["members"]
    if set(hashes) != set(members):
        raise InputError(f"{label!r} does not hold the members that it lists", _HINT)
    for name, content in members.items():
        if hashlib.sha256(content).hexdigest() != hashes[name]:
            raise InputError(f"{name} of {label!r} is not what the manifest says (SHA-256 differs)", _HINT)
    return Bundle(label, manifest, members)


def _check_names(sizes: Mapping[str, int], label: str) -> None:
    if len(sizes) > BUNDLE_MEMBERS:
        raise InputError(f"{label!r} has {len(sizes)} members, more than a bundle can have", _HINT)
    for name, size in sizes.items():
        if not _NAME.fullmatch(name):
            raise InputError(f"{label!r} has the unknown member {name[:60]!r}", _HINT)
        if size > _LARGEST[Path(name).suffix]:
            raise InputError(f"{name} of {label!r} has {size:,} bytes", f"at most {_LARGEST[Path(name).suffix]:,}")


def _unzip(data: bytes, label: str) -> dict[str, bytes]:
    """Name → bytes; nothing is read before the sizes of all are known to be possible."""
    check_zip(io.BytesIO(data), BUNDLE_MEMBERS, repr(label))
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = archive.infolist()
            names = [entry.filename for entry in entries]
            if len(set(names)) < len(names):
                raise InputError(f"{label!r} has two members of one name", _HINT)
            _check_names({entry.filename: entry.file_size for entry in entries}, label)
            if any(e.compress_type != zipfile.ZIP_STORED or e.compress_size != e.file_size or e.flag_bits & 1 for e in entries):
                raise InputError(f"{label!r} has members that are compressed or encrypted", _HINT)
            if sum(entry.file_size for entry in entries) > len(data):
                raise InputError(f"{label!r} is shorter than its members", _HINT)
            return {entry.filename: archive.read(entry) for entry in entries}
    except (zipfile.BadZipFile, OSError, EOFError, ValueError, RuntimeError, NotImplementedError, struct.error) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{label!r} cannot be unpacked: {error}"[:200], _HINT) from None


def _manifest(data: bytes, label: str, format: int) -> dict[str, Any]:
    try:
        manifest = parse_json(data, MANIFEST, BUNDLE_MANIFEST_BYTES)
        fine = _sensible(manifest)
    except (InputError, RecursionError):
        raise InputError(f"{label!r} has no readable {MANIFEST}", _HINT) from None
    if not isinstance(manifest, dict) or not isinstance(manifest.get("format"), int) or not fine:
        raise InputError(f"{label!r} has a {MANIFEST} that cospeech did not write", _HINT)
    if manifest["format"] != format:
        if format < FORMAT == manifest["format"]:
            raise InputError(f"{label!r} is a bundle of format {FORMAT}, which is today's", "it need not be converted")
        hint = "update cospeech" if manifest["format"] > FORMAT else f"`cospeech bundle {label} -o new.cospeech` converts it"
        raise InputError(f"{label!r} is a bundle of format {manifest['format']}, this version reads {format}", hint)
    hashes = manifest.get("members")
    if not isinstance(hashes, dict) or not all(isinstance(value, str) for value in hashes.values()):
        raise InputError(f"{label!r} does not list its members", _HINT)
    return manifest


def _sensible(value: Any) -> bool:
    """Whether all numbers of a document are finite, and whole ones not too large for a float."""
    if isinstance(value, dict | list):
        return all(map(_sensible, value.values() if isinstance(value, dict) else value))
    return not isinstance(value, int | float) or abs(value) <= _LARGEST_NUMBER
