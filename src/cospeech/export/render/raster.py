"""Hidden-surface removal in numpy: which triangle is seen at each of four samples per pixel.

Triangles are cut into rows (scan conversion); every row becomes a run of samples whose inverse depth is linear in x.
Samples are then settled with a z-buffer that needs no loop over triangles: a scatter in back-to-front order, where the
last value written to a place stays, is right nearly everywhere; what is nearer than the one that stayed is scattered
again, until nothing is.

Samples lie two by two in a pixel, the lower pair shifted by a quarter of a pixel against the upper one, so that an upright
edge, the usual kind on a standing figure, is seen in four steps instead of two. A sample belongs to a triangle if it lies
inside it or on its left or top edge. Two triangles with a common edge compute that edge from the same corners in the same
order, so every sample along it belongs to one of them: there are no cracks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["SAMPLES", "VisibleSamples", "front_facing", "sample_positions", "see"]

Floats = NDArray[np.float32]
Ints = NDArray[np.int32]

Keeps = Callable[[Ints, Ints], NDArray[np.bool_]]

SAMPLES = 4  # per pixel
_SHIFT = np.array([0.25, 0.75], np.float32)  # where a sample lies in its half pixel, in rows above and below; ours
_SLIVER = 1e-3  # samples²; ours: below half this area a triangle's depth is taken as constant


class VisibleSamples(NamedTuple):
    """What is visible, one entry per covered sample, sorted by pixel.

    Attributes:
        sample: (N,) ``4 · pixel + k``, ascending; pixel = ``row · width + column``, k as in `sample_positions`.
        triangle: (N,) index of the nearest triangle.
        inverse: (N,) its inverse depth there, 1 / metres.
    """

    sample: Ints
    triangle: Ints
    inverse: Floats


class _Runs(NamedTuple):
    """Runs of samples: index of the row's first sample, first column, length, inverse depth there and per step, triangle."""

    base: Ints
    column: Ints
    length: Ints
    inverse: Floats
    step: Floats
    triangle: Ints


def sample_positions(sample: Ints, width: int) -> tuple[Floats, Floats]:
    """x and y in pixels of samples of a picture ``width`` pixels wide."""
    pixel, k = sample >> 2, sample & 3
    row = pixel // np.int32(width)
    lower = k >> 1
    column = (pixel - row * np.int32(width)).astype(np.float32)
    x = column + ((k & 1).astype(np.float32) + _SHIFT[lower]) * np.float32(0.5)
    return x, row.astype(np.float32) + (lower.astype(np.float32) + np.float32(0.5)) * np.float32(0.5)


def front_facing(screen: Floats, triangles: Ints) -> NDArray[np.bool_]:
    """Which triangles (F, 3) turn their front, counter-clockwise as seen, to the camera and lie before it.

    Args:
        screen: (V, 3) x and y in pixels, y down, and inverse depth, ≤ 0 for a vertex behind the camera.
    """
    (x0, x1, x2), (y0, y1, y2), inverse = np.ascontiguousarray(screen.T).take(triangles.T, axis=1)
    turn = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    return (turn < 0) & (inverse[0] > 0) & (inverse[1] > 0) & (inverse[2] > 0)


def see(screen: Floats, triangles: Ints, width: int, height: int, keeps: Keeps | None = None) -> VisibleSamples:
    """Find the nearest triangle at every sample of a picture of ``width × height`` pixels.

    Args:
        screen: (V, 3) x and y in pixels, y down, and inverse depth, > 0 for every vertex used.
        triangles: (F, 3) vertex indices; both faces are drawn, see `front_facing`.
        keeps: tells of samples (N,) and the triangles (N,) that cover them which are no holes; None where there are none.

    Triangles partly outside the picture are clipped to it. At equal depth the same triangle wins on every run.
    """
    runs = _runs(screen, triangles, width, height)
    place, inverse, run = _spread(runs)
    if keeps is not None:
        kept = np.flatnonzero(keeps(place, runs.triangle.take(run)))
        place, inverse, run = place[kept], inverse[kept], run[kept]
    owner = _settle(place, inverse, width * height * SAMPLES)
    sample = np.flatnonzero(owner >= 0).astype(np.int32)
    winner = owner.take(sample)
    return VisibleSamples(sample, runs.triangle.take(run.take(winner)), inverse.take(winner))


