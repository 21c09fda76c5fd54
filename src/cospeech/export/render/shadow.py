"""Shadows of the character: on itself, and on the floor under it.

Shadows are computed at the vertices and interpolated over the triangles: they are soft, and the mesh is fine.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...motion.rotations import Array
from .camera import Camera
from .raster import Floats, Indices, Raster, pick

Bools = NDArray[np.bool_]

__all__ = ["FloorShadow", "floor_shadow", "measure_light", "openness"]

_CELL = 0.010  # metres per pixel of the picture as the light sees it; ours
_MARGIN = 2  # cells around the points: these are lifted off their surface by less
_LIFT = 0.006  # metres along the normal, and again towards the light, by which a point is lifted off its own surface; ours
_NEAREST = 0.4  # 1 + 0.4 / m · height towards the light stands for inverse depth: positive within 2.5 m of the middle
_TAPS = 16  # lookups per vertex; ours
_STEEPEST = 2.0  # steepest slope of the surface that a lookup beside the point allows for; ours
# four cells of a block, two by two, lie in one number: compared with a point by one subtraction instead of four comparisons
_LANE = 16  # bits of a number for each, of which the highest is a guard
_LEVELS = (1 << _LANE - 1) - 1  # of depth; finer than 0.1 mm on a grown-up
_ONES = (1 << _LANE * np.arange(4)).sum()
_GUARDS = _ONES << _LANE - 1
_DIRECTIONS = 36  # over the sphere; ours: about half of them count for each vertex
_DARKEST = 0.30  # ours: some light gets even into a closed mouth

_GRID, _HALF = 72, 1.1  # cells along a side of the floor's shadow, and half its side in metres; ours
_SOFT = 0.055  # metres: blur of the floor's shadow; ours
_LOW = 0.22  # metres: height over which the shadow of a body part fades; ours
_DARK = 0.998  # share of light; ours: less shadow than that does not show in 8 bits
_DENSE = 0.62  # share of the light that the floor loses at most; ours


def measure_light(
    vertices: Floats, normals: Floats, corners: Indices, towards: Floats, blur: float, mask: Bools | None = None
) -> Floats:
    """Compute how much of a distant light in the direction ``towards`` reaches each vertex: (V,) 0 … 1.

    Only occlusion counts, not the angle at which light arrives.

    Args:
        vertices: (V, 3) metres.
        normals: (V, 3) unit.
        corners: (3, F) vertices of triangles.
        towards: (3,) unit.
        blur: radius in metres of the lookups around each point, for a soft edge; 0 for one lookup.
        mask: (V,) which vertices to compute, all where None; the others get 0.
    """
    at = np.arange(len(vertices)) if mask is None else np.flatnonzero(mask)
    light = np.zeros(len(vertices), np.float32)
    if not len(at):
        return light
    axes = _axes_of(*towards.tolist())
    scale, radius = np.float32(_NEAREST * _CELL), blur / _CELL
    flat = (axes / np.float32(_CELL)) @ vertices.T
    flat[2] -= (flat[2].min() + flat[2].max()) / 2
    x, y, z = pick(flat, at, 1)
    low, high = np.array([x.min(), y.min()]) - radius - _MARGIN, np.array([x.max(), y.max()]) + radius + _MARGIN
    low = np.floor(low / 2) * 2  # a multiple of whole blocks, so that the cells stay in place while the character moves
    across, down = (int(size) // 2 + 1 for size in high - low)  # in blocks
    screen = np.stack([flat[0] - np.float32(low[0]), flat[1] - np.float32(low[1]), flat[2] * scale + np.float32(1)], 1)
    # y grows upwards here, so that front is back
    visible = Raster(screen, corners, 2 * across, 2 * down, side=-1).see_middles()
    levels = np.float32(_LEVELS / (np.ptp(flat[2]) + 1))  # per cell of depth
    cells = np.zeros(4 * across * down, np.int64)
    cells[visible.pixel] = ((visible.inverse - 1) / scale - flat[2].min()) * levels
    lanes = _pack(np.clip(cells, 0, _LEVELS).reshape(down, 2, across, 2))

    slope = axes @ pick(normals.T, at, 1)
    lift = np.float32(_LIFT / _CELL)
    x, y, z = x + slope[0] * lift - np.float32(low[0]), y + slope[1] * lift - np.float32(low[1]), z + (slope[2] + 1) * lift
    fall = -slope[:2] / np.maximum(np.abs(slope[2]), np.float32(1 / _STEEPEST))  # slope of the surface beside the point
    taps = np.arange(_TAPS if blur else 1)
    # Vogel's spiral, by the golden angle
    turn, radii = np.exp(2.399963j * taps), radius * np.sqrt(taps / len(taps))
    dx, dy = ((part * radii).astype(np.float32)[:, None] for part in (turn.real, turn.imag))
    over = fall[0] * dx
    over += fall[1] * dy
    np.maximum(over, 0, out=over)
    over += z - flat[2].min()
    over *= levels
    block = (y / 2 + dy / 2).astype(np.int32) * np.int32(across) + (x / 2 + dx / 2).astype(np.int32)
    # in each lane, the guard bit stays set where the cell is higher than the point, by a level at least
    difference = pick(lanes, block) - (np.clip(over, 0, _LEVELS - 1, out=over).astype(np.int64) + 1) * _ONES
    shade = ((difference >> _LANE - 1) & _ONES).sum(0) * _ONES >> 3 * _LANE  # of all taps, then of all four lanes
    light[at] = 1 - shade.astype(np.float32) * np.float32(1 / (4 * len(taps)))
    return light


def _axes_of(x: float, y: float, z: float) -> Floats:
    """(3, 3) rows: two directions perpendicular to (x, y, z), and itself; without `np.cross`, which takes longer."""
    side = (y, -x, 0.0) if abs(y) > 0.9 else (-z, 0.0, x)
    length = sqrt(side[0] ** 2 + side[1] ** 2 + side[2] ** 2)
    a, b, c = (value / length for value in side)
    return np.array([(a, b, c), (y * c - z * b, z * a - x * c, x * b - y * a), (x, y, z)], np.float32)


def _pack(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Depths (H, 2, W, 2) in levels → (H · W,) numbers of four lanes."""
    numbers = cells[:, 0, :, 0] | cells[:, 0, :, 1] << _LANE
    numbers |= cells[:, 1, :, 0] << 2 * _LANE
    numbers |= cells[:, 1, :, 1] << 3 * _LANE
    numbers |= _GUARDS
    return numbers.ravel()


