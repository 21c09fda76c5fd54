"""What keeps light away: the character from itself, and from the floor under it.

Shadows are looked up at the vertices and interpolated over the triangles, like every soft thing on a surface this fine.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...motion.rotations import Array
from .camera import Camera
from .raster import SAMPLES, Floats, Ints, front_facing, see

Bools = NDArray[np.bool_]

__all__ = ["floor_shadow", "measure_light", "openness"]

_CELL = 0.016  # metres per pixel of the picture that a light "takes"; ours
_LIFT = 0.006  # metres along the normal, and again towards the light, by which a point is held off its own surface; ours
_NEAREST = 0.4  # 1 + 0.4 / m · height towards the light stands for inverse depth: positive within 2.5 m of the middle
_TAPS = 24  # looks per vertex; ours
_STEEPEST = 2.0  # rise over run of the surface that a look beside the point allows for; ours
_DIRECTIONS = 36  # over the sphere; ours: about 18 of them matter to each vertex
_DARKEST = 0.30  # ours: some light finds its way even into a closed mouth

_GRID, _HALF = 72, 1.1  # cells along a side of the floor's shadow, and half its side in metres; ours
_SOFT = 0.055  # metres: blur of the floor's shadow; ours
_LOW = 0.22  # metres of height over which a body part stops darkening the floor; ours
_DENSE = 0.62  # share of the light that the floor loses at most; ours


def measure_light(
    vertices: Floats, normals: Floats, triangles: Ints, towards: Floats, blur: float, asked: Bools | None = None
) -> Floats:
    """How much of a light far away in the direction ``towards`` reaches each vertex: (V,) 0 … 1.

    Only what stands in the way counts, not the angle at which light arrives.

    Args:
        vertices: (V, 3) metres.
        normals: (V, 3) unit.
        triangles: (F, 3).
        towards: (3,) unit.
        blur: radius in metres around each point in which is looked, for a soft edge; 0 for one look.
        asked: (V,) for which vertices it matters, all where None; the others get 0.
    """
    side = np.cross(towards, (0.0, 0.0, 1.0) if abs(towards[1]) > 0.9 else (0.0, 1.0, 0.0))
    side /= np.linalg.norm(side)
    axes = np.stack([side, np.cross(towards, side), towards]).astype(np.float32) / np.float32(_CELL)
    scale = np.float32(_NEAREST * _CELL)
    flat, slope = vertices @ axes.T, (normals @ axes.T) * np.float32(_CELL)
    low, high = flat.min(0), flat.max(0)
    flat -= np.array([low[0] - 2, low[1] - 2, (low[2] + high[2]) / 2], np.float32)
    width, height = int(high[0] - low[0]) + 5, int(high[1] - low[1]) + 5
    screen = flat * np.array([1, 1, scale], np.float32) + np.array([0, 0, 1], np.float32)
    facing = ~front_facing(screen, triangles)  # y grows upwards here, so that front is back
    seen = see(screen, triangles[facing], width, height)
    depth = np.full((width * height, SAMPLES), -np.inf, np.float32)
    depth.ravel()[seen.sample] = (seen.inverse - 1) / scale

    if asked is not None:
        flat, slope = flat[asked], slope[asked]
    flat += slope * np.float32(_LIFT / _CELL)
    flat[:, 2] += np.float32(_LIFT / _CELL)
    fall = -slope[:, :2] / np.maximum(np.abs(slope[:, 2:]), 1 / _STEEPEST)  # how the surface goes on beside the point
    hidden = np.zeros((len(flat), SAMPLES), np.uint8)
    taps = _TAPS if blur else 1
    for k in range(taps):
        radius, angle = blur / _CELL * np.sqrt(k / taps), 2.399963 * k  # Vogel's spiral, by the golden angle
        dx, dy = np.float32(radius * np.cos(angle)), np.float32(radius * np.sin(angle))
        x = np.clip(flat[:, 0] + dx, 0, width - 1).astype(np.intp)
        y = np.clip(flat[:, 1] + dy, 0, height - 1).astype(np.intp)
        over = flat[:, 2] + np.maximum(fall[:, 0] * dx + fall[:, 1] * dy, 0)
        hidden += depth.take(y * width + x, axis=0) > over[:, None]
    light = 1 - hidden.astype(np.float32) @ np.full(SAMPLES, 1 / (SAMPLES * taps), np.float32)
    if asked is None:
        return light
    found = np.zeros(len(vertices), np.float32)
    found[asked] = light
    return found


def openness(vertices: Floats, normals: Floats, triangles: Ints) -> Floats:
    """How much of its surroundings each vertex sees, cosine-weighted: (V,) 0.3 … 1 (ambient occlusion)."""
    k = np.arange(_DIRECTIONS) + 0.5
    height, angle = 1 - 2 * k / _DIRECTIONS, 2.399963 * k
    around = np.sqrt(1 - height**2)
    total, most = np.zeros(len(vertices), np.float32), np.full(len(vertices), 1e-6, np.float32)
    for towards in np.stack([around * np.cos(angle), height, around * np.sin(angle)], 1).astype(np.float32):
        weight = np.maximum(normals @ towards, 0)
        total += weight * measure_light(vertices, normals, triangles, towards, 0.0, weight > 0)
        most += weight
    return _DARKEST + (1 - _DARKEST) * total / most


def floor_shadow(camera: Camera, vertices: Floats) -> tuple[tuple[slice, slice], Floats] | None:
    """The soft shadow where the character touches or nearly touches the floor (y = 0).

    Returns:
        rows and columns of the part of the picture that it may lie in, and the share (h, w) of light that is left there;
        None where the floor is not in the picture.
    """
    corners = np.array([(x, 0, z) for x in (-_HALF, _HALF) for z in (-_HALF, _HALF)], np.float32)
    x, y, inverse = camera.project(corners).T
    if inverse.min() <= 0:
        return None
    left, right = max(int(x.min()), 0), min(int(x.max()) + 1, camera.width)
    top, bottom = max(int(y.min()), 0), min(int(y.max()) + 1, camera.height)
    if right <= left or bottom <= top:
        return None
    grid = _floor_grid(vertices)
    columns, rows = np.arange(left, right, dtype=np.float32) + 0.5, np.arange(top, bottom, dtype=np.float32) + 0.5
    right_axis, up_axis, forward = camera.axes
    across, down = (columns - camera.width / 2) / camera.focal, (camera.height / 2 - rows) / camera.focal
    # a ray meets the floor at position + t · direction; the right axis is level, so t depends on the row alone
    t = -camera.position[1] / np.minimum(forward[1] + down * up_axis[1], -1e-4)
    ground = [
        camera.position[a] + t[:, None] * (forward[a] + down[:, None] * up_axis[a] + across[None] * right_axis[a])
        for a in (0, 2)
    ]
    u, v = (np.clip((g + _HALF) * (_GRID / 2 / _HALF) - 0.5, 0, _GRID - 1.001).astype(np.float32) for g in ground)
    i, j = u.astype(np.int32), v.astype(np.int32)
    u, v = u - i, v - j
    flat, at = grid.ravel(), i * np.int32(_GRID) + j
    near = flat[at] * (1 - v) + flat[at + 1] * v
    far = flat[at + _GRID] * (1 - v) + flat[at + _GRID + 1] * v
    return (slice(top, bottom), slice(left, right)), near * (1 - u) + far * u


def _floor_grid(vertices: Floats) -> Floats:
    """Light left in each cell of the floor, (G, G) by x and z; 1 along the border."""
    low = np.flatnonzero(vertices[:, 1] < 3 * _LOW)
    weight = np.exp(-np.maximum(vertices[low, 1], 0) / np.float32(_LOW)) - np.exp(np.float32(-3))
    cell = np.clip((vertices[low][:, [0, 2]] + _HALF) * (_GRID / 2 / _HALF), 1, _GRID - 2).astype(np.int32)
    mass = np.bincount(cell[:, 0] * _GRID + cell[:, 1], np.maximum(weight, 0), _GRID * _GRID).reshape(_GRID, _GRID)
    mass = 1 - np.exp(-mass / 2.0)  # cells full of vertices are not darker than covered ones
    blurred = _BLUR @ mass @ _BLUR.T
    shade = 1 - _DENSE * (1 - np.exp(-2.2 * blurred))
    shade[[0, -1]] = shade[:, [0, -1]] = 1
    return shade.astype(np.float32)


def _blur() -> Array:
    at = np.arange(_GRID) * (2 * _HALF / _GRID)
    rows = np.exp(-((at[:, None] - at) ** 2) / (2 * _SOFT**2))
    return rows / rows.sum(1, keepdims=True)


_BLUR = _blur()
