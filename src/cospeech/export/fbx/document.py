"""Objects of an FBX file by their numbers, with their connections and their properties."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...errors import InputError
from ...motion.rotations import Array, euler_to_quat, matrix_to_quat, quat_conjugate, quat_multiply, quat_rotate, quat_to_matrix
from .tree import Node

__all__ = ["Document", "FbxModel", "Object", "Transform", "rest_weight"]

_ORDERS = ("ZYX", "YZX", "XZY", "ZXY", "YXZ", "XYZ")  # intrinsic, of FBX's numbers 0 to 5, which count from the inside
_TURNS_AND_PLACES = ("Lcl Translation", "Lcl Rotation", "Lcl Scaling")
MODEL = "Model"


@dataclass(frozen=True, eq=False)
class Object:
    """An object.

    Attributes:
        number: its own.
        node: the node that describes it.
        kind: of the node: ``FbxModel``, ``Geometry``, ``Deformer`` and so on.
        name: without what the format adds.
        sort: the kind within the kind: ``LimbNode``, ``Mesh``, ``Skin``.
    """

    number: int
    node: Node
    kind: str
    name: str
    sort: str

    @cached_property
    def properties(self) -> dict[str, list[object]]:
        """Name of a property → its values."""
        return read_properties(self.node)

    def vector(self, name: str, default: tuple[float, ...]) -> Array:
        """Numbers of a property, as many as ``default`` has."""
        values = self.properties.get(name, [])[: len(default)]
        return np.array(values if len(values) == len(default) else default, float)

    def number_of(self, name: str, default: float) -> float:
        """The number of a property."""
        return float(self.vector(name, (default,))[0])


def read_properties(node: Node) -> dict[str, list[object]]:
    """The list of properties of a node, values only."""
    block = node.find("Properties70")
    rows = [] if block is None else [row.values for row in block.all("P")]
    return {str(row[0]): row[4:] for row in rows if row}


class Document:
    """The objects of a file.

    Args:
        root: of its nodes.
        name: how messages call the file.

    Attributes:
        objects: by their numbers.
        connections: nodes that connect two objects.
    """

    def __init__(self, root: Node, name: str) -> None:
        self.root, self.name = root, name
        settings = root.find("GlobalSettings")
        self.settings = Object(0, settings or Node(""), "GlobalSettings", "", "")
        self.objects: dict[int, Object] = {}
        block = root.find("Objects")
        for node in [] if block is None else block.nodes:
            number, label, sort = (*node.values[:3], "", "", "")[:3]
            if isinstance(number, int):
                self.objects[number] = Object(number, node, node.name, str(label).split("\0", 1)[0], str(sort))
        self._below: dict[int, list[tuple[int, str]]] = {}
        self._above: dict[int, list[tuple[int, str]]] = {}
        links = root.find("Connections")
        self.connections = [] if links is None else list(links.all("C"))
        for node in self.connections:
            _, child, parent, *rest = (*node.values, None, None, None)
            if isinstance(child, int) and isinstance(parent, int):
                name = str(rest[0] or "") if rest else ""
                self._below.setdefault(parent, []).append((child, name))
                self._above.setdefault(child, []).append((parent, name))

    def below(self, number: int, kind: str, sort: str = "") -> Iterator[tuple[Object, str]]:
        """Objects of a kind that belong to an object, and the property of it that they drive, if any."""
        yield from self._choose(self._below.get(number, []), kind, sort)

    def above(self, number: int, kind: str, sort: str = "") -> Iterator[tuple[Object, str]]:
        """Objects of a kind that an object belongs to, and the property of them that it drives, if any."""
        yield from self._choose(self._above.get(number, []), kind, sort)

    def _choose(self, links: list[tuple[int, str]], kind: str, sort: str) -> Iterator[tuple[Object, str]]:
        for number, name in links:
            entry = self.objects.get(number)
            if entry is not None and entry.kind == kind and sort in ("", entry.sort):
                yield entry, name

    def of_kind(self, kind: str) -> list[Object]:
        """All objects of a kind, in the order of the file."""
        return [entry for entry in self.objects.values() if entry.kind == kind]

    def to_metres(self) -> tuple[Array, float]:
        """(4,) turn from the file's axes to Y up and +Z front, and metres per unit."""
        rows = np.zeros((3, 3))
        for row, (axis, default) in enumerate((("CoordAxis", 0), ("UpAxis", 1), ("FrontAxis", 2))):
            index = int(self.settings.number_of(axis, default))
            sign = self.settings.number_of(f"{axis}Sign", 1)
            if not 0 <= index < 3:
                raise InputError(f"{self.name} is damaged: {axis} is {index}", "export it again")
            rows[row, index] = -1 if sign < 0 else 1
        if np.linalg.det(rows) < 0.5:  # axes that are mirrored, or named twice
            rows = np.eye(3)
        return matrix_to_quat(rows), self.settings.number_of("UnitScaleFactor", 1.0) / 100