def openness(vertices: Floats, normals: Floats, corners: Indices) -> Floats:
    """Compute how much of its surroundings each vertex sees, cosine-weighted: (V,) 0.3 … 1 (ambient occlusion)."""
    k = np.arange(_DIRECTIONS) + 0.5
    height, angle = 1 - 2 * k / _DIRECTIONS, 2.399963 * k
    around = np.sqrt(1 - height**2)
    total, most = np.zeros(len(vertices), np.float32), np.full(len(vertices), 1e-6, np.float32)
    for towards in np.stack([around * np.cos(angle), height, around * np.sin(angle)], 1).astype(np.float32):
        weight = np.maximum(normals @ towards, 0)
        total += weight * measure_light(vertices, normals, corners, towards, 0.0, weight > 0)
        most += weight
    return _DARKEST + (1 - _DARKEST) * total / most


class FloorShadow(NamedTuple):
    """A shadow on the floor: its rows and columns in the picture, and the share (h, w) of the light that arrives there."""

    rows: slice
    columns: slice
    light: Floats

    def share(self, row: Indices, column: Indices) -> Floats:
        """(N,) share of the light that arrives at pixels."""
        row, column = row - self.rows.start, column - self.columns.start
        height, width = self.light.shape
        inside = np.flatnonzero((row >= 0) & (row < height) & (column >= 0) & (column < width))
        light = np.ones(len(row), np.float32)
        light[inside] = self.light[row[inside], column[inside]]
        return light


