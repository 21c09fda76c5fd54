"""Nets of quads: rings of points bridged into tubes, holes that sprout branches, smoothing, normals, weights that diffuse."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.linalg import splu

from cospeech.motion.rotations import Array

from .solids import Solid, gradient, settle

__all__ = ["Net", "frame", "ring", "smoothstep", "vertex_normals"]


def smoothstep(low: float | Array, high: float | Array, x: Array) -> Array:
    """0 below ``low``, 1 above ``high``, smooth between (also for low > high)."""
    t = np.clip((np.asarray(x, float) - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def frame(axis: Array, up: Sequence[float]) -> tuple[Array, Array]:
    """Two unit vectors at right angles to ``axis``: the first as near ``up`` as possible, the second axis × first."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    first = np.asarray(up, float) - axis * (axis @ np.asarray(up, float))
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)


def ring(centre: Array, first: Array, second: Array, count: int, radii: tuple[float, float], turn: float = 0.0) -> Array:
    """``count`` points of an ellipse around ``centre``, starting ``turn`` radians from ``first``."""
    angle = turn + 2 * np.pi * np.arange(count) / count
    return centre + radii[0] * np.cos(angle)[:, None] * first + radii[1] * np.sin(angle)[:, None] * second


def vertex_normals(points: Array, triangles: Array) -> Array:
    """Area-weighted vertex normals (V, 3)."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    total = np.stack([np.bincount(triangles.ravel(), np.repeat(face[:, k], 3), len(points)) for k in range(3)], 1)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-15)


class Net:
    """A surface under construction: points and polygons (quads or triangles)."""

    def __init__(self) -> None:
        self.points = np.zeros((0, 3))
        self.faces: list[tuple[int, ...]] = []

    def add(self, points: Array) -> list[int]:
        """Append points; returns their indices."""
        first = len(self.points)
        self.points = np.concatenate([self.points, np.atleast_2d(points)])
        return list(range(first, len(self.points)))

    def add_following(self, previous: Sequence[int], points: Array) -> list[int]:
        """Append a ring, turned or reversed so that its points follow those of the ring ``previous`` with the least twist."""
        turns = [np.roll(way, shift, axis=0) for way in (points, points[::-1]) for shift in range(len(points))]
        costs = [np.sum((turn - self.points[list(previous)]) ** 2) for turn in turns]
        return self.add(turns[int(np.argmin(np.round(costs, 9)))])

    def bridge(self, a: Sequence[int], b: Sequence[int], closed: bool = True) -> None:
        """Quads between two rows of equal length; seen from outside ``b`` lies above ``a`` and both run to the right."""
        if len(a) != len(b):
            raise ValueError(f"bridge of rows of {len(a)} and {len(b)} points")
        for k in range(len(a) if closed else len(a) - 1):
            m = (k + 1) % len(a)
            quad = (a[k], a[m], b[m], b[k])
            self.faces.append(tuple(dict.fromkeys(quad)))

    def cap(self, a: Sequence[int], tip: Array) -> int:
        """Close a ring with a fan to a new point."""
        (top,) = self.add(tip)
        for k in range(len(a)):
            self.faces.append((a[k], a[(k + 1) % len(a)], top))
        return top

    def tube(self, rows: Sequence[Sequence[int]], closed: bool = True) -> None:
        """Bridge consecutive rows."""
        for a, b in pairwise(rows):
            self.bridge(a, b, closed)

    def triangles(self) -> Array:
        """(F, 3) indices; quads are cut along the shorter diagonal (ties: a fixed one, so mirrored halves agree)."""
        out = []
        for face in self.faces:
            if len(face) == 4:
                a, b, c, d = face
                p = self.points
                straight = np.linalg.norm(p[a] - p[c]) <= np.linalg.norm(p[b] - p[d]) + 1e-7
                out += [(a, b, c), (a, c, d)] if straight else [(a, b, d), (b, c, d)]
            elif len(face) == 3:
                out.append(face)
        return np.array(out, np.int32)

    def neighbours(self) -> csr_matrix:
        """(V, V) matrix that averages over the neighbours along face edges."""
        edges = {(f[k], f[(k + 1) % len(f)]) for f in self.faces for k in range(len(f))}
        pairs = np.array([*edges, *((b, a) for a, b in edges)])
        pairs = np.unique(pairs, axis=0)
        count = np.bincount(pairs[:, 0], minlength=len(self.points))
        data = 1 / count[pairs[:, 0]]
        return coo_matrix((data, (pairs[:, 0], pairs[:, 1])), shape=(len(self.points),) * 2).tocsr()

    def relax(self, solid: Solid, free: Array, rounds: int, pull: float = 0.5) -> None:
        """Even out the ``free`` points along the surface of ``solid``."""
        average = self.neighbours()
        for _ in range(rounds):
            target = self.points + pull * (average @ self.points - self.points)
            self.points[free] = settle(solid, target[free], 2)
        self.points[free] = settle(solid, self.points[free], 4)

    def soften(self, free: Array, rounds: int, pull: float = 0.5) -> None:
        """Plain smoothing of the ``free`` points: rounds off corners and creases."""
        average = self.neighbours()
        for _ in range(rounds):
            target = self.points + pull * (average @ self.points - self.points)
            self.points[free] = target[free]

    def spread(self, weights: Array, reach: float, free: Array, rounds: int = 3) -> Array:
        """Let weights (V, J) flow into one another as heat does, over about ``reach`` metres of the surface.

        It does not matter how dense the net is. The rows where ``free`` is false stay. Implicit steps of the heat equation
        with the cotangent Laplacian (Desbrun et al. 1999).
        """
        stiff, mass = self._heat()
        step = diags(mass) + reach**2 / (2 * rounds) * stiff
        inner, outer = np.flatnonzero(free), np.flatnonzero(~free)
        solve = splu(step[inner][:, inner].tocsc())
        weights = weights.copy()
        for _ in range(rounds):
            right = mass[inner, None] * weights[inner] - step[inner][:, outer] @ weights[outer]
            weights[inner] = solve.solve(right)
        return np.maximum(weights, 0)

    def _heat(self) -> tuple[csr_matrix, Array]:
        """The net's stiffness matrix (V, V), cotangents below 0 left out, and the area (V,) around each point."""
        triangles, count = self.triangles(), len(self.points)
        stiff, mass = csr_matrix((count, count)), np.full(count, 1e-9)
        for k in range(3):
            a, b, c = (triangles[:, (k + j) % 3] for j in range(3))
            u, v = self.points[b] - self.points[a], self.points[c] - self.points[a]
            twice = np.linalg.norm(np.cross(u, v), axis=1) + 1e-12
            half = np.clip(np.einsum("fi,fi->f", u, v) / twice, 0.02, 20) / 2
            part = coo_matrix((half, (b, c)), shape=(count, count)).tocsr()
            stiff = stiff - part - part.T
            np.add.at(mass, a, twice / 6)
        return (stiff - diags(np.asarray(stiff.sum(1)).ravel())).tocsr(), mass

    def shade(self, solid: Solid, blend: float = 0.5) -> Array:
        """Normals: of the solid mixed with those of the faces."""
        own = vertex_normals(self.points, self.triangles())
        total = blend * gradient(solid, self.points) + (1 - blend) * own
        return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
