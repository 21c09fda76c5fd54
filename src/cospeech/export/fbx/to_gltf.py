"""Read an FBX file as a glTF document of the same content, so that all readers of characters read FBX, too.

Bones keep their names and their tree, below one node that converts the file's axes to Y up and its unit to metres. Skin,
blendshapes, colours, textures that lie in the file, and animations are kept; cameras, lights and constraints are left out.
"""

from __future__ import annotations

import io
from os import PathLike
from typing import Any

import numpy as np

from ...errors import InputError
from ..glb_container import split_glb
from ..gltf import GltfFile, report_damage
from ..gltf_build import GltfBuilder
from ..reading import read_bytes
from ..tracks import Curve
from .clip_reader import list_clips, read_clip
from .document import MODEL, Document, FbxModel, Transform
from .mesh_reader import MeshReader
from .rest_pose import bind_models
from .tree import parse_fbx

__all__ = ["read_fbx"]

_LEFT_OUT = {"Camera", "Light", "CameraSwitcher", "CameraStereo"}  # sorts of models


def read_fbx(path: str | PathLike[str]) -> GltfFile:
    """Read a binary ``.fbx`` of version 7 (2011) or later.

    Raises:
        InputError: it is text, older, truncated or damaged.
    """
    name = repr(str(path))
    data = read_bytes(path)
    root = parse_fbx(data, name)
    with report_damage(name), np.errstate(all="ignore"):  # values that are not finite are refused later
        return FbxFile(Document(root, name), len(data))


class FbxFile(GltfFile):
    """The glTF document of an FBX; an animation is read when it is needed.

    Args:
        fbx: the file.
        size: its bytes.

    Attributes:
        models: the model of each node of the document, but for the last node, which holds all others.
        rest: the rest place of each of them.
        targets: node → numbers of the blendshape channels of its mesh.
    """

    def __init__(self, fbx: Document, size: int) -> None:
        self.fbx = fbx
        self.models = [FbxModel(entry) for entry in fbx.of_kind(MODEL) if entry.sort not in _LEFT_OUT]
        if not self.models:
            raise InputError(f"{fbx.name} holds no character", "export bones or meshes")
        parents = _find_parents(fbx, self.models)
        self.rest = bind_models(fbx, self.models, parents)
        builder, self.targets = _build(fbx, self.models, parents, self.rest)
        self._clips = list_clips(fbx)
        builder.json["animations"] = [{"name": clip.name, "channels": [], "samplers": []} for clip in self._clips]
        file = io.BytesIO()
        builder.write(file)
        document, binary = split_glb(file.getvalue(), fbx.name)
        super().__init__(document, binary, fbx.name, max(size, len(binary)))

    def curves(self, index: int) -> dict[tuple[int, str], Curve]:
        """See `GltfFile.curves`."""
        with report_damage(self.name), np.errstate(all="ignore"):
            return read_clip(self.fbx, self._clips[index], self.models, self.targets)


def _find_parents(fbx: Document, models: list[FbxModel]) -> list[int]:
    """Index of the parent of each model, -1 for none."""
    place = {model.object.number: k for k, model in enumerate(models)}
    parents = list[int]()
    for model in models:
        above = (entry.number for entry, _ in fbx.above(model.object.number, MODEL))
        parents.append(next((place[number] for number in above if number in place), -1))
    return parents


def _build(
    fbx: Document, models: list[FbxModel], parents: list[int], rests: list[Transform]
) -> tuple[GltfBuilder, dict[int, list[int]]]:
    """The document without animations, and the blendshape channels of each node."""
    builder = GltfBuilder({"asset": {"version": "2.0", "generator": "cospeech"}, "scene": 0})
    place = {model.object.number: k for k, model in enumerate(models)}
    nodes: list[dict[str, Any]] = [
        {"name": model.object.name, "translation": rest.translation.tolist(), "rotation": rest.rotation.tolist(),
         "scale": rest.scale.tolist()}
        for model, rest in zip(models, rests, strict=True)
    ]  # fmt: skip
    roots = [k for k, parent in enumerate(parents) if parent < 0]
    for k, parent in enumerate(parents):
        if parent >= 0:
            nodes[parent].setdefault("children", []).append(k)
    turn, unit = fbx.to_metres()
    for node in nodes:
        builder.append("nodes", node)
    world = builder.append("nodes", {"name": "FBX", "rotation": turn.tolist(), "scale": [unit] * 3, "children": roots})
    builder.json["scenes"] = [{"nodes": [world]}]
    meshes = MeshReader(fbx, builder, place)
    return builder, {k: meshes.add(model, k) for k, model in enumerate(models)}