def floor_shadow(camera: Camera, vertices: Floats) -> FloorShadow | None:
    """The soft shadow where the character touches the floor (y = 0) or nearly does; None where it is not in the picture."""
    if _is_outside(camera, *camera.project(np.array([(x, 0, z) for x in (-_HALF, _HALF) for z in (-_HALF, _HALF)])).T):
        return None
    grid = _floor_grid(vertices)
    cell = 2 * _HALF / _GRID
    dark = np.nonzero(grid < _DARK)
    if not len(dark[0]):
        return None
    sides = [((k.min() - 1) * cell - _HALF, (k.max() + 2) * cell - _HALF) for k in dark]
    x, y, inverse = camera.project(np.array([(x, 0, z) for x in sides[0] for z in sides[1]], np.float32)).T
    if inverse.min() <= 0:
        return None
    left, right = max(int(x.min()), 0), min(int(x.max()) + 1, camera.width)
    top, bottom = max(int(y.min()), 0), min(int(y.max()) + 1, camera.height)
    if right <= left or bottom <= top:
        return None
    columns, rows = np.arange(left, right, dtype=np.float32) + 0.5, np.arange(top, bottom, dtype=np.float32) + 0.5
    right_axis, up_axis, forward = camera.axes
    across, down = (columns - camera.width / 2) / camera.focal, (camera.height / 2 - rows) / camera.focal
    # a ray meets the floor at position + t · direction; the right axis is level, so t depends on the row alone
    t = -camera.position[1] / np.minimum(forward[1] + down * up_axis[1], -1e-4)
    ground = [
        (camera.position[a] + t * (forward[a] + down * up_axis[a])).astype(np.float32)[:, None]
        + (t * right_axis[a]).astype(np.float32)[:, None] * across.astype(np.float32)
        for a in (0, 2)
    ]
    u, v = (np.clip((g + np.float32(_HALF)) * np.float32(1 / cell) - np.float32(0.5), 0, _GRID - 1.001) for g in ground)
    i, j = u.astype(np.int32), v.astype(np.int32)
    u, v = u - i.astype(np.float32), v - j.astype(np.float32)
    flat, at = grid.ravel(), (i * np.int32(_GRID) + j).astype(np.intp)
    near = pick(flat, at) * (1 - v) + pick(flat, at + 1) * v
    far = pick(flat, at + _GRID) * (1 - v) + pick(flat, at + _GRID + 1) * v
    return FloorShadow(slice(top, bottom), slice(left, right), near * (1 - u) + far * u)


def _is_outside(camera: Camera, x: Floats, y: Floats, inverse: Floats) -> bool:
    """Whether a flat shape with these projected corners, all before the camera, is outside the picture."""
    beside = x.max() < 0 or x.min() > camera.width or y.max() < 0 or y.min() > camera.height
    return bool(inverse.min() > 0 and beside)


def _floor_grid(vertices: Floats) -> Floats:
    """Share of light in each cell of the floor, (G, G) by x and z; 1 along the border."""
    low = np.flatnonzero(vertices[:, 1] < 3 * _LOW)
    weight = np.exp(-np.maximum(vertices[low, 1], 0) / np.float32(_LOW)) - np.exp(np.float32(-3))
    cell = np.clip((vertices[low][:, [0, 2]] + _HALF) * (_GRID / 2 / _HALF), 1, _GRID - 2).astype(np.int32)
    mass = np.bincount(cell[:, 0] * _GRID + cell[:, 1], np.maximum(weight, 0), _GRID * _GRID).reshape(_GRID, _GRID)
    mass = 1 - np.exp(-mass / 2.0)  # cells full of vertices are not darker than covered ones
    soft = _BLUR @ mass @ _BLUR.T
    shade = 1 - _DENSE * (1 - np.exp(-2.2 * soft))
    shade[[0, -1]] = shade[:, [0, -1]] = 1
    return shade.astype(np.float32)


def _blur() -> Array:
    at = np.arange(_GRID) * (2 * _HALF / _GRID)
    rows = np.exp(-((at[:, None] - at) ** 2) / (2 * _SOFT**2))
    return rows / rows.sum(1, keepdims=True)


_BLUR = _blur()
