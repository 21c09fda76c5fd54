"""The character's data: parts with colours, weights and morph targets; posing it; facts about its volume."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...motion.rotations import Array, quat_to_matrix
from ...motion.skeleton import Skeleton
from ...motion.skeletons.arkit import ARKIT
from ..surface import Surface

__all__ = ["Character", "Part", "pose_surface", "skin", "skin_with_normals"]

_REST = 1e-4  # ours: a blendshape weight below this moves nothing anyone could see


@dataclass(frozen=True, eq=False)
class Part:
    """One surface of one material.

    Args:
        name: e.g. ``"face"``, ``"shirt"``.
        vertices: (V, 3) float32, metres, world position in the T-pose.
        normals: (V, 3) float32, unit.
        triangles: (F, 3) int32, counter-clockwise seen from outside.
        joints: (V, 4) int32 indices into the skeleton.
        weights: (V, 4) float32, each row sums to 1.
        colour: (3,) or per vertex (V, 3), linear RGB.
        roughness: 0 mirror … 1 chalk.
        morphs: name of a shape → (V, 3) float32 displacement in the T-pose at weight 1; shapes that move nothing here are
            absent.
        surface: texture and holes; None for a closed surface of plain colour.
    """

    name: str
    vertices: Array
    normals: Array
    triangles: Array
    joints: Array
    weights: Array
    colour: Array
    roughness: float = 0.8
    morphs: Mapping[str, Array] = field(default_factory=dict)
    surface: Surface | None = None


@dataclass(frozen=True, eq=False)
class Character:
    """A skinned figure.

    Args:
        skeleton: what it follows; the rest rotations are identities.
        parts: its surfaces.
        shapes: the names of its morphs.
        drive: ARKit weights (52,) → weights of ``shapes``; None where these are ARKit's.
    """

    skeleton: Skeleton
    parts: tuple[Part, ...]
    shapes: tuple[str, ...] = ARKIT
    drive: Callable[[Array], Array] | None = None

    def __getitem__(self, name: str) -> Part:
        """The part called ``name``."""
        return next(part for part in self.parts if part.name == name)

    def meshes(self) -> list[tuple[str, list[Part]]]:
        """Two meshes for files: the parts with morph targets, so that animators find one set of shape keys, and the others."""
        moving = [part for part in self.parts if part.morphs]
        still = [part for part in self.parts if not part.morphs]
        return [(name, parts) for name, parts in (("face", moving), ("body", still)) if parts]

    @cached_property
    def _tables(self) -> Tables:
        return Tables.of(self)


@dataclass(frozen=True, eq=False)
class Tables:
    """All parts as one row of vertices, ready for posing. Coordinates are the first axis, so that numpy works on long rows."""

    bounds: list[slice]
    weights: Array  # (J, V)
    vertices: Array  # (3, V)
    normals: Array  # (3, V)
    moving: Array  # (R,) vertices that some morph moves
    morphs: Array  # (S, 3 * R), by shape
    faces: _Faces  # those that touch a moving vertex; indices into ``face_vertices``
    face_vertices: Array  # (U,) vertices of those faces
    neutral: Array  # (3, U) their normals, averaged over faces, without any morph

    @classmethod
    def of(cls, character: Character) -> Tables:
        parts = character.parts
        ends = np.cumsum([len(p.vertices) for p in parts])
        bounds = [slice(int(e) - len(p.vertices), int(e)) for e, p in zip(ends, parts, strict=True)]
        vertices = np.concatenate([p.vertices for p in parts]).T.copy()
        total = vertices.shape[1]
        weights = np.zeros((total, len(character.skeleton)), np.float32)
        joints = np.concatenate([p.joints for p in parts])
        np.add.at(weights, (np.arange(total)[:, None], joints), np.concatenate([p.weights for p in parts]))
        index = {name: k for k, name in enumerate(character.shapes)}
        dense = np.zeros((len(index), 3, total), np.float32)
        for part, where in zip(parts, bounds, strict=True):
            for name, delta in part.morphs.items():
                dense[index[name], :, where] = delta.T
        moving = np.flatnonzero(dense.any((0, 1)))
        triangles = np.concatenate([p.triangles + b.start for p, b in zip(parts, bounds, strict=True)])
        face_vertices, local = np.unique(triangles[np.isin(triangles, moving).any(1)], return_inverse=True)
        faces = _Faces.of(local.reshape(-1, 3), len(face_vertices))
        return cls(
            bounds=bounds,
            weights=np.ascontiguousarray(weights.T),
            vertices=vertices,
            normals=np.concatenate([p.normals for p in parts]).T.copy(),
            moving=moving,
            morphs=dense[:, :, moving].reshape(len(dense), 3 * len(moving)),
            faces=faces,
            face_vertices=face_vertices,
            neutral=faces.normals(vertices[:, face_vertices]),
        )


@dataclass(frozen=True, eq=False)
class _Faces:
    """Triangles of a few vertices; each vertex has at least one."""

    corners: Array  # (3, F)
    around: Array  # (3 * F,) triangles, those around the first vertex first
    first: Array  # (U,) where the triangles of each vertex begin in ``around``

    @classmethod
    def of(cls, triangles: Array, vertices: int) -> _Faces:
        """From triangles (F, 3) of so many vertices."""
        order = np.argsort(triangles.ravel(), kind="stable")
        first = np.searchsorted(triangles.ravel()[order], np.arange(vertices))
        return cls(np.ascontiguousarray(triangles.T), order // 3, first)

    def normals(self, points: Array) -> Array:
        """Unit normals (3, U) at the vertices ``points`` (3, U): averages over their triangles, weighted by area."""
        if not len(self.first):
            return np.zeros((3, 0), np.float32)
        a, b, c = (points.take(corner, 1) for corner in self.corners)
        (ax, ay, az), (bx, by, bz) = b - a, c - a
        face = np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])  # several times faster than np.cross
        total: Array = np.add.reduceat(face.take(self.around, 1), self.first, axis=1)
        return total / np.maximum(np.sqrt(np.einsum("av,av->v", total, total)), np.float32(1e-15))


def pose_surface(character: Character, rotations: Array, positions: Array, face: Array | None = None) -> tuple[Array, Array]:
    """Pose the character: blendshapes first, then linear blend skinning (what glTF and every engine do).

    Args:
        rotations: (J, 4) world rotations of the joints, xyzw (`Skeleton.forward`).
        positions: (J, 3) their world positions, metres.
        face: (52,) ARKit weights, or None for a neutral face.

    Returns:
        the vertices (3, V) of all parts in metres and the unit normals (3, V), float32.
    """
    tables = character._tables
    vertices, normals = tables.vertices, tables.normals
    weights = face if face is None or character.drive is None else character.drive(face)
    if weights is not None and np.abs(weights).max(initial=0) > _REST:
        active = np.flatnonzero(np.abs(weights) > _REST)
        vertices, normals = vertices.copy(), normals.copy()
        delta = np.asarray(weights, np.float32)[active] @ tables.morphs[active]
        vertices[:, tables.moving] += delta.reshape(3, -1)
        normals[:, tables.face_vertices] += tables.faces.normals(vertices.take(tables.face_vertices, 1)) - tables.neutral
    turn = quat_to_matrix(np.asarray(rotations, np.float32))
    shift = np.asarray(positions - np.einsum("jab,jb->ja", turn, character.skeleton.tpose), np.float32)
    rows = np.concatenate([turn, shift[:, :, None]], 2).reshape(len(turn), 12)
    blend = (rows.T @ tables.weights).reshape(3, 4, -1)
    points, directions = np.empty_like(vertices), np.empty_like(normals)
    for axis, (x, y, z, by) in enumerate(blend):
        points[axis] = x * vertices[0] + y * vertices[1] + z * vertices[2] + by
        directions[axis] = x * normals[0] + y * normals[1] + z * normals[2]
    directions /= np.maximum(
        np.sqrt(directions[0] * directions[0] + directions[1] * directions[1] + directions[2] * directions[2]), np.float32(1e-9)
    )
    return points, directions


def skin_with_normals(
    character: Character, rotations: Array, positions: Array, face: Array | None = None
) -> tuple[list[Array], list[Array]]:
    """Per part the vertices (V, 3) and the unit normals (V, 3) of `pose_surface`."""
    points, directions = pose_surface(character, rotations, positions, face)
    bounds = character._tables.bounds
    return [points[:, b].T.copy() for b in bounds], [directions[:, b].T.copy() for b in bounds]


def skin(character: Character, rotations: Array, positions: Array, face: Array | None = None) -> list[Array]:
    """Posed vertices only; see `skin_with_normals`."""
    return skin_with_normals(character, rotations, positions, face)[0]
