"""Meshes of an FBX file as those of a glTF document: triangles, skin, blendshapes, colours, textures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError
from ...limits import FBX_CORNERS, FBX_SHAPE_POINTS
from ...motion.rotations import Array
from ..gltf_build import GltfBuilder
from ..render.light import from_srgb
from .document import Document, FbxModel, Object, rest_weight
from .tree import Node

__all__ = ["MeshReader"]

_MIMES = {b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg"}
_MOST_JOINTS = 4  # of a point
_LEAST_POINTS = 20_000  # that each shape counts for at least: a small one takes time, too; ours
_HALF = 0.5  # opacity below which a textured surface has a hole; ours


@dataclass(frozen=True, eq=False)
class Corners:
    """Triangles of a mesh.

    Attributes:
        points: (P,) the point of each vertex of the glTF mesh: a point on a seam of the texture has two vertices.
        triangles: (F, 3) vertices.
        materials: (F,) the material of each triangle.
        places: (P, 2) texture coordinates, or None.
    """

    points: Array
    triangles: Array
    materials: Array
    places: Array | None


class MeshReader:
    """Adds meshes to a document.

    Args:
        fbx: the file with the meshes.
        builder: of the document.
        place: number of a model → its node.
    """

    def __init__(self, fbx: Document, builder: GltfBuilder, place: Mapping[int, int]) -> None:
        self._fbx, self._builder, self._place = fbx, builder, place
        self._materials: dict[int, int] = {}
        self._textures: dict[int, int] = {}
        self._corners_left, self._shape_points_left = FBX_CORNERS, FBX_SHAPE_POINTS

    def add(self, model: FbxModel, node: int) -> list[int]:
        """Add the mesh of a model, if it has one.

        Returns:
            numbers of its blendshape channels, in the order of the mesh's targets.
        """
        geometry = next((entry for entry, _ in self._fbx.below(model.object.number, "Geometry", "Mesh")), None)
        if geometry is None:
            return []
        self._count(geometry)
        corners = _read_corners(geometry.node, self._fbx.name)
        if not len(corners.triangles):
            return []
        matrix = model.shape_matrix()
        points = geometry.node.array("Vertices").reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
        attributes = {"POSITION": self._builder.add(points[corners.points].astype(np.float32), "VEC3", bounds=True)}
        if corners.places is not None:
            attributes["TEXCOORD_0"] = self._builder.add(corners.places.astype(np.float32), "VEC2")
        skin = self._add_skin(geometry, corners, len(points), attributes)
        channels, targets = self._add_targets(geometry, corners, points, matrix[:3, :3])
        materials = [self._material(entry) for entry, _ in self._fbx.below(model.object.number, "Material")]
        primitives = []
        for number, triangles in _split(corners.triangles, corners.materials, len(materials)):
            primitive: dict[str, Any] = {
                "attributes": attributes, "indices": self._builder.add(triangles.astype(np.uint32).reshape(-1, 1), "SCALAR"),
            }  # fmt: skip
            if number >= 0:
                primitive["material"] = materials[number]
            if targets:
                primitive["targets"] = targets
            primitives.append(primitive)
        mesh: dict[str, Any] = {"name": model.object.name, "primitives": primitives}
        if targets:
            rest = [rest_weight(self._fbx, entry) for entry in channels]
            mesh |= {"weights": rest, "extras": {"targetNames": [entry.name for entry in channels]}}
        self._builder.json["nodes"][node]["mesh"] = self._builder.append("meshes", mesh)
        if skin is not None:
            self._builder.json["nodes"][node]["skin"] = skin
        return [entry.number for entry in channels]

    def _count(self, geometry: Object) -> None:
        """Refuse meshes that would take too much memory or time, before an array is unpacked. Several models may share a mesh.

        Raises:
            InputError: the meshes so far have too many corners, points or shapes.
        """
        name, most = self._fbx.name, f"{FBX_CORNERS:,}"
        points = geometry.node.count("Vertices") // 3
        self._corners_left -= geometry.node.count("PolygonVertexIndex")
        if self._corners_left < 0 or points > FBX_CORNERS:
            raise InputError(f"{name} has meshes of more than {most} corners", "export it with fewer polygons")
        shapes = sum(
            sum(1 for _ in self._fbx.below(deformer.number, "Deformer", "BlendShapeChannel"))
            for deformer, _ in self._fbx.below(geometry.number, "Deformer", "BlendShape")
        )
        self._shape_points_left -= (1 + shapes) * max(points, _LEAST_POINTS)
        if self._shape_points_left < 0:
            raise InputError(f"{name} has more than {FBX_SHAPE_POINTS:,} points × shapes", "export it with fewer shapes")

    def _add_skin(self, geometry: Object, corners: Corners, count: int, attributes: dict[str, int]) -> int | None:
        """Add the skin of a mesh, and the attributes of its vertices; None where the mesh follows its node."""
        joints, binds, rows, shares = list[int](), list[Array](), list[Array](), list[Array]()
        for deformer, _ in self._fbx.below(geometry.number, "Deformer", "Skin"):
            for cluster, _ in self._fbx.below(deformer.number, "Deformer", "Cluster"):
                bone = next((self._place.get(entry.number) for entry, _ in self._fbx.below(cluster.number, "Model")), None)
                indices, weights = (cluster.node.array(name) for name in ("Indexes", "Weights"))
                if bone is None or not len(indices):
                    continue
                if len(indices) != len(weights) or indices.min() < 0 or indices.max() >= count:
                    raise InputError(f"{self._fbx.name} is damaged: a skin names points that are not there", "export it again")
                joints.append(bone)
                binds.append(cluster.node.array("Transform").reshape(4, 4))  # column after column, as in glTF
                rows.append(indices)
                shares.append(weights)
        if not joints:
            return None
        vertex_joints, weights = _choose_joints(rows, shares, count)
        attributes["JOINTS_0"] = self._builder.add(vertex_joints[corners.points].astype(np.uint16), "VEC4")
        attributes["WEIGHTS_0"] = self._builder.add(weights[corners.points].astype(np.float32), "VEC4")
        matrices = np.array(binds).reshape(-1, 16).astype(np.float32)
        return self._builder.append("skins", {"joints": joints, "inverseBindMatrices": self._builder.add(matrices, "MAT4")})

    def _add_targets(
        self, geometry: Object, corners: Corners, points: Array, turn: Array
    ) -> tuple[list[Object], list[dict[str, int]]]:
        """Add blendshapes; give their channels and their targets."""
        channels, targets = list[Object](), list[dict[str, int]]()
        for deformer, _ in self._fbx.below(geometry.number, "Deformer", "BlendShape"):
            for channel, _ in self._fbx.below(deformer.number, "Deformer", "BlendShapeChannel"):
                shapes = [entry for entry, _ in self._fbx.below(channel.number, "Geometry", "Shape")]
                if not shapes:
                    continue
                deltas = np.zeros_like(points)
                indices = shapes[-1].node.array("Indexes").astype(np.int64)  # of several, the last has the full weight
                deltas[indices] = shapes[-1].node.array("Vertices").reshape(-1, 3) @ turn.T
                channels.append(channel)
                targets.append({"POSITION": self._builder.add_sparse(deltas[corners.points].astype(np.float32))})
        return channels, targets

    def _material(self, material: Object) -> int:
        if material.number not in self._materials:
            colour = material.vector("DiffuseColor" if "DiffuseColor" in material.properties else "Diffuse", (0.8, 0.8, 0.8))
            textures = {name: texture for texture, name in self._fbx.below(material.number, "Texture")}
            surface: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 0.8}
            image = self._texture(textures["DiffuseColor"]) if "DiffuseColor" in textures else None
            if image is None:
                surface["baseColorFactor"] = [*from_srgb(np.clip(colour, 0, 1)).tolist(), 1.0]
            else:
                surface["baseColorTexture"] = {"index": image}
            entry: dict[str, Any] = {"name": material.name, "pbrMetallicRoughness": surface}
            if "TransparentColor" in textures:
                entry |= {"alphaMode": "MASK", "alphaCutoff": _HALF}
            self._materials[material.number] = self._builder.append("materials", entry)
        return self._materials[material.number]

    def _texture(self, texture: Object) -> int | None:
        """Add a texture whose picture lies in the file; None where it lies elsewhere."""
        for video, _ in self._fbx.below(texture.number, "Video"):
            if video.number in self._textures:
                return self._textures[video.number]
            data = video.node.value("Content")
            mime = next((mime for first, mime in _MIMES.items() if isinstance(data, bytes) and data.startswith(first)), None)
            if mime is not None:
                assert isinstance(data, bytes)
                view = self._builder.add_view(lambda data=data: [data], len(data))  # type: ignore[misc]
                image = self._builder.append("images", {"bufferView": view, "mimeType": mime})
                self._textures[video.number] = self._builder.append("textures", {"source": image})
                return self._textures[video.number]
        return None


def _read_corners(geometry: Node, name: str) -> Corners:
    """Read polygons as fans of triangles."""
    corners = geometry.array("PolygonVertexIndex").astype(np.int64)
    count = len(geometry.array("Vertices")) // 3
    last = corners < 0
    points = np.where(last, ~corners, corners)
    if len(points) and not (points.min() >= 0 and points.max() < count and last[-1]):
        raise InputError(f"{name} is damaged: a polygon names points that are not there", "export it again")
    ends = np.flatnonzero(last)
    starts = np.concatenate([[0], ends[:-1] + 1]) if len(ends) else ends
    polygon = np.repeat(np.arange(len(ends)), ends - starts + 1)
    at = np.arange(len(points))
    inner = (at > starts[polygon]) & ~last  # each of these makes a triangle with the next and the first corner
    fans = np.stack([starts[polygon[inner]], at[inner], at[inner] + 1], 1)
    materials = _spread(geometry.find("LayerElementMaterial"), "Materials", polygon[inner])
    places = _texture_places(geometry, points, name)
    if places is None:
        unique, vertices = np.unique(points, return_inverse=True)
        return Corners(unique, vertices.reshape(-1)[fans], materials, None)
    rows, vertices = np.unique(np.column_stack([points, places]), axis=0, return_inverse=True)
    own = rows[:, 1:] * (1, -1) + (0, 1)  # v counts from below, glTF's from above
    return Corners(rows[:, 0].astype(np.int64), vertices.reshape(-1)[fans], materials, own)


def _split(triangles: Array, materials: Array, count: int) -> list[tuple[int, Array]]:
    """The triangles by number of material; -1 for triangles whose material is none of the ``count``."""
    valid = np.where((materials >= 0) & (materials < count), materials, -1)
    order = np.argsort(valid, kind="stable")
    numbers, starts = np.unique(valid[order], return_index=True)
    return list(zip(numbers.tolist(), np.split(triangles[order], starts[1:]), strict=True))


def _spread(layer: Node | None, values: str, polygons: Array) -> Array:
    """The number that a layer gives to each of ``polygons``."""
    table = np.zeros(0) if layer is None else layer.array(values)
    if layer is None or not len(table) or layer.value("MappingInformationType") != "ByPolygon":
        return np.full(len(polygons), int(table[0]) if len(table) else 0)
    return table.astype(np.int64)[np.minimum(polygons, len(table) - 1)]


def _texture_places(geometry: Node, points: Array, name: str) -> Array | None:
    """(C, 2) texture coordinates of the corners of polygons."""
    layer = geometry.find("LayerElementUV")
    if layer is None:
        return None
    table = layer.array("UV").reshape(-1, 2)
    by_corner = layer.value("MappingInformationType") == "ByPolygonVertex"
    at = np.arange(len(points)) if by_corner else points
    if layer.value("ReferenceInformationType") == "IndexToDirect":
        at = layer.array("UVIndex").astype(np.int64)[at]
        if (at < 0).any():  # corners without a place, as Maya writes them
            table, at = np.concatenate([np.zeros((1, 2)), table]), np.maximum(at, -1) + 1
    if len(at) and not (at.min() >= 0 and at.max() < len(table)):
        raise InputError(f"{name} is damaged: texture coordinates are missing", "export it again")
    places: Array = table[at]
    return places


def _choose_joints(rows: list[Array], shares: list[Array], count: int) -> tuple[Array, Array]:
    """(count, 4) joints of each point with the largest weights, and these; a point without weights follows the first joint."""
    points = np.concatenate(rows).astype(np.int64)
    joints = np.repeat(np.arange(len(rows)), [len(row) for row in rows])
    weights = np.maximum(np.concatenate(shares), 0)
    order = np.lexsort((-weights, points))
    points, joints, weights = points[order], joints[order], weights[order]
    first = np.searchsorted(points, points)
    rank = np.arange(len(points)) - first
    is_top = rank < _MOST_JOINTS
    top_joints, top_weights = np.zeros((count, _MOST_JOINTS), np.int64), np.zeros((count, _MOST_JOINTS))
    top_joints[points[is_top], rank[is_top]], top_weights[points[is_top], rank[is_top]] = joints[is_top], weights[is_top]
    top_weights[top_weights.sum(1) <= 0, 0] = 1
    return top_joints, top_weights / top_weights.sum(1, keepdims=True)
