"""Read a file that holds a character, of any format, as a glTF document."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from ..errors import InputError
from .gltf import GltfFile, read_glb

__all__ = ["CHARACTERS", "PACKED", "check_packing", "read_character"]

CHARACTERS = (".glb", ".gltf", ".vrm", ".fbx")
"""Suffixes of files that hold a character."""
_DRACO, _TEXTURES = "KHR_draco_mesh_compression", "KHR_texture_basisu"
PACKED = (_DRACO, "EXT_meshopt_compression", "KHR_meshopt_compression", _TEXTURES)
"""Extensions of packed meshes and textures, which a page cannot read. [ours]: decoders are WebAssembly, which the policy of our
pages forbids."""


def read_character(path: str | PathLike[str]) -> GltfFile:
    """Read a ``.glb``, ``.vrm`` or ``.fbx``.

    Raises:
        InputError: it is none of these, or damaged.
    """
    if Path(path).suffix.lower() == ".fbx":
        from .fbx.to_gltf import read_fbx

        return read_fbx(path)
    return read_glb(path)


def check_packing(file: GltfFile, *, in_page: bool = False) -> None:
    """Check that the surface of a character can be read here, or by the viewer of a page.

    Pictures leave out packed textures. Where a plain copy of a mesh lies beside a packed one, pictures take it; three.js, the
    library of the viewer, refuses the file if Draco packed it.

    Raises:
        InputError: it cannot be read.
    """
    needs, uses = (_names(file, key) for key in ("extensionsRequired", "extensionsUsed"))
    packings = {name for name in PACKED if name in needs and (in_page or name != _TEXTURES)}
    packings |= {_DRACO} & uses if in_page else set()
    if packings:
        raise InputError(f"{file.name} is packed by {min(packings)}", "export it without compression")


def _names(file: GltfFile, key: str) -> set[str]:
    names = file.json.get(key)
    return {str(name) for name in names} if isinstance(names, list) else set()
