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

__all__ = ["Character", "Part", "skin", "skin_with_normals"]

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
        """Two meshes for files: what has morph targets, so that animators find one set of shape keys, and what has none."""
        moving = [part for part in self.parts if part.morphs]
        still = [part for part in self.parts if not part.morphs]
        return [(name, parts) for name, parts in (("face", moving), ("body", still)) if parts]

    @cached_property
    def _tables(self) -> Tables:
        return Tables.of(self)


@dataclass(frozen=True, eq=False)
class Tables:
    """All parts in one row of vertices, ready for posing."""

    bounds: list[slice]
    weights: Array  # (J, V)
    vertices: Array  # (V, 3)
    normals: Array  # (V, 3)
    moving: Array  # (R,) vertices that some morph moves
    morphs: Array  # (S, R * 3), by shape
    triangles: Array  # (F, 3) faces that touch a moving vertex, indices into ``touched``
    touched: Array  # (U,) vertices of those faces
    neutral: Array  # (U, 3) their face-averaged normals without any morph

    @classmethod
    def of(cls, character: Character) -> Tables:
        parts = character.parts
        ends = np.cumsum([len(p.vertices) for p in parts])
        bounds = [slice(int(e) - len(p.vertices), int(e)) for e, p in zip(ends, parts, strict=True)]
        vertices = np.concatenate([p.vertices for p in parts])
        total = len(vertices)
        weights = np.zeros((total, len(character.skeleton)), np.float32)
        joints = np.concatenate([p.joints for p in parts])
        np.add.at(weights, (np.arange(total)[:, None], joints), np.concatenate([p.weights for p in parts]))
        index = {name: k for k, name in enumerate(character.shapes)}
        dense = np.zeros((len(index), total, 3), np.float32)
        for part, where in zip(parts, bounds, strict=True):
            for name, delta in part.morphs.items():
                dense[index[name], where] = delta
        moving = np.flatnonzero(dense.any((0, 2)))
        triangles = np.concatenate([p.triangles + b.start for p, b in zip(parts, bounds, strict=True)])
        touched, local = np.unique(triangles[np.isin(triangles, moving).any(1)], return_inverse=True)
        local = local.reshape(-1, 3)
        return cls(
            bounds=bounds,
            weights=np.ascontiguousarray(weights.T),
            vertices=vertices,
            normals=np.concatenate([p.normals for p in parts]),
            moving=moving,
            morphs=dense[:, moving].reshape(len(dense), 3 * len(moving)),
            triangles=local,
            touched=touched,
            neutral=_face_normals(vertices[touched], local),
        )


def _face_normals(points: Array, triangles: Array) -> Array:
    a, b, c = points[triangles[:, 0]], points[triangles[:, 1]], points[triangles[:, 2]]
    (ax, ay, az), (bx, by, bz) = (b - a).T, (c - a).T
    face = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx  # several times faster than np.cross
    corners = triangles.T.ravel()
    total = np.stack([np.bincount(corners, np.tile(side, 3), len(points)) for side in face], 1)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-15)


def skin_with_normals(
    character: Character, rotations: Array, positions: Array, face: Array | None = None
) -> tuple[list[Array], list[Array]]:
    """Pose the character: blendshapes first, then linear blend skinning (what glTF and every engine do).

    Args:
        rotations: (J, 4) world rotations of the joints, xyzw (`Skeleton.forward`).
        positions: (J, 3) their world positions, metres.
        face: (52,) ARKit weights, or None for a neutral face.

    Returns:
        per part the vertices (V, 3) in metres and the unit normals (V, 3), float32.
    """
    tables = character._tables
    vertices, normals = tables.vertices, tables.normals
    weights = face if face is None or character.drive is None else character.drive(face)
    if weights is not None and np.abs(weights).max(initial=0) > _REST:
        used = np.flatnonzero(np.abs(weights) > _REST)
        vertices, normals = vertices.copy(), normals.copy()
        delta = np.asarray(weights, np.float32)[used] @ tables.morphs[used]
        vertices[tables.moving] += delta.reshape(-1, 3)
        bent = _face_normals(vertices[tables.touched], tables.triangles) - tables.neutral
        normals[tables.touched] += bent
    turn = quat_to_matrix(np.asarray(rotations, np.float32))
    shift = np.asarray(positions - np.einsum("jab,jb->ja", turn, character.skeleton.tpose), np.float32)
    rows = np.concatenate([turn, shift[:, :, None]], 2).reshape(len(turn), 12)
    blend = (rows.T @ tables.weights).reshape(3, 4, -1)
    posed, turned = np.empty_like(vertices), np.empty_like(normals)
    for axis, (x, y, z, by) in enumerate(blend):
        posed[:, axis] = x * vertices[:, 0] + y * vertices[:, 1] + z * vertices[:, 2] + by
        turned[:, axis] = x * normals[:, 0] + y * normals[:, 1] + z * normals[:, 2]
    turned /= np.maximum(np.sqrt(np.einsum("vi,vi->v", turned, turned)), 1e-9)[:, None]
    return [posed[b] for b in tables.bounds], [turned[b] for b in tables.bounds]


def skin(character: Character, rotations: Array, positions: Array, face: Array | None = None) -> list[Array]:
    """Posed vertices only; see `skin_with_normals`."""
    return skin_with_normals(character, rotations, positions, face)[0]
