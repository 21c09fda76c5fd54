"""Hidden-surface removal in numpy: which triangle is seen in the middle of each pixel, or at four samples of some pixels.

Triangles are cut into rows (scan conversion); every row becomes a run of places whose inverse depth is linear in x. Then a
z-buffer without a loop over triangles finds the nearest triangle of each place. Triangles are written in back-to-front order,
and the last value written to a place stays: this is right nearly everywhere. Values that are nearer than the one that stayed
are written again, the nearest last.

Samples lie two by two in a pixel, the lower pair shifted by a quarter of a pixel against the upper one, so that an upright
edge, the usual kind on a standing figure, is seen in four steps instead of two. A place belongs to a triangle if it lies inside
it or on its left or top edge. Two triangles with a common edge compute it from the same corners in the same order. So every
place along the edge belongs to one of them: there are no cracks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "SAMPLES",
    "Raster",
    "VisiblePixels",
    "VisibleSamples",
    "chunks",
    "evaluate",
    "middle_positions",
    "pick",
    "sample_positions",
]

Floats = NDArray[np.float32]
Ints = NDArray[np.integer]
Indices = NDArray[np.intp]  # what numpy indexes with fastest
Keeps = Callable[[Indices, Indices], NDArray[np.bool_]]

SAMPLES = 4  # per pixel
_SHIFT = np.array([0.25, 0.75], np.float32)  # x of a sample in its half pixel, in the upper and the lower row; ours
_BESIDE = np.array([-0.375, 0.125, -0.125, 0.375], np.float32)  # columns from the middle of its pixel
_BELOW = np.array([-0.25, -0.25, 0.25, 0.25], np.float32)  # rows from there
# corners of a triangle from top to bottom, by 1 · (1 is above 0) + 2 · (2 is above 1) + 4 · (2 is above 0); 3 and 4 cannot be
_ORDERS = np.array([(0, 1, 2), (1, 0, 2), (0, 2, 1), (2, 1, 0), (0, 1, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]).T.copy()
_CHUNK = 16_384  # places that are computed at a time, so that the values stay in a core's cache: three times faster; ours
_BLOCK = 4  # pixels along a side of the blocks by which triangles are selected; ours
_SLIVER = 1e-3  # samples²; ours: below half this area a triangle's depth is taken as constant


class VisibleSamples(NamedTuple):
    """The visible triangles, one entry per covered sample, sorted by pixel.

    Attributes:
        sample: (N,) ``4 · pixel + k``, ascending; pixel = ``row · width + column``, k as in `sample_positions`.
        triangle: (N,) index in `Raster.number` of the nearest triangle.
        inverse: (N,) its inverse depth there, 1 / metres.
    """

    sample: Indices
    triangle: Indices
    inverse: Floats


class VisiblePixels(NamedTuple):
    """The visible triangles in the middles of pixels, one entry per covered pixel.

    Attributes:
        pixel: (N,) ``row · width + column``, ascending.
        triangle: (N,) index in `Raster.number` of the nearest triangle.
        inverse: (N,) its inverse depth there, 1 / metres.
    """

    pixel: Indices
    triangle: Indices
    inverse: Floats


class _Runs(NamedTuple):
    """Parts of triangles that lie in one row of places: row, first column, the column after the last, triangle.

    Some have no places: their first column is not before the last.
    """

    row: Indices
    start: Ints
    stop: Ints
    triangle: Indices


def pick(values: NDArray[Any], index: Ints, axis: int | None = None) -> NDArray[Any]:
    """``values.take(index, axis)`` for an index that is known to be valid: without the check it takes half the time."""
    return values.take(index, axis, mode="clip")


def chunks(count: int) -> Iterator[slice]:
    """Slices of ``count`` places, each so short that its values stay in a core's cache."""
    return (slice(start, start + _CHUNK) for start in range(0, count, _CHUNK))


def sample_positions(sample: Indices, width: int) -> tuple[Floats, Floats]:
    """x and y in pixels of samples of a picture ``width`` pixels wide."""
    x, y = middle_positions(sample >> 2, width)
    k = sample & 3
    x += pick(_BESIDE, k)
    y += pick(_BELOW, k)
    return x, y


def middle_positions(pixel: Indices, width: int) -> tuple[Floats, Floats]:
    """x and y in pixels of the middles of pixels of a picture ``width`` pixels wide."""
    short = pixel.astype(np.int32)
    row = short // np.int32(width)
    short -= row * np.int32(width)
    return short.astype(np.float32) + np.float32(0.5), row.astype(np.float32) + np.float32(0.5)


