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

from ..errors import InputError
from ..files import atomic, describe_os_error
from ..rotations import Array

__all__ = ["FORMAT", "MANIFEST", "Bundle", "pack_arrays", "read_bundle", "write_bundle"]

FORMAT = 1
"""Of the container and its manifest; a later one is refused with the advice to update."""
MANIFEST = "bundle.json"
_LARGEST = {".json": 1 << 20, ".md": 1 << 20, ".onnx": 1 << 23, ".safetensors": 1 << 30}  # bytes; ours: twice a 120 M network
_MOST_MEMBERS = 32  # ours
_NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,40}\.(json|md|onnx|safetensors)")
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the same contents, the same bytes
_HINT = "is the file damaged, or not a bundle of ours?"


@dataclass(frozen=True)
class Bundle:
    """What a file held, checked but not interpreted."""

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
            raise InputError(f"{self.name!r} says {key!r} is {str(value)[:60]!r}", _HINT)
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
        try:
            return load(self.members[member])
        except (SafetensorError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{member} of {self.name!r} cannot be read: {error}"[:200], _HINT) from None

    def graphs(self) -> dict[str, bytes]:
        """The ONNX members, by their names without the suffix."""
        return {name.removesuffix(".onnx"): data for name, data in self.members.items() if name.endswith(".onnx")}


def pack_arrays(arrays: Mapping[str, Array]) -> bytes:
    """A safetensors member."""
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


def read_bundle(path: str | PathLike[str]) -> Bundle:
    """Read a bundle, trusting nothing in it.

    Raises:
        InputError: it cannot be read, is none of ours or of a later version, damaged, or was tampered with.
    """
    shown = Path(fsdecode(path)).name
    try:
        if not Path(path).is_file():
            raise FileNotFoundError(2, "no such file")
        size = Path(path).stat().st_size
        if size > sum(_LARGEST.values()):
            raise InputError(f"{shown!r} has {size:,} bytes, no bundle is so large", _HINT)
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {fsdecode(path)!r}: {describe_os_error(error)}", "is the name right?") from None
    except ValueError as error:  # a null character in the name
        raise InputError(f"cannot read {fsdecode(path)!r}: {error}", "is the name right?") from None
    members = _unzip(data, shown)
    manifest = _manifest(members.pop(MANIFEST, b""), shown)
    hashes = manifest["members"]
    if set(hashes) != set(members):
        raise InputError(f"{shown!r} does not hold the members that it lists", _HINT)
    for name, content in members.items():
        if hashlib.sha256(content).hexdigest() != hashes[name]:
            raise InputError(f"{name} of {shown!r} is not what the manifest says (SHA-256 differs)", _HINT)
    return Bundle(shown, manifest, members)


def _check_names(sizes: Mapping[str, int], shown: str) -> None:
    if len(sizes) > _MOST_MEMBERS:
        raise InputError(f"{shown!r} has {len(sizes)} members, no bundle has so many", _HINT)
    for name, size in sizes.items():
        if not _NAME.fullmatch(name):
            raise InputError(f"{shown!r} has a member called {name[:60]!r}", _HINT)
        if size > _LARGEST[Path(name).suffix]:
            raise InputError(f"{name} of {shown!r} has {size:,} bytes", f"at most {_LARGEST[Path(name).suffix]:,}")


def _unzip(data: bytes, shown: str) -> dict[str, bytes]:
    """Name → bytes; nothing is read before the sizes of all are known to be possible."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = archive.infolist()
            names = [entry.filename for entry in entries]
            if len(set(names)) < len(names):
                raise InputError(f"{shown!r} has two members of one name", _HINT)
            _check_names({entry.filename: entry.file_size for entry in entries}, shown)
            if any(e.compress_type != zipfile.ZIP_STORED or e.compress_size != e.file_size or e.flag_bits & 1 for e in entries):
                raise InputError(f"{shown!r} has members that are packed or locked", _HINT)
            if sum(entry.file_size for entry in entries) > len(data):
                raise InputError(f"{shown!r} claims to hold more than it has", _HINT)
            return {entry.filename: archive.read(entry) for entry in entries}
    except (zipfile.BadZipFile, OSError, EOFError, ValueError, RuntimeError, NotImplementedError, struct.error) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{shown!r} cannot be unpacked: {error}"[:200], _HINT) from None


def _manifest(data: bytes, shown: str) -> dict[str, Any]:
    try:
        manifest = json.loads(data.decode("utf-8"), parse_constant=_no_number)
    except (ValueError, RecursionError):
        raise InputError(f"{shown!r} has no readable {MANIFEST}", _HINT) from None
    if not isinstance(manifest, dict) or not isinstance(manifest.get("format"), int):
        raise InputError(f"{shown!r} has a {MANIFEST} that is none of ours", _HINT)
    if manifest["format"] != FORMAT:
        hint = "update cospeech" if manifest["format"] > FORMAT else "export it again"
        raise InputError(f"{shown!r} is a bundle of format {manifest['format']}, this version reads {FORMAT}", hint)
    hashes = manifest.get("members")
    if not isinstance(hashes, dict) or not all(isinstance(value, str) for value in hashes.values()):
        raise InputError(f"{shown!r} does not list its members", _HINT)
    return manifest


def _no_number(text: str) -> None:
    raise ValueError(f"{text} in JSON")
