"""Put the surfaces of somebody's character into its T-pose, as parts that are drawn like our mannequin's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..limits import AVATAR_SHAPE_NUMBERS, AVATAR_VERTICES
from ..motion.rotations import Array
from .avatar_skeleton import TPose
from .character_files import check_packing
from .gltf import GltfFile
from .mannequin.character import Part
from .surface import Surface, normalise_normals
from .textures import Material, MaterialReader

__all__ = ["MeshBaker"]

_TRIANGLES = 4  # 5.24: the ``mode`` of a list of triangles


@dataclass(frozen=True, eq=False)
class _Skinning:
    """How vertices get into the T-pose: by (V, 4, 4) matrices; and (V, 4) joints of ours with their weights."""

    matrices: Array
    joints: Array
    weights: Array


class MeshBaker:
    """Makes parts from the meshes of a file.

    Args:
        file: the character.
        tpose: its nodes in the T-pose.
        shapes: mesh node → target → name of the shape that moves it.
        base: mesh node → (n,) weights of its targets at rest.

    Raises:
        InputError: the meshes are packed in a way that cannot be read.
    """

    def __init__(
        self, file: GltfFile, tpose: TPose, shapes: Mapping[int, Mapping[int, str]], base: Mapping[int, Array]
    ) -> None:
        check_packing(file)
        self._file, self._tpose, self._shapes, self._base = file, tpose, shapes, base
        self._materials = MaterialReader(file)
        self._vertices, self._numbers = AVATAR_VERTICES, AVATAR_SHAPE_NUMBERS

    def parts(self) -> list[Part]:
        """All surfaces. A surface that is seen from both sides gives two parts: front and back."""
        parts = []
        for node, entry in enumerate(self._file.list("nodes")):
            if "mesh" not in entry:
                continue
            mesh = self._file.list("meshes")[entry["mesh"]]
            rest = self._base.get(node, np.array(entry.get("weights", mesh.get("weights", [])), float))
            for primitive in mesh["primitives"]:
                if primitive.get("mode", _TRIANGLES) == _TRIANGLES and "POSITION" in primitive["attributes"]:
                    material = self._materials.read(primitive.get("material"))
                    parts += self._sides(self._part(node, primitive, rest, material), material.double_sided)
        return parts

    def _sides(self, part: Part, both: bool) -> list[Part]:
        self._vertices -= len(part.vertices) * (1 + both)
        self._numbers -= 3 * len(part.vertices) * len(part.morphs) * (1 + both)
        if self._vertices < 0 or self._numbers < 0:
            raise InputError(
                f"{self._file.name} has more than {AVATAR_VERTICES:,} vertices, or too many shapes of them",
                "simplify its meshes",
            )
        if not len(part.triangles):
            return []
        back = replace(part, name=f"{part.name} back", normals=-part.normals, triangles=part.triangles[:, ::-1].copy())
        return [part, back] if both else [part]

    def _part(self, node: int, primitive: dict[str, Any], rest: Array, material: Material) -> Part:
        attributes = primitive["attributes"]
        points = self._file.accessor(attributes["POSITION"], 3).astype(np.float64)
        indices, triangles = self._triangles(primitive, len(points))
        points = points[indices]

        def attribute(name: str, width: int) -> Array | None:
            values = self._file.accessor(attributes[name], width) if name in attributes else None
            return None if values is None else values[indices]

        skinning = self._skinning(node, attribute, len(points))
        turn = skinning.matrices[:, :3, :3]
        morphs = {}
        for target, entry in enumerate(primitive.get("targets", [])):
            shape, still = self._shapes.get(node, {}).get(target), float(rest[target]) if target < len(rest) else 0.0
            if "POSITION" in entry and (shape or still):
                delta = self._file.accessor(entry["POSITION"], 3)[indices]
                points += still * delta
                if shape and delta.any():
                    morphs[shape] = np.einsum("vij,vj->vi", turn, delta).astype(np.float32)
        vertices = np.einsum("vij,vj->vi", turn, points) + skinning.matrices[:, :3, 3]
        if len(turn) and np.median(np.linalg.det(turn)) < 0:
            triangles = triangles[:, ::-1].copy()
        normals = attribute("NORMAL", 3)
        normals = _vertex_normals(vertices, triangles) if normals is None else np.einsum("vij,vj->vi", turn, normals)
        colour, opacity = self._colour(attributes, indices, material)
        surface = None
        if material.texture is not None or material.cutoff != 0:
            places = attribute(f"TEXCOORD_{material.texcoord}", 2)
            places = np.zeros((len(points), 2)) if places is None else places
            places = places @ material.transform[:, :2].T + material.transform[:, 2]
            surface = Surface(material.texture, places.astype(np.float32), opacity, material.cutoff)
        return Part(
            material.name, vertices.astype(np.float32), normalise_normals(normals), triangles,
            skinning.joints, skinning.weights, colour, material.roughness, morphs, surface,
        )  # fmt: skip

    def _triangles(self, primitive: dict[str, Any], count: int) -> tuple[Array, Array]:
        """The vertices that are used, and (F, 3) indices into these."""
        corners = np.arange(count) if "indices" not in primitive else self._file.accessor(primitive["indices"], 1)[:, 0]
        corners = corners[: len(corners) // 3 * 3].astype(np.int64)
        if len(corners) and not 0 <= corners.min() <= corners.max() < count:
            raise InputError(f"{self._file.name} is damaged: a triangle has a corner that is not there", "export it again")
        if len(corners) > 6 * AVATAR_VERTICES:
            raise InputError(f"{self._file.name} has {len(corners) // 3:,} triangles in one surface", "simplify its meshes")
        indices, local = np.unique(corners, return_inverse=True)
        return indices, local.reshape(-1, 3).astype(np.int32)

    def _skinning(self, node: int, attribute: Any, count: int) -> _Skinning:
        entry, tpose = self._file.list("nodes")[node], self._tpose
        if "skin" not in entry or attribute("JOINTS_0", 4) is None:  # hangs on one bone
            joints, weights = np.zeros((count, 4), np.int32), np.zeros((count, 4), np.float32)
            joints[:, 0], weights[:, 0] = tpose.owners[node], 1
            return _Skinning(np.broadcast_to(tpose.matrices[node], (count, 4, 4)), joints, weights)
        skin = self._file.list("skins")[entry["skin"]]
        bones = np.array([int(k) for k in skin["joints"]])
        bind = np.tile(np.eye(4), (len(bones), 1, 1))
        if "inverseBindMatrices" in skin:
            bind = self._file.accessor(skin["inverseBindMatrices"], 16)[: len(bones)].reshape(-1, 4, 4).transpose(0, 2, 1)
        matrices = tpose.matrices[bones] @ bind
        columns = [(attribute(f"JOINTS_{k}", 4), attribute(f"WEIGHTS_{k}", 4)) for k in range(2)]
        joints = np.concatenate([j for j, w in columns if j is not None and w is not None], 1).astype(np.int64)
        weights = np.concatenate([w for j, w in columns if j is not None and w is not None], 1).astype(np.float64)
        most = np.argsort(-weights, axis=1, kind="stable")[:, :4]
        joints, weights = np.take_along_axis(joints, most, 1), np.maximum(np.take_along_axis(weights, most, 1), 0)
        weights[weights.sum(1) < 1e-6, 0] = 1
        weights /= weights.sum(1, keepdims=True)
        blend = np.einsum("vk,vkij->vij", weights, matrices[joints])
        return _Skinning(blend, tpose.owners[bones[joints]].astype(np.int32), weights.astype(np.float32))

    def _colour(self, attributes: dict[str, int], indices: Array, material: Material) -> tuple[Array, Array]:
        """Linear RGB, (3,) or (V, 3), and opacities (V,)."""
        colour, opacity = material.colour[:3], np.full(len(indices), material.colour[3], np.float32)
        if "COLOR_0" not in attributes:
            return colour, opacity
        width = 4 if self._file.list("accessors")[attributes["COLOR_0"]]["type"] == "VEC4" else 3
        values = np.clip(self._file.accessor(attributes["COLOR_0"], width)[indices], 0, 1)
        return colour * values[:, :3], opacity * values[:, 3].astype(np.float32) if width == 4 else opacity


def _vertex_normals(points: Array, triangles: Array) -> Array:
    a, b, c = points[triangles[:, 0]], points[triangles[:, 1]], points[triangles[:, 2]]
    face, total = np.cross(b - a, c - a), np.zeros_like(points)
    for k in range(3):
        np.add.at(total, triangles[:, k], face)
    return total
