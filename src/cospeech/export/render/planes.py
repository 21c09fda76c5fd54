"""Interpolate values from the vertices of triangles: linear in the picture over each triangle.

On triangles of some pixels this looks the same as with perspective, and is several times as fast.
"""

from __future__ import annotations

import numpy as np

from .raster import Floats, Indices, pick

__all__ = ["Slopes"]

_SLIVER = 1e-2  # pixels²; ours: below half this area a triangle has one value


class Slopes:
    """Triangles in the picture.

    Args:
        screen: (V, ≥ 2) x and y of vertices in pixels.
        corners: (3, K) vertices of the triangles.
    """

    def __init__(self, screen: Floats, corners: Indices) -> None:
        self._screen, self._corners = screen, corners
        (x0, x1, x2), (y0, y1, y2) = pick(np.ascontiguousarray(screen[:, :2].T), corners, 1)
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        flat = np.abs(area) < _SLIVER
        per_area = np.where(flat, 0, 1 / np.where(flat, 1, area))
        self._x, self._y = x0, y0
        self._sides = (x1 - x0) * per_area, (x2 - x0) * per_area, (y1 - y0) * per_area, (y2 - y0) * per_area

    def some(self, which: Indices) -> Slopes:
        """Slopes of some of the triangles."""
        return Slopes(self._screen, pick(self._corners, which, 1))

    def planes(self, values: Floats) -> Floats:
        """Values (C, V) of the vertices → (C, 3, K) as `raster.evaluate` takes them."""
        x1, x2, y1, y2 = self._sides
        planes = np.empty((len(values), 3, len(self._x)), np.float32)
        for (base, across, down), value in zip(planes, values, strict=True):
            v0, v1, v2 = pick(value, self._corners)
            v1 -= v0
            v2 -= v0
            across[:] = v1 * y2 - v2 * y1
            down[:] = v2 * x1 - v1 * x2
            base[:] = v0 - self._x * across - self._y * down
        return planes
