"""Write a skeleton and a figure on it as objects of an FBX scene: bones, meshes, skin, blendshapes, and their connections.

An object is a node with a number of its own; connections say which object belongs to which. Lengths are in centimetres, Y is
up. A rotation is three angles in degrees, in the order of `ORDER`. Matrices lie column after column.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from ...motion.rotations import Array, quat_to_euler, quat_to_matrix
from ...motion.skeleton import Skeleton
from ...motion.skeletons.arkit import ARKIT
from ..mannequin.character import Part
from ..render.light import to_srgb
from .node_writer import Long, NodeWriter

__all__ = ["CENTIMETRES", "FIRST_NUMBER", "ORDER", "DrivenProperty", "SceneWriter", "place_bones", "sort_axes"]

CENTIMETRES = 100.0  # in a metre
ORDER = "ZXY"  # intrinsic; as in our BVH: its poles lie at ±90° of X, where arms and head seldom are
ROTATION_ORDER = 3  # the same order in FBX, which counts from the inside: Y, then X, then Z
FIRST_NUMBER = 1_000_000  # of objects; ours
_ALIKE = 0.1  # of sRGB 0 … 1: triangles whose colours differ by less share a material; ours
_XYZ = ("X", "Y", "Z")
_BONE_SIZE = 3.0  # centimetres: the size at which programs draw a joint; ours


Row: TypeAlias = "tuple[object, ...]"


class DrivenProperty(NamedTuple):
    """A property of an object that an animation can drive, with one curve per part.

    Attributes:
        number: of the object.
        name: of the property, such as ``"Lcl Rotation"``.
        node: name of the node that holds the curves, such as ``"R"``.
        parts: names of the curves: ``"X"``, ``"Y"``, ``"Z"``, or the name of the property.
        still: value of each without animation.
    """

    number: int
    name: str
    node: str
    parts: tuple[str, ...]
    still: tuple[float, ...]

    @classmethod
    def of_place(cls, number: int, still: Array | Sequence[float]) -> DrivenProperty:
        """The place of a model."""
        return cls(number, "Lcl Translation", "T", _XYZ, tuple(map(float, still)))

    @classmethod
    def of_turn(cls, number: int, still: Array | Sequence[float]) -> DrivenProperty:
        """The rotation of a model, degrees."""
        return cls(number, "Lcl Rotation", "R", _XYZ, tuple(map(float, still)))

    @classmethod
    def of_number(cls, number: int, name: str) -> DrivenProperty:
        """A property that is one number, and 0 without animation: that of a blendshape, say."""
        return cls(number, name, name, (name,), (0.0,))


def sort_axes(angles: Array, order: str) -> Array:
    """Angles (..., 3) in the order of a rotation, such as ``"ZXY"`` → in the order X, Y, Z."""
    return angles[..., [order.index(axis) for axis in "XYZ"]]


class SceneWriter:
    """Collects connections and channels while objects are written.

    Args:
        nodes: to write to, inside of the node ``Objects``.
        first: the numbers of objects begin after it.

    Attributes:
        connections: kind, number of the child, number of the parent, and the property, if any.
        counts: kind of object → how many there are.
    """

    def __init__(self, nodes: NodeWriter, first: int = FIRST_NUMBER) -> None:
        self._nodes, self._next = nodes, first
        self.connections: list[tuple[object, ...]] = []
        self.counts: dict[str, int] = {}

    def number(self, kind: str) -> int:
        """A new number for an object."""
        self._next += 1
        self.counts[kind] = self.counts.get(kind, 0) + 1
        return self._next

    def connect(self, child: int, parent: int, name: str = "") -> None:
        """Connect an object to the one that it belongs to (0: the scene), or whose property ``name`` it drives."""
        self.connections.append(("OP" if name else "OO", Long(child), Long(parent), *([name] if name else [])))

    def write_bones(self, skeleton: Skeleton, extra: Sequence[str] = ()) -> tuple[list[int], list[DrivenProperty]]:
        """Write the joints, in their T-pose.

        Args:
            skeleton: whose joints.
            extra: names of numbers that the root carries, such as those of a face.

        Returns:
            the numbers of the joints; channels: place of the root, rotation of each joint, ``extra``.
        """
        angles = np.degrees(sort_axes(quat_to_euler(skeleton.rest, ORDER), ORDER))
        numbers, channels = list[int](), list[DrivenProperty]()
        for k, name in enumerate(skeleton.names):
            numbers.append(self.number("Model"))
            place, turn = (tuple(map(float, row)) for row in (skeleton.offsets[k] * CENTIMETRES, angles[k]))
            turns = (("RotationActive", "bool", "", "", 1), ("RotationOrder", "enum", "", "", ROTATION_ORDER))
            more = ((shape, "Number", "", "A+U", 0.0) for shape in (extra if k == 0 else ()))
            self._write_model(numbers[k], name, "LimbNode", place, turn, before=turns, after=tuple(more))
            self._write_attribute(name, numbers[k])
            self.connect(numbers[k], 0 if k == 0 else numbers[skeleton.parents[k]])
            if k == 0:
                channels.append(DrivenProperty.of_place(numbers[0], place))
            channels.append(DrivenProperty.of_turn(numbers[k], turn))
        channels += [DrivenProperty.of_number(numbers[0], shape) for shape in extra]
        return numbers, channels

    def _write_model(
        self, number: int, name: str, sort: str, place: Sequence[float] = (0.0, 0.0, 0.0),
        turn: Sequence[float] = (0.0, 0.0, 0.0), *, before: Sequence[Row] = (), after: Sequence[Row] = (),
    ) -> None:  # fmt: skip
        """Write a bone or a mesh; ``before`` and ``after`` are further properties."""
        with self._nodes.node("Model", Long(number), f"{name}\0\1Model", sort):
            self._nodes.leaf("Version", 232)
            self._nodes.properties(
                *before,
                ("InheritType", "enum", "", "", 1), ("DefaultAttributeIndex", "int", "Integer", "", 0),
                ("Lcl Translation", "Lcl Translation", "", "A", *place), ("Lcl Rotation", "Lcl Rotation", "", "A", *turn),
                ("Lcl Scaling", "Lcl Scaling", "", "A", 1.0, 1.0, 1.0), *after,
            )  # fmt: skip
            self._nodes.leaf("Shading", True)
            self._nodes.leaf("Culling", "CullingOff")

    def _write_attribute(self, name: str, model: int) -> None:
        number = self.number("NodeAttribute")
        with self._nodes.node("NodeAttribute", Long(number), f"{name}\0\1NodeAttribute", "LimbNode"):
            self._nodes.properties(("Size", "double", "Number", "", _BONE_SIZE))
            self._nodes.leaf("TypeFlags", "Skeleton")
        self.connect(number, model)

    def write_pose(self, name: str, places: Sequence[tuple[int, Array]]) -> None:
        """Write the pose to which skin is bound: objects and their (4, 4) places in the world."""
        with self._nodes.node("Pose", Long(self.number("Pose")), f"{name}\0\1Pose", "BindPose"):
            self._nodes.leaf("Type", "BindPose")
            self._nodes.leaf("Version", 100)
            self._nodes.leaf("NbPoseNodes", len(places))
            for number, matrix in places:
                with self._nodes.node("PoseNode"):
                    self._nodes.leaf("Node", Long(number))
                    self._nodes.leaf("Matrix", matrix.T.ravel())

    def write_mesh(self, name: str, parts: Sequence[Part], bones: list[int], worlds: Array) -> tuple[int, list[DrivenProperty]]:
        """Write surfaces as one mesh with skin, and with blendshapes where the first part has some.

        Args:
            name: of the mesh.
            parts: all of them have blendshapes, or none.
            bones: numbers of the joints.
            worlds: (J, 4, 4) places of the joints in the T-pose, centimetres.

        Returns:
            the number of the mesh, and the channels of its blendshapes, in ARKit's order.
        """
        model, geometry = self.number("Model"), self.number("Geometry")
        colours, of = _materials(parts)
        self._write_model(model, name, "Mesh")
        self._write_geometry(geometry, name, parts, of)
        self.connect(model, 0)
        self.connect(geometry, model)
        for label, colour in colours:
            self.connect(self._write_material(label, colour), model)
        self._write_skin(geometry, name, parts, bones, worlds)
        return model, self._write_shapes(geometry, name, parts) if parts[0].morphs else []

    def _write_geometry(self, number: int, name: str, parts: Sequence[Part], materials: Array) -> None:
        starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
        triangles = np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=False)])
        corners = triangles.astype(np.int32)
        corners[:, 2] = ~corners[:, 2]  # the last corner of a polygon is marked by its complement
        vertices, normals = (np.concatenate([getattr(part, what) for part in parts]) for what in ("vertices", "normals"))
        with self._nodes.node("Geometry", Long(number), f"{name}\0\1Geometry", "Mesh"):
            self._nodes.leaf("GeometryVersion", 124)
            self._nodes.leaf("Vertices", vertices.astype(np.float64).ravel() * CENTIMETRES)
            self._nodes.leaf("PolygonVertexIndex", corners.ravel())
            layers = (("Normal", "ByPolygonVertex", "Direct", ("Normals", normals[triangles].astype(np.float64).ravel())),
                      ("Material", "ByPolygon", "IndexToDirect", ("Materials", materials.astype(np.int32))))  # fmt: skip
            for kind, mapping, reference, values in layers:
                with self._nodes.node(f"LayerElement{kind}", 0):
                    self._nodes.leaf("Version", 101)
                    self._nodes.leaf("Name", "")
                    self._nodes.leaf("MappingInformationType", mapping)
                    self._nodes.leaf("ReferenceInformationType", reference)
                    self._nodes.leaf(*values)
            with self._nodes.node("Layer", 0):
                self._nodes.leaf("Version", 100)
                for kind, *_ in layers:
                    with self._nodes.node("LayerElement"):
                        self._nodes.leaf("Type", f"LayerElement{kind}")
                        self._nodes.leaf("TypedIndex", 0)

    def _write_material(self, name: str, colour: Array) -> int:
        number, rgb = self.number("Material"), tuple(map(float, colour))
        with self._nodes.node("Material", Long(number), f"{name}\0\1Material", ""):
            self._nodes.leaf("Version", 102)
            self._nodes.leaf("ShadingModel", "lambert")
            self._nodes.leaf("MultiLayer", 0)
            self._nodes.properties(
                ("DiffuseColor", "Color", "", "A", *rgb), ("DiffuseFactor", "Number", "", "A", 1.0),
                ("Diffuse", "Vector3D", "Vector", "", *rgb), ("Opacity", "double", "Number", "", 1.0),
            )  # fmt: skip
        return number

    def _write_skin(self, geometry: int, name: str, parts: Sequence[Part], bones: list[int], worlds: Array) -> None:
        skin = self.number("Deformer")
        with self._nodes.node("Deformer", Long(skin), f"{name}\0\1Deformer", "Skin"):
            self._nodes.leaf("Version", 101)
            self._nodes.leaf("Link_DeformAcuracy", 50.0)  # as the format spells it
        self.connect(skin, geometry)
        joints, weights = (np.concatenate([getattr(part, what) for part in parts]) for what in ("joints", "weights"))
        for joint, bone in enumerate(bones):
            shares = np.where(joints == joint, weights, 0).sum(1, dtype=np.float64)
            (indices,) = np.nonzero(shares)
            if not len(indices):
                continue
            cluster = self.number("Deformer")
            with self._nodes.node("Deformer", Long(cluster), f"{name}{joint}\0\1SubDeformer", "Cluster"):
                self._nodes.leaf("Version", 100)
                self._nodes.leaf("UserData", "", "")
                self._nodes.leaf("Indexes", indices.astype(np.int32))
                self._nodes.leaf("Weights", shares[indices])
                self._nodes.leaf("Transform", np.linalg.inv(worlds[joint]).T.ravel())
                self._nodes.leaf("TransformLink", worlds[joint].T.ravel())
            self.connect(cluster, skin)
            self.connect(bone, cluster)

    def _write_shapes(self, geometry: int, name: str, parts: Sequence[Part]) -> list[DrivenProperty]:
        blend, channels = self.number("Deformer"), list[DrivenProperty]()
        with self._nodes.node("Deformer", Long(blend), f"{name}\0\1Deformer", "BlendShape"):
            self._nodes.leaf("Version", 100)
        self.connect(blend, geometry)
        for shape in ARKIT:
            channel, target = self.number("Deformer"), self.number("Geometry")
            deltas = np.concatenate([part.morphs.get(shape, np.zeros_like(part.vertices)) for part in parts])
            (indices,) = np.nonzero(deltas.any(1))
            indices = indices if len(indices) else np.zeros(1, int)  # programs drop a shape of no points
            with self._nodes.node("Deformer", Long(channel), f"{shape}\0\1SubDeformer", "BlendShapeChannel"):
                self._nodes.leaf("Version", 100)
                self._nodes.leaf("DeformPercent", 0.0)
                self._nodes.leaf("FullWeights", np.array([100.0]))
            with self._nodes.node("Geometry", Long(target), f"{shape}\0\1Geometry", "Shape"):
                self._nodes.leaf("Version", 100)
                self._nodes.leaf("Indexes", indices.astype(np.int32))
                self._nodes.leaf("Vertices", deltas[indices].astype(np.float64).ravel() * CENTIMETRES)
                self._nodes.leaf("Normals", np.zeros(3 * len(indices)))
            self.connect(channel, blend)
            self.connect(target, channel)
            channels.append(DrivenProperty.of_number(channel, "DeformPercent"))
        return channels


def place_bones(skeleton: Skeleton) -> Array:
    """(J, 4, 4) places of the joints in the T-pose, centimetres."""
    positions, turns = skeleton.forward(skeleton.rest, skeleton.offsets[0])
    worlds = np.tile(np.eye(4), (len(skeleton), 1, 1))
    worlds[:, :3, :3], worlds[:, :3, 3] = quat_to_matrix(turns), positions * CENTIMETRES
    return worlds


def _materials(parts: Sequence[Part]) -> tuple[list[tuple[str, Array]], Array]:
    """Names and sRGB colours of materials, and which of them each triangle has: few programs show colours of vertices."""
    colours, of = list[tuple[str, Array]](), list[int]()
    for part in parts:
        vertices = np.broadcast_to(np.clip(np.asarray(part.colour, float), 0, 1), part.vertices.shape)
        faces = to_srgb(vertices[part.triangles].mean(1))
        own = np.full(len(faces), -1)
        while (own < 0).any():
            first = faces[np.argmax(own < 0)]
            alike = (own < 0) & (np.abs(faces - first).max(1) < _ALIKE)
            own[alike] = len(colours)
            colours.append((f"{part.name}{len(colours)}", faces[alike].mean(0)))
        of += own.tolist()
    return colours, np.array(of)