def rest_weight(fbx: Document, channel: Object) -> float:
    """Weight of a blendshape that no clip moves, such as the shape of a body; blendshapes that clips move rest at 0."""
    if any(True for _ in fbx.below(channel.number, "AnimationCurveNode")):
        return 0.0
    value = channel.node.value("DeformPercent", 0.0)
    weight = channel.number_of("DeformPercent", value if isinstance(value, float) else 0.0) / 100
    return weight if np.isfinite(weight) else 0.0


@dataclass(frozen=True, eq=False)
class Transform:
    """Place of an object relative to its parent: (..., 3) translation, (..., 4) rotation, (..., 3) scale."""

    translation: Array
    rotation: Array
    scale: Array


class FbxModel:
    """A bone, a mesh or an empty; the format gives its place by some ten properties.

    Source: Autodesk's FBX SDK help, "Computing transformation matrices": T · Roff · Rp · Rpre · R · Rpost⁻¹ · Rp⁻¹ · Soff · Sp
    · S · Sp⁻¹.
    """

    def __init__(self, entry: Object) -> None:
        self.object = entry
        zero = (0.0, 0.0, 0.0)
        turns = entry.number_of("RotationActive", 0) != 0
        order = int(entry.number_of("RotationOrder", 0)) if turns else 0
        self.order = _ORDERS[order] if 0 <= order < len(_ORDERS) else _ORDERS[0]  # 6 is a spherical rotation, which nobody uses
        before, after = (entry.vector(name, zero) if turns else np.zeros(3) for name in ("PreRotation", "PostRotation"))
        self._before, self._after = _turn(before, _ORDERS[0]), quat_conjugate(_turn(after, _ORDERS[0]))
        names = ("RotationOffset", "RotationPivot", "ScalingOffset", "ScalingPivot")
        self._rotation_offset, self._rotation_pivot, self._scaling_offset, self._scaling_pivot = (
            entry.vector(name, zero) for name in names
        )
        defaults = (zero, zero, (1.0, 1.0, 1.0))
        self.still = tuple(entry.vector(name, x) for name, x in zip(_TURNS_AND_PLACES, defaults, strict=True))

    def place(self, translation: Array, angles: Array, scale: Array) -> Transform:
        """Its place for values of its three properties, (..., 3) each; angles in degrees."""
        turn = quat_multiply(quat_multiply(self._before, _turn(angles, self.order)), self._after)
        place = translation + self._shift(turn, scale)
        return Transform(place, np.broadcast_to(turn, (*place.shape[:-1], 4)), np.broadcast_to(scale, place.shape))

    def _shift(self, turn: Array, scale: Array) -> Array:
        """How far its pivots move it, when it turns and is scaled."""
        inner = self._scaling_offset + self._scaling_pivot - scale * self._scaling_pivot - self._rotation_pivot
        shift: Array = self._rotation_offset + self._rotation_pivot + quat_rotate(turn, inner)
        return shift

    def properties_at(self, translation: Array, rotation: Array) -> tuple[Array, Array]:
        """The properties for which `place` gives this place (..., 3) and rotation (..., 4), with its own scale.

        Returns:
            (..., 3) translation, and the rotation that the angles make, (..., 4), in the order of `order`.
        """
        turn = quat_multiply(quat_multiply(quat_conjugate(self._before), rotation), quat_conjugate(self._after))
        return translation - self._shift(rotation, self.still[2]), turn

    @property
    def rest(self) -> Transform:
        """Its place without animation."""
        return self.place(*self.still)

    def shape_matrix(self) -> Array:
        """(4, 4) the matrix that the format applies first to the points of a mesh."""
        zero, one = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
        matrix = np.eye(4)
        turn = _turn(self.object.vector("GeometricRotation", zero), _ORDERS[0])
        matrix[:3, :3] = quat_to_matrix(turn) * self.object.vector("GeometricScaling", one)
        matrix[:3, 3] = self.object.vector("GeometricTranslation", zero)
        return matrix


def _turn(degrees: Array, order: str) -> Array:
    """Quaternions of angles (..., 3) about X, Y, Z."""
    return euler_to_quat(np.radians(degrees)[..., ["XYZ".index(axis) for axis in order]], order)