def _runs(screen: Floats, triangles: Ints, width: int, height: int) -> _Runs:
    """Cut triangles into runs of samples, the farthest triangle first."""
    columns, rows = 2 * width, 2 * height
    x, y, w = np.ascontiguousarray(screen.T, np.float32)
    far_first = np.argsort(w[triangles[:, 0]], kind="stable").astype(np.int32)
    a, b, c = triangles[far_first].T
    y = y * 2
    a, b = _upper_first(a, b, y)  # a sorting network: afterwards a is the top corner, c the bottom one
    b, c = _upper_first(b, c, y)
    a, b = _upper_first(a, b, y)
    x0, x1, x2, y0, y1, y2, w0, w1, w2 = 2 * x[a], 2 * x[b], 2 * x[c], y[a], y[b], y[c], w[a], w[b], w[c]
    top = np.clip(np.ceil(y0 - 0.5), 0, rows).astype(np.int32)
    bottom = np.clip(np.ceil(y2 - 0.5), 0, rows).astype(np.int32)
    off = (np.maximum(np.maximum(x0, x1), x2) < 0) | (np.minimum(np.minimum(x0, x1), x2) > columns)
    count = np.where(off, 0, bottom - top)

    turn = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)  # > 0: the middle corner lies right of the long edge
    flat = np.abs(turn) < _SLIVER
    per_area = np.where(flat, 0, 1 / np.where(flat, 1, turn))
    step_x = ((w1 - w0) * (y2 - y0) - (w2 - w0) * (y1 - y0)) * per_area
    step_y = ((w2 - w0) * (x1 - x0) - (w1 - w0) * (x2 - x0)) * per_area
    long, upper, lower = _slope(x0, y0, x2, y2), _slope(x0, y0, x1, y1), _slope(x1, y1, x2, y2)

    row = np.arange(int(count.sum()), dtype=np.int32)
    row -= np.repeat(np.cumsum(count, dtype=np.int32) - count - top, count)
    # from triangles to their rows; np.repeat is several times faster than indexing, here and in _spread
    of_triangle = (x0, y0, long, upper, x1, y1, lower, turn, w0, step_x, step_y, far_first)
    x0, y0, long, upper, x1, y1, lower, turn, w0, step_x, step_y, triangle = (np.repeat(v, count) for v in of_triangle)
    y, shift = row.astype(np.float32) + np.float32(0.5), _SHIFT[row & 1]  # int32 and float32 would make float64
    through = x0 + (y - y0) * long
    bent = np.where(row >= np.ceil(y1 - 0.5), x1 + (y - y1) * lower, x0 + (y - y0) * upper)
    right = turn > 0
    start = np.clip(np.ceil(np.where(right, through, bent) - shift), 0, columns)
    stop = np.clip(np.ceil(np.where(right, bent, through) - shift), 0, columns)
    keep = np.flatnonzero(stop > start)
    inverse = w0 + (start + shift - x0) * step_x + (y - y0) * step_y
    base = (row >> 1) * np.int32(SAMPLES * width) + (row & 1) * np.int32(2)
    length, start = (stop - start)[keep].astype(np.int32), start[keep].astype(np.int32)
    return _Runs(base[keep], start, length, inverse[keep], step_x[keep], triangle[keep])


def _upper_first(a: Ints, b: Ints, y: Floats) -> tuple[Ints, Ints]:
    """Corners a and b of triangles, exchanged where b lies above a."""
    swap = y[b] < y[a]
    return np.where(swap, b, a), np.where(swap, a, b)


def _slope(xa: Floats, ya: Floats, xb: Floats, yb: Floats) -> Floats:
    """Change of x per row along the edge from a down to b; 0 where the edge is level, which no row crosses."""
    level = yb <= ya
    return np.where(level, 0, (xb - xa) / np.where(level, 1, yb - ya))


def _spread(runs: _Runs) -> tuple[Ints, Floats, Ints]:
    """Spread runs into samples: index (as in `VisibleSamples`), inverse depth and run of each."""
    length = runs.length
    column = np.arange(int(length.sum()), dtype=np.int32)
    column += np.repeat(runs.column - (np.cumsum(length, dtype=np.int32) - length), length)
    inverse = column.astype(np.float32)
    inverse *= np.repeat(runs.step, length)
    inverse += np.repeat(runs.inverse - runs.column.astype(np.float32) * runs.step, length)
    place = column << 1  # samples of a pixel lie together: column 2i + j of a row is place 4i + j
    column &= 1
    place -= column
    place += np.repeat(runs.base, length)
    return place, inverse, np.repeat(np.arange(len(length), dtype=np.int32), length)


def _settle(place: Ints, inverse: Floats, size: int) -> Ints:
    """(size,) index of the entry with the greatest inverse depth at each place, −1 where there is none."""
    owner = np.full(size, -1, np.int32)
    place = place.astype(np.intp)  # what numpy indexes with fastest
    owner[place] = np.arange(len(place), dtype=np.int32)
    nearer = np.flatnonzero(inverse > inverse.take(owner.take(place)))
    while len(nearer):
        nearer = nearer[np.argsort(inverse[nearer], kind="stable")]
        owner[place[nearer]] = nearer
        nearer = nearer[inverse[nearer] > inverse[owner[place[nearer]]]]
    return owner
