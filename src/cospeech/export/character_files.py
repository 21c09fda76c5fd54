"""Files that hold a character, of any make, as a glTF document."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from .gltf import GltfFile, read_glb

__all__ = ["CHARACTERS", "read_character"]

CHARACTERS = (".glb", ".gltf", ".vrm", ".fbx")
"""Suffixes of files that hold a character."""


def read_character(path: str | PathLike[str]) -> GltfFile:
    """Read a ``.glb``, ``.vrm`` or ``.fbx``.

    Raises:
        InputError: it is none of these, or damaged.
    """
    if Path(path).suffix.lower() == ".fbx":
        from .fbx.to_gltf import read_fbx

        return read_fbx(path)
    return read_glb(path)
