"""Which points of a character a picture shows: one for each pixel inside a smooth piece of surface, up to four at edges.

The middles of all pixels are looked at first (`Raster.see_middles`). A sample of a pixel lies between four middles. Where these
show one smooth piece of surface, or nothing, so does the sample; where they do not, the four samples of the pixel are looked
at (`Raster.see`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .raster import SAMPLES, Floats, Indices, Ints, Keeps, Raster, VisiblePixels, VisibleSamples, chunks, pick

__all__ = ["ShownPoints", "find_points"]

Bools = NDArray[np.bool_]

_DEEP = 0.012  # metres of depth between neighbours above which they show an outline; ours: half a finger
_MILLIMETRES = np.float32(1000)  # units of depth in which neighbours are compared
_FARTHEST = np.int32(0xFFFF)  # depth in such units beyond which all is far


class ShownPoints(NamedTuple):
    """What there is to shade. Triangles are indices in `Raster.number`.

    Attributes:
        whole: (A,) pixels that show one smooth piece of surface.
        triangle: (A,) that is seen there.
        mixed: (B,) pixels at an outline or at a border of two parts.
        covered: (B,) 1 … 4, how many of their samples show the character.
        sample: (N,) these samples, as `raster.VisibleSamples` counts them.
        sampled: (N,) triangles that are seen there.
    """

    whole: Indices
    triangle: Indices
    mixed: Indices
    covered: Indices
    sample: Indices
    sampled: Indices


def find_points(drawn: Raster, part: Ints, fine: Bools, holes: Bools | None = None, keeps: Keeps | None = None) -> ShownPoints:
    """Find what a picture shows.

    Args:
        drawn: K triangles.
        part: (K,) to which surface each belongs.
        fine: (K,) which triangles have details that are smaller than a pixel: these are mixed everywhere.
        holes: (K,) which triangles may have holes; None where none has.
        keeps: as `Raster.see` takes it.
    """
    width = drawn.width
    middles = drawn.see_middles(None if holes is None else ~holes)
    veils = None if holes is None else drawn.see_middles(holes)
    edges = _edges(middles, part, fine, veils, (drawn.height, width))
    seen = drawn.see(edges, keeps)
    smooth, first, count = _group(seen, part, fine)
    pixel = pick(seen.sample, first) >> 2
    # a middle is what a smooth pixel shows, unless a surface with holes hides it; then one of its samples is
    show = np.ones(width * drawn.height, bool)
    show[edges] = False
    show[pixel[smooth]] = True
    if holes is not None:
        veiled = smooth & pick(holes, pick(seen.triangle, first))
        show[pixel[veiled]] = False
    kept = np.flatnonzero(pick(show, middles.pixel))
    whole, triangle = pick(middles.pixel, kept), pick(middles.triangle, kept)
    if holes is not None:
        whole = np.concatenate([whole, pixel[veiled]])
        triangle = np.concatenate([triangle, pick(seen.triangle, first[veiled])])
    picked = np.flatnonzero(np.repeat(~smooth, count))
    samples = pick(seen.sample, picked), pick(seen.triangle, picked)
    return ShownPoints(whole, triangle, pixel[~smooth], count[~smooth], *samples)


def _edges(middles: VisiblePixels, part: Ints, fine: Bools, veils: VisiblePixels | None, shape: tuple[int, int]) -> Indices:
    """Pixels, ascending, some of whose samples lie between middles that do not show one smooth piece of closed surface."""
    shown, edge = (np.zeros(shape[0] * shape[1], kind) for kind in (np.int32, bool))
    surface = (part + 2) * (_FARTHEST + 1)
    for some in chunks(len(middles.pixel)):
        pixel, triangle = middles.pixel[some], middles.triangle[some]
        shown[pixel] = _label(middles.inverse[some], pick(surface, triangle))
        edge[pick(pixel, np.flatnonzero(pick(fine, triangle)))] = True
    if veils is not None:
        behind, before = pick(shown, veils.pixel), _label(veils.inverse, 0)
        nearer = np.flatnonzero((behind == 0) | (before <= (behind & _FARTHEST)))
        pixel = pick(veils.pixel, nearer)
        shown[pixel] = _FARTHEST + 1 + pick(before, nearer)
        edge[pixel] = True
    for step in (1, shape[1]):  # all rows in one, so that the end of each borders on the next: there, too much may be asked
        differ = _differ(shown[step:], shown[:-step])
        edge[step:] |= differ
        edge[:-step] |= differ
    return np.flatnonzero(edge)


def _label(inverse: Floats, surface: Ints | int) -> Ints:
    """Depth (N,) in millimetres, and with it the surface that is seen, a multiple of 65,536."""
    depth = np.clip(_MILLIMETRES / inverse, 0, _FARTHEST).astype(np.int32)  # faster than `np.minimum`
    depth += surface
    return depth


def _differ(shown: Ints, beside: Ints) -> Bools:
    """Which neighbours show two surfaces or two depths."""
    deep = int(_DEEP * _MILLIMETRES)
    off = shown - beside
    off += deep
    return off.view(np.uint32) > 2 * deep  # one comparison for both signs, and for surfaces, which are farther apart


def _group(seen: VisibleSamples, part: Ints, fine: Bools) -> tuple[Bools, Indices, Indices]:
    """By pixel: whether all four samples show one smooth piece of surface; the first of its samples; how many it has."""
    pixel = seen.sample >> 2
    first = np.flatnonzero(np.diff(pixel, prepend=-1))
    count = np.diff(first, append=len(pixel))
    smooth = (count == SAMPLES) & ~pick(fine, pick(seen.triangle, first))
    four = first[smooth]
    inverse, parts = ([pick(values, four + k) for k in range(SAMPLES)] for values in (seen.inverse, pick(part, seen.triangle)))
    near, far = (side(side(inverse[0], inverse[1]), side(inverse[2], inverse[3])) for side in (np.maximum, np.minimum))
    same = (parts[0] == parts[1]) & (parts[0] == parts[2]) & (parts[0] == parts[3])
    smooth[smooth] = (near - far < _DEEP * near * far) & same
    return smooth, first, count
