"""Sculpting clay: signed distances of simple solids, their soft unions, and ways to drop points onto their surface.

A *solid* is a function from points (N, 3) in metres to signed distances (N,), negative inside. The distances of ellipsoids and
columns are first-order approximations (Quílez, *distance functions*), good near the surface, which is where they are used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from cospeech.motion.rotations import Array

_MET = 1e-8  # metres from the surface at which a flight ends; ours

__all__ = ["Solid", "capsule", "column", "cut", "ellipsoid", "gradient", "land", "settle", "union"]

Solid = Callable[[Array], Array]


def _norm(v: Array) -> Array:
    return np.sqrt(np.einsum("na,na->n", v, v))


def capsule(a: ArrayLike, b: ArrayLike, ra: float, rb: float, flat: ArrayLike = (1, 1, 1)) -> Solid:
    """A cone with round ends from ``a`` (radius ``ra``) to ``b`` (radius ``rb``); ``flat`` stretches space, e.g. (1, .8, 1)."""
    scale, start = 1 / np.asarray(flat, float), np.asarray(a, float)
    axis = (np.asarray(b, float) - start) * scale
    length = axis @ axis

    def distance(p: Array) -> Array:
        local = (p - start) * scale
        t = np.clip(local @ axis / length, 0, 1)
        return _norm(local - t[:, None] * axis) - (ra + (rb - ra) * t)

    return distance


def ellipsoid(centre: ArrayLike, radii: ArrayLike) -> Solid:
    """An ellipsoid along the axes."""
    middle, size = np.asarray(centre, float), np.asarray(radii, float)

    def distance(p: Array) -> Array:
        k0 = _norm((p - middle) / size)
        k1 = _norm((p - middle) / size**2)
        return k0 * (k0 - 1) / np.maximum(k1, 1e-9)

    return distance


def column(rows: Sequence[Sequence[float]], power: float = 2.3) -> Solid:
    """An upright column from rows ``(y, half width, half depth, centre z)``, upwards; cross sections are superellipses."""
    table = np.array(rows, float)
    fine = np.linspace(table[0, 0], table[-1, 0], 160)
    width, depth, centre = (PchipInterpolator(table[:, 0], table[:, k])(fine) for k in (1, 2, 3))

    def distance(p: Array) -> Array:
        y = p[:, 1]
        rx, rz, cz = (np.interp(y, fine, v) for v in (width, depth, centre))
        u, v = np.abs(p[:, 0]) / rx, np.abs(p[:, 2] - cz) / rz
        norm = np.maximum((u**power + v**power) ** (1 / power), 1e-6)
        slope = np.sqrt((u ** (power - 1) / rx) ** 2 + (v ** (power - 1) / rz) ** 2) / norm ** (power - 1)
        side = (norm - 1) / np.maximum(slope, 1 / np.maximum(rx, rz))
        return np.maximum(side, np.maximum(y - fine[-1], fine[0] - y))

    return distance


def union(soft: float, *solids: Solid) -> Solid:
    """Union with fillets about ``soft`` metres wide (quadratic smooth minimum)."""

    def distance(p: Array) -> Array:
        total = solids[0](p)
        for solid in solids[1:]:
            other = solid(p)
            h = np.maximum(soft - np.abs(total - other), 0) / soft
            total = np.minimum(total, other) - h * h * soft / 4
        return total

    return distance


def cut(soft: float, solid: Solid, *tools: Solid) -> Solid:
    """``solid`` without the ``tools``, with edges rounded over ``soft`` metres."""

    def distance(p: Array) -> Array:
        total = solid(p)
        for tool in tools:
            other = -tool(p)
            h = np.maximum(soft - np.abs(total - other), 0) / soft
            total = np.maximum(total, other) + h * h * soft / 4
        return total

    return distance


def gradient(solid: Solid, p: Array, step: float = 4e-4) -> Array:
    """Unit outward normals of the solid's level sets at ``p``."""
    corners = np.array([(1, -1, -1), (-1, -1, 1), (-1, 1, -1), (1, 1, 1)], float)
    total = sum(corner * solid(p + step * corner)[:, None] for corner in corners)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)


def settle(solid: Solid, p: Array, rounds: int = 8) -> Array:
    """Walk points along the gradient onto the surface."""
    for _ in range(rounds):
        p = p - np.clip(solid(p), -0.02, 0.02)[:, None] * gradient(solid, p)
    return p


def land(solid: Solid, start: Array, direction: Array, rounds: int = 60) -> Array:
    """Fly from outside at ``start`` along the unit ``direction`` until the surface is met (sphere tracing)."""
    t, flying = np.zeros(len(start)), np.arange(len(start))
    for _ in range(rounds):
        step = 0.8 * solid(start[flying] + t[flying, None] * direction[flying])
        t[flying] += step
        flying = flying[np.abs(step) > _MET]
        if not len(flying):
            break
    return start + t[:, None] * direction
