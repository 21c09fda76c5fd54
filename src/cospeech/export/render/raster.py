"""Hidden-surface removal in numpy: which triangle is seen in the middle of each pixel, or at four samples of some pixels.

Triangles are cut into rows (scan conversion); every row becomes a run of places whose inverse depth is linear in x.
Places are then settled with a z-buffer that needs no loop over triangles: a scatter in back-to-front order, where the
last value written to a place stays, is right nearly everywhere; what is nearer than the one that stayed is scattered
again, until nothing is.

Samples lie two by two in a pixel, the lower pair shifted by a quarter of a pixel against the upper one, so that an upright
edge, the usual kind on a standing figure, is seen in four steps instead of two. A place belongs to a triangle if it lies
inside it or on its left or top edge. Two triangles with a common edge compute that edge from the same corners in the same
order, so every place along it belongs to one of them: there are no cracks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["SAMPLES", "Raster", "VisiblePixels", "VisibleSamples", "sample_positions"]

Floats = NDArray[np.float32]
Ints = NDArray[np.integer]
Indices = NDArray[np.intp]  # what numpy indexes with fastest
Keeps = Callable[[Indices, Indices], NDArray[np.bool_]]

SAMPLES = 4  # per pixel
_SHIFT = np.array([0.25, 0.75], np.float32)  # where a sample lies in its half pixel, in rows above and below; ours
# corners of a triangle from top to bottom, by 1 · (1 is above 0) + 2 · (2 is above 1) + 4 · (2 is above 0); 3 and 4 cannot be
_ORDERS = np.array([(0, 1, 2), (1, 0, 2), (0, 2, 1), (2, 1, 0), (0, 1, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]).T.copy()
_BLOCK = 2  # pixels along a side of the blocks in which it is looked which triangles matter; ours
_SLIVER = 1e-3  # samples²; ours: below half this area a triangle's depth is taken as constant


class VisibleSamples(NamedTuple):
    """What is visible, one entry per covered sample, sorted by pixel.

    Attributes:
        sample: (N,) ``4 · pixel + k``, ascending; pixel = ``row · width + column``, k as in `sample_positions`.
        triangle: (N,) index of the nearest triangle.
        inverse: (N,) its inverse depth there, 1 / metres.
    """

    sample: Indices
    triangle: Indices
    inverse: Floats


class VisiblePixels(NamedTuple):
    """What is visible in the middles of pixels, one entry per covered pixel.

    Attributes:
        pixel: (N,) ``row · width + column``, each once.
        triangle: (N,) index of the nearest triangle.
        inverse: (N,) its inverse depth there, 1 / metres.
        x: (N,) the middle, pixels.
        y: (N,)
    """

    pixel: Indices
    triangle: Indices
    inverse: Floats
    x: Floats
    y: Floats


class _Runs(NamedTuple):
    """Parts of triangles that lie in one row of places: row, first column, the column after the last, triangle.

    Inverse depth is ``inverse + column · step``.
    """

    row: Indices
    start: Ints
    stop: Ints
    inverse: Floats
    step: Floats
    triangle: Indices


def sample_positions(sample: Ints, width: int) -> tuple[Floats, Floats]:
    """x and y in pixels of samples of a picture ``width`` pixels wide."""
    pixel, k = sample >> 2, sample & 3
    row = pixel // np.int32(width)
    lower = k >> 1
    column = (pixel - row * np.int32(width)).astype(np.float32)
    x = column + ((k & 1).astype(np.float32) + _SHIFT[lower]) * np.float32(0.5)
    return x, row.astype(np.float32) + (lower.astype(np.float32) + np.float32(0.5)) * np.float32(0.5)


class Raster:
    """Triangles before a picture.

    Args:
        screen: (V, 3) x and y in pixels, y down, and inverse depth, ≤ 0 for a vertex behind the camera.
        corners: (3, F) vertices of triangles.
        width: of the picture, pixels.
        height: of the picture, pixels.
        side: which face is drawn: 1 the one whose corners are counter-clockwise as seen, −1 the other, 0 both.

    Triangles partly outside the picture are clipped to it; those with a corner behind the camera are left out. At equal depth
    the same triangle wins on every run.
    """

    def __init__(self, screen: Floats, corners: Indices, width: int, height: int, side: int = 0) -> None:
        self.width, self.height = width, height
        x, y, w = np.ascontiguousarray(screen.T, np.float32).take(corners, axis=1)
        (left, right), (top, bottom) = _ends(x), _ends(y)
        inside = (right >= 0) & (left <= width) & (bottom >= 0) & (top <= height) & (w[0] > 0) & (w[1] > 0) & (w[2] > 0)
        if side:
            turn = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
            inside &= turn < 0 if side > 0 else turn > 0
        kept = np.flatnonzero(inside)
        self._number: Indices = kept.take(_sort(w[0].take(kept)))  # of each triangle; the farthest comes first
        self._box = [end.take(self._number) for end in (left, right, top, bottom)]
        order = ((y[1] < y[0]) + 2 * (y[2] < y[1]) + 4 * (y[2] < y[0])).take(self._number)
        order = _ORDERS.take(order, axis=1)  # a the top corner, c the bottom one
        order *= corners.shape[1]
        order += self._number
        (x0, x1, x2), (y0, y1, y2), (w0, w1, w2) = (values.ravel().take(order) for values in (x, y, w))
        turn = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)  # > 0: the middle corner lies right of the long edge
        flat = np.abs(turn) < _SLIVER
        per_area = np.where(flat, 0, 1 / np.where(flat, 1, turn))
        step_x = ((w1 - w0) * (y2 - y0) - (w2 - w0) * (y1 - y0)) * per_area
        step_y = ((w2 - w0) * (x1 - x0) - (w1 - w0) * (x2 - x0)) * per_area
        self._plane = np.stack([w0 - x0 * step_x - y0 * step_y, step_x, step_y])
        long, upper, lower = _slope(x0, y0, x2, y2), _slope(x0, y0, x1, y1), _slope(x1, y1, x2, y2)
        bent = turn > 0
        self._rows = np.stack([y0, y1, y2])
        # the edges on the left and on the right as (point on it, change of x per row), above and below the middle corner
        self._edges = np.empty((6, len(turn), 2), np.float32)
        self._edges[:, :, 0] = x0, y0, np.where(bent, long, upper), x0, y0, np.where(bent, upper, long)
        self._edges[:3, :, 1] = np.where(bent, (x0, y0, long), (x1, y1, lower))
        self._edges[3:, :, 1] = np.where(bent, (x1, y1, lower), (x0, y0, long))

    def see_middles(self, asked: NDArray[np.bool_] | None = None) -> VisiblePixels:
        """Find the nearest triangle in the middle of every pixel; of those ``asked`` (F,) for, all where None."""
        which = None if asked is None else np.flatnonzero(asked.take(self._number))
        runs = self._runs(1, which)
        run, before = _spread(runs.stop - runs.start)
        column = np.arange(len(run)) + (runs.start - before).take(run)
        x = column.astype(np.float32)
        inverse = x * runs.step.take(run)
        inverse += runs.inverse.take(run)
        column += (runs.row * self.width).take(run)
        owner, number = _settle(column, inverse, self.width * self.height)
        seen = np.flatnonzero(owner.take(column) == number)
        run = run.take(seen)
        y = (runs.row.astype(np.float32) + np.float32(0.5)).take(run)
        middle = x.take(seen) + np.float32(0.5), y
        return VisiblePixels(column.take(seen), runs.triangle.take(run), inverse.take(seen), *middle)

    def see(self, pixels: Ints, keeps: Keeps | None = None) -> VisibleSamples:
        """Find the nearest triangle at every sample of pixels.

        Args:
            pixels: (P,) ascending, where to look.
            keeps: tells of samples (N,) and the triangles (N,) that cover them which are no holes; None where there are none.
        """
        runs = self._runs(2, np.flatnonzero(self._touch(pixels)))
        # how many of the pixels come before each one of the picture, and before the end
        counts = np.diff(pixels, prepend=-1, append=self.width * self.height)
        before = np.repeat(np.arange(len(pixels) + 1, dtype=np.int32), counts)
        columns = (2 * (pixels % np.int32(self.width))).astype(np.float32)
        row = (runs.row >> 1) * np.int32(self.width)
        places, inverses, triangles = [], [], []
        for k in range(2):  # the left and the right samples of pixels
            first = before.take(row + (runs.start + (1 - k) >> 1))
            length = before.take(row + (runs.stop + (1 - k) >> 1)) - first
            kept = np.flatnonzero(length > 0)
            first, length = first.take(kept), length.take(kept)
            of, past = _spread(length)
            number, run = np.arange(len(of)) + (first - past).take(of), kept.take(of)
            inverses.append((columns.take(number) + k) * runs.step.take(run) + runs.inverse.take(run))
            places.append(4 * number + (2 * (runs.row & 1) + k).take(run))
            triangles.append(runs.triangle.take(run))
        place, inverse, triangle = (np.concatenate(both) for both in (places, inverses, triangles))
        if keeps is not None:
            kept = np.flatnonzero(keeps(4 * pixels.take(place >> 2) + (place & 3), triangle))
            place, inverse, triangle = place[kept], inverse[kept], triangle[kept]
        owner, _ = _settle(place, inverse, SAMPLES * len(pixels))
        place = np.flatnonzero(owner)
        seen = owner.take(place) - 1
        return VisibleSamples(4 * pixels.take(place >> 2) + (place & 3), triangle.take(seen), inverse.take(seen))

    def _touch(self, pixels: Ints) -> NDArray[np.bool_]:
        """Which triangles may cover some of the pixels: those with one in the blocks that they reach into."""
        across, down = self.width // _BLOCK + 1, self.height // _BLOCK + 1
        row = pixels // np.int32(self.width)
        asked = np.zeros((down + 1, across + 1), np.int32)
        asked[row // _BLOCK + 1, (pixels - row * np.int32(self.width)) // _BLOCK + 1] = 1
        count = asked.cumsum(0, dtype=np.int32).cumsum(1, dtype=np.int32).ravel()
        left, right, top, bottom = (
            np.minimum(np.maximum(side * np.float32(1 / _BLOCK), 0), most).astype(np.int32)
            for side, most in zip(self._box, (across - 1, across - 1, down - 1, down - 1), strict=True)
        )
        top, bottom = top * (across + 1), (bottom + 1) * (across + 1)
        right += 1
        found: NDArray[np.bool_] = count.take(bottom + right) - count.take(bottom + left) > count.take(
            top + right
        ) - count.take(top + left)
        return found

    def _runs(self, fine: int, which: Indices | None = None) -> _Runs:
        """Cut triangles into runs of places, the farthest triangle first.

        Args:
            fine: rows and columns of places in a pixel: 2 for samples, 1 for middles.
            which: numbers of the triangles in this object; all where None.
        """
        shifts = _SHIFT if fine == 2 else np.full(2, 0.5, np.float32)
        rows, edges, plane, number = self._rows, self._edges, self._plane, self._number
        if which is not None:
            rows, edges, plane = rows.take(which, axis=1), edges.take(which, axis=1), plane.take(which, axis=1)
            number = number.take(which)
        ends = np.clip(np.ceil(rows * fine - np.float32(0.5)), 0, fine * self.height).astype(np.int32)
        count = np.stack([ends[1] - ends[0], ends[2] - ends[1]], 1).ravel()
        half, before = _spread(count)  # upper and lower halves of triangles
        row = np.arange(len(half)) + (ends[:2].T.ravel() - before).take(half)
        one, shift = np.float32(1 / fine), shifts.take(row & 1)
        y = (row.astype(np.float32) + np.float32(0.5)) * one
        sides = []
        for at_x, at_y, slope in edges.reshape(2, 3, -1):
            x = y - at_y.take(half)
            x *= slope.take(half)
            x += at_x.take(half)
            x *= fine
            x -= shift
            np.ceil(x, out=x)
            np.maximum(x, 0, out=x)
            sides.append(np.minimum(x, fine * self.width, out=x).astype(np.int32))
        start, stop = sides
        keep = np.flatnonzero(stop > start)
        triangle, row, y = half.take(keep) >> 1, row.take(keep), y.take(keep)
        inverse, step, down = (values.take(triangle) for values in plane)
        step *= one
        inverse += y * down
        inverse += shift.take(keep) * step
        return _Runs(row, start.take(keep), stop.take(keep), inverse, step, number.take(triangle))


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
    """For each of as many places as ``length`` says: the index of its length, and how many places lie before those."""
    index = np.repeat(np.arange(len(length)), length)
    return index, np.cumsum(length) - length


def _settle(place: Indices, inverse: Floats, size: int) -> tuple[Ints, Ints]:
    """Which entry has the greatest inverse depth at each of ``size`` places.

    Returns:
        (size,) its number, 0 for none; the numbers of the entries, which count from 1.
    """
    number = np.arange(1, len(place) + 1, dtype=np.int32)
    owner = np.zeros(size, np.int32)
    owner[place] = number
    nearer = np.flatnonzero(inverse > inverse.take(owner.take(place) - 1))
    while len(nearer):
        nearer = nearer.take(_sort(inverse.take(nearer)))
        at = place.take(nearer)
        owner[at] = number.take(nearer)
        nearer = nearer[inverse.take(nearer) > inverse.take(owner.take(at) - 1)]
    return owner, number