def evaluate(planes: Floats, triangle: Ints, x: Floats, y: Floats) -> Floats:
    """Values (C, N) at places, in pixels, on triangles (N,); the values are linear over each triangle.

    Args:
        planes: (C, 3, K) value at x = y = 0, change along x, and along y.
        triangle: (N,) indices of planes.
        x: (N,)
        y: (N,)
    """
    out = np.empty((len(planes), len(triangle)), np.float32)
    for some in chunks(len(triangle)):
        index, across, down = triangle[some], x[some], y[some]
        for (base, step_x, step_y), row in zip(planes, out[:, some], strict=True):
            step_x.take(index, out=row, mode="clip")
            row *= across
            along = pick(step_y, index)
            along *= down
            row += along
            row += pick(base, index)
    return out


class Raster:
    """Triangles before a picture.

    Args:
        screen: (V, 3) x and y in pixels, y down, and inverse depth, ≤ 0 for a vertex behind the camera.
        corners: (3, F) vertices of triangles.
        width: of the picture, pixels.
        height: of the picture, pixels.
        side: which face is drawn: 1: the one whose corners are seen counter-clockwise; −1: the other; 0: both.

    Attributes:
        number: (K,) the triangles that may be seen, the farthest first.

    Triangles partly outside the picture are clipped to it; those with a corner behind the camera are left out. At equal depth
    the same triangle wins on every run.
    """

    def __init__(self, screen: Floats, corners: Indices, width: int, height: int, side: int = 0) -> None:
        self.width, self.height = width, height
        x, y, w = pick(np.ascontiguousarray(screen.T, np.float32), corners, axis=1)
        (left, right), (top, bottom) = _ends(x), _ends(y)
        inside = (right >= 0) & (left <= width) & (bottom >= 0) & (top <= height) & (w[0] > 0) & (w[1] > 0) & (w[2] > 0)
        if side:
            turn = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
            inside &= turn < 0 if side > 0 else turn > 0
        visible = np.flatnonzero(inside)
        self.number: Indices = pick(visible, _sort(pick(w[0], visible)))
        self._box = [pick(end, self.number) for end in (left, right, top, bottom)]
        order = pick((y[1] < y[0]) + 2 * (y[2] < y[1]) + 4 * (y[2] < y[0]), self.number)
        order = pick(_ORDERS, order, axis=1)  # a the top corner, c the bottom one
        order *= corners.shape[1]
        order += self.number
        (x0, x1, x2), (y0, y1, y2), (w0, w1, w2) = (pick(values.ravel(), order) for values in (x, y, w))
        turn = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)  # > 0: the middle corner lies right of the long edge
        flat = np.abs(turn) < _SLIVER
        per_area = np.where(flat, 0, 1 / np.where(flat, 1, turn))
        step_x = ((w1 - w0) * (y2 - y0) - (w2 - w0) * (y1 - y0)) * per_area
        step_y = ((w2 - w0) * (x1 - x0) - (w1 - w0) * (x2 - x0)) * per_area
        self._nearest, self._farthest = np.maximum(np.maximum(w0, w1), w2), np.minimum(np.minimum(w0, w1), w2)
        self._plane = np.stack([w0 - x0 * step_x - y0 * step_y, step_x, step_y])
        long, upper, lower = _slope(x0, y0, x2, y2), _slope(x0, y0, x1, y1), _slope(x1, y1, x2, y2)
        bends_right = turn > 0
        self._rows = np.stack([y0, y1, y2])
        # the edges on the left and on the right as (point on it, change of x per row), above and below the middle corner
        self._edges = np.empty((6, len(turn), 2), np.float32)
        self._edges[:, :, 0] = x0, y0, np.where(bends_right, long, upper), x0, y0, np.where(bends_right, upper, long)
        self._edges[:3, :, 1] = np.where(bends_right, (x0, y0, long), (x1, y1, lower))
        self._edges[3:, :, 1] = np.where(bends_right, (x1, y1, lower), (x0, y0, long))

    def see_middles(self, mask: NDArray[np.bool_] | None = None) -> VisiblePixels:
        """Find the nearest triangle in the middle of every pixel; only those of the ``mask`` (K,), all where None."""
        runs = self._runs(1, None if mask is None else np.flatnonzero(mask))
        length = np.maximum(runs.stop - runs.start, 0)
        first = runs.row * self.width + runs.start - (np.cumsum(length) - length)
        both = np.repeat(first << 32 | runs.triangle, length)  # both in one number, so that one array is repeated
        place, triangle = both >> 32, both.astype(np.int32)
        place += np.arange(len(place))
        owner = np.full(self.width * self.height, -1, np.int32)
        owner[place] = triangle
        # few places are hidden, and most of these lie behind all of the triangle that hides them: only the rest is compared
        clashes = np.flatnonzero(pick(owner, place) != triangle)
        loser, rival = pick(triangle, clashes), pick(owner, pick(place, clashes))
        close = np.flatnonzero(pick(self._nearest, loser) > pick(self._farthest, rival))
        loser, rival, at = pick(loser, close), pick(rival, close), pick(place, pick(clashes, close))
        x, y = middle_positions(at, self.width)
        inverse = self._inverse(loser, x, y)
        nearer = np.flatnonzero(inverse > self._inverse(rival, x, y))
        nearer = pick(nearer, _sort(pick(inverse, nearer)))
        owner[pick(at, nearer)] = pick(loser, nearer)
        pixel = np.flatnonzero(owner >= 0)
        nearest, depth = np.empty(len(pixel), np.intp), np.empty(len(pixel), np.float32)
        for some in chunks(len(pixel)):
            nearest[some] = pick(owner, pixel[some])
            depth[some] = self._inverse(nearest[some], *middle_positions(pixel[some], self.width))
        return VisiblePixels(pixel, nearest, depth)

    def _inverse(self, triangle: Ints, x: Floats, y: Floats) -> Floats:
        """(N,) inverse depths of triangles, which are indices in `number`, at places in pixels."""
        return evaluate(self._plane[None], triangle, x, y)[0]

    def see(self, pixels: Ints, keeps: Keeps | None = None) -> VisibleSamples:
        """Find the nearest triangle at every sample of pixels.

        Args:
            pixels: (P,) ascending, where to look.
            keeps: samples (N,) and the triangles (N,) that cover them, as indices in `number` → which are no holes; None where
                there are no holes.
        """
        # how many of the pixels come before each one of the picture, and before the end
        counts = np.diff(pixels, prepend=-1, append=self.width * self.height)
        before = np.repeat(np.arange(len(pixels) + 1, dtype=np.int32), counts)
        runs = self._runs(2, np.flatnonzero(self._touch(pixels)), before)
        row = (runs.row >> 1) * np.int32(self.width)
        places, triangles = [], []
        for k in range(2):  # the left and the right samples of pixels
            first = pick(before, row + (runs.start + (1 - k) >> 1))
            length = pick(before, row + (runs.stop + (1 - k) >> 1)) - first
            indices = np.flatnonzero(length > 0)
            first, length = pick(first, indices), pick(length, indices)
            of, past = _spread(length)
            number, run = np.arange(len(of)) + pick(first - past, of), pick(indices, of)
            places.append(4 * number + pick(2 * (runs.row & 1) + k, run))
            triangles.append(pick(runs.triangle, run))
        place, triangle = np.concatenate(places), np.concatenate(triangles)
        sample = 4 * pick(pixels, place >> 2) + (place & 3)
        if keeps is not None:
            indices = np.flatnonzero(keeps(sample, triangle))
            place, sample, triangle = place[indices], sample[indices], triangle[indices]
        inverse = np.empty(len(sample), np.float32)
        for some in chunks(len(sample)):
            inverse[some] = self._inverse(triangle[some], *sample_positions(sample[some], self.width))
        nearest = _settle(place, inverse, SAMPLES * len(pixels))
        return VisibleSamples(pick(sample, nearest), pick(triangle, nearest), pick(inverse, nearest))

    def _touch(self, pixels: Ints) -> NDArray[np.bool_]:
        """Which triangles may cover some of the pixels: those that reach into a block with such a pixel."""
        across, down = self.width // _BLOCK + 1, self.height // _BLOCK + 1
        row = pixels // np.int32(self.width)
        blocks = np.zeros((down + 1, across + 1), np.int32)
        blocks[row // _BLOCK + 1, (pixels - row * np.int32(self.width)) // _BLOCK + 1] = 1
        count = blocks.cumsum(0, dtype=np.int32).cumsum(1, dtype=np.int32).ravel()
        left, right, top, bottom = (
            np.minimum(np.maximum(side * np.float32(1 / _BLOCK), 0), most).astype(np.int32)
            for side, most in zip(self._box, (across - 1, across - 1, down - 1, down - 1), strict=True)
        )
        top, bottom = top * (across + 1), (bottom + 1) * (across + 1)
        right += 1
        touches: NDArray[np.bool_] = pick(count, bottom + right) - pick(count, bottom + left) > pick(count, top + right) - pick(
            count, top + left
        )
        return touches

    def _runs(self, fine: int, which: Indices | None = None, before: Ints | None = None) -> _Runs:
        """Cut triangles into runs of places, the farthest triangle first.

        Args:
            fine: rows and columns of places in a pixel: 2 for samples, 1 for middles.
            which: indices of the triangles in `number`; all where None.
            before: how many of the pixels to look up come before each one, and before the end; rows without one between the
                sides of the triangle are left out.
        """
        rows, edges = self._rows, self._edges
        if which is not None:
            rows, edges = pick(rows, which, axis=1), pick(edges, which, axis=1)
        ends = np.clip(np.ceil(rows * fine - np.float32(0.5)), 0, fine * self.height).astype(np.int32)
        count = np.stack([ends[1] - ends[0], ends[2] - ends[1]], 1).ravel()
        half, past = _spread(count)  # upper and lower halves of triangles
        row = np.arange(len(half)) + pick(ends[:2].T.ravel() - past, half)
        if before is not None:
            first, last = (np.clip(side, 0, self.width - 1).astype(np.intp) for side in self._box[:2])
            own, line = half >> 1, (row >> 1) * self.width
            if which is not None:
                first, last = pick(first, which), pick(last, which)
            some = np.flatnonzero(pick(before, line + pick(last + 1, own)) > pick(before, line + pick(first, own)))
            half, row = pick(half, some), pick(row, some)
        y = (row.astype(np.float32) + np.float32(0.5)) * np.float32(1 / fine)
        shift = np.float32(0.5) if fine == 1 else pick(_SHIFT, row & 1)
        sides = []
        for at_x, at_y, slope in edges.reshape(2, 3, -1):
            x = y - pick(at_y, half)
            x *= pick(slope, half)
            x += pick(at_x, half)
            x *= fine
            x -= shift
            np.ceil(x, out=x)
            sides.append(np.clip(x, 0, fine * self.width, out=x).astype(np.int32))  # faster than maximum, then minimum
        triangle = half >> 1
        start, stop = sides
        return _Runs(row, start, stop, triangle if which is None else pick(which, triangle))


def _ends(values: Floats) -> tuple[Floats, Floats]:
    """Least and greatest of the three rows; faster than reducing along an axis."""
    a, b, c = values
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _slope(xa: Floats, ya: Floats, xb: Floats, yb: Floats) -> Floats:
    """Change of x per row along the edge from a down to b; 0 where the edge is level, which no row crosses."""
    level = yb <= ya
    return np.where(level, 0, (xb - xa) / np.where(level, 1, yb - ya))


def _sort(values: Floats) -> Ints:
    """The order of positive numbers, the smallest first and equal ones in place; much faster than a stable `np.argsort`."""
    keys = np.ascontiguousarray(values).view(np.int32).astype(np.int64)
    keys <<= 32
    keys |= np.arange(len(keys))
    keys.sort()
    return (keys & 0x7FFFFFFF).astype(np.int32)


def _spread(length: Ints) -> tuple[Indices, Indices]:
    """For each place of runs of these lengths: the index of its run. And for each run: how many places lie before it."""
    index = np.repeat(np.arange(len(length)), length)
    return index, np.cumsum(length) - length


def _settle(place: Indices, inverse: Floats, size: int) -> Indices:
    """The entries with the greatest inverse depth at their place, ascending by place; there are ``size`` places."""
    number = np.arange(1, len(place) + 1, dtype=np.int32)
    owner = np.zeros(size, np.int32)
    owner[place] = number
    nearer = np.flatnonzero(inverse > pick(inverse, pick(owner, place) - 1))
    nearer = pick(nearer, _sort(pick(inverse, nearer)))  # of those that are nearer the nearest is the last to be written
    owner[pick(place, nearer)] = pick(number, nearer)
    return pick(owner, np.flatnonzero(owner != 0)).astype(np.intp) - 1
