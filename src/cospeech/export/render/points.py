"""Find the points of a character that a picture shows: one for a pixel inside a smooth piece of surface, up to four at edges.

First, the middles of all pixels are looked up (`Raster.see_middles`). A sample of a pixel lies between four middles. Where
these show one smooth piece of surface, or nothing, so does the sample. Else the four samples of the pixel are looked up
(`Raster.see`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .raster import SAMPLES, Floats, Indices, Ints, Keeps, Raster, VisiblePixels, VisibleSamples, chunks, pick

__all__ = ["ShownPoints", "find_points"]

Bools = NDArray[np.bool_]

_DEEP = 0.012  # metres of depth between neighbours, above which there is an outline; ours: half a finger
_MILLIMETRES = np.float32(1000)  # per metre: units of depth in which neighbours are compared
_FARTHEST = np.int32(0xFFFF)  # depth in such units beyond which all is far


class ShownPoints(NamedTuple):
    """The points to shade. Triangles are indices in `Raster.number`.

    Attributes:
        whole: (A,) pixels that show one smooth piece of surface.
        triangle: (A,) triangles that are seen there.
        edge: (B,) pixels at an outline or at a border between two parts.
        coverage: (B,) 1 … 4, how many of their samples show the character.
        sample: (N,) these samples, numbered as in `raster.VisibleSamples`.
        sample_triangle: (N,) triangles that are seen there.
    """

    whole: Indices
    triangle: Indices
    edge: Indices
    coverage: Indices
    sample: Indices
    sample_triangle: Indices


def find_points(raster: Raster, part: Ints, fine: Bools, holes: Bools | None = None, keeps: Keeps | None = None) -> ShownPoints:
    """Find what a picture shows.

    Args:
        raster: K triangles.
        part: (K,) the surface of each.
        fine: (K,) which triangles have details that are smaller than a pixel: all their pixels are sampled.
        holes: (K,) which triangles may have holes; None where none has.
        keeps: as `Raster.see` takes it.
    """
    width = raster.width
    middles = raster.see_middles(None if holes is None else ~holes)
    veils = None if holes is None else raster.see_middles(holes)
    edges = _edges(middles, part, fine, veils, (raster.height, width))
    visible = raster.see(edges, keeps)
    smooth, first, count = _group(visible, part, fine)
    pixel = pick(visible.sample, first) >> 2
    # a smooth pixel shows its middle; if a surface with holes hides that, it shows one of its samples
    show = np.ones(width * raster.height, bool)
    show[edges] = False
    show[pixel[smooth]] = True
    if holes is not None:
        is_veiled = smooth & pick(holes, pick(visible.triangle, first))
        show[pixel[is_veiled]] = False
    indices = np.flatnonzero(pick(show, middles.pixel))
    whole, triangle = pick(middles.pixel, indices), pick(middles.triangle, indices)
    if holes is not None:
        whole = np.concatenate([whole, pixel[is_veiled]])
        triangle = np.concatenate([triangle, pick(visible.triangle, first[is_veiled])])
    at_edges = np.flatnonzero(np.repeat(~smooth, count))
    samples = pick(visible.sample, at_edges), pick(visible.triangle, at_edges)
    return ShownPoints(whole, triangle, pixel[~smooth], count[~smooth], *samples)


def _edges(middles: VisiblePixels, part: Ints, fine: Bools, veils: VisiblePixels | None, shape: tuple[int, int]) -> Indices:
    """Pixels, ascending, with samples between middles that do not show one smooth piece of closed surface."""
    labels, edge = (np.zeros(shape[0] * shape[1], kind) for kind in (np.int32, bool))
    surface = (part + 2) * (_FARTHEST + 1)
    for some in chunks(len(middles.pixel)):
        pixel, triangle = middles.pixel[some], middles.triangle[some]
        labels[pixel] = _label(middles.inverse[some], pick(surface, triangle))
        edge[pick(pixel, np.flatnonzero(pick(fine, triangle)))] = True
    if veils is not None:
        behind, before = pick(labels, veils.pixel), _label(veils.inverse, 0)
        nearer = np.flatnonzero((behind == 0) | (before <= (behind & _FARTHEST)))
        pixel = pick(veils.pixel, nearer)
        labels[pixel] = _FARTHEST + 1 + pick(before, nearer)
        edge[pixel] = True
    for step in (1, shape[1]):  # all rows in one: the end of each is compared with the next row, which may add pixels
        differ = _differ(labels[step:], labels[:-step])
        edge[step:] |= differ
        edge[:-step] |= differ
    return np.flatnonzero(edge)


def _label(inverse: Floats, surface: Ints | int) -> Ints:
    """Depth (N,) in millimetres, plus the number of the visible surface as a multiple of 65,536."""
    depth = np.clip(_MILLIMETRES / inverse, 0, _FARTHEST).astype(np.int32)  # faster than `np.minimum`
    depth += surface
    return depth


def _differ(labels: Ints, beside: Ints) -> Bools:
    """Which pairs of neighbours show two surfaces or two depths."""
    deep = int(_DEEP * _MILLIMETRES)
    off = labels - beside
    off += deep
    return off.view(np.uint32) > 2 * deep  # one comparison for both signs, and for surfaces, which are farther apart


def _group(visible: VisibleSamples, part: Ints, fine: Bools) -> tuple[Bools, Indices, Indices]:
    """For each pixel: whether all four samples show one smooth piece of surface; its first sample; how many it has."""
    pixel = visible.sample >> 2
    first = np.flatnonzero(np.diff(pixel, prepend=-1))
    count = np.diff(first, append=len(pixel))
    smooth = (count == SAMPLES) & ~pick(fine, pick(visible.triangle, first))
    four = first[smooth]
    inverse, parts = (
        [pick(values, four + k) for k in range(SAMPLES)] for values in (visible.inverse, pick(part, visible.triangle))
    )
    near, far = (side(side(inverse[0], inverse[1]), side(inverse[2], inverse[3])) for side in (np.maximum, np.minimum))
    same = (parts[0] == parts[1]) & (parts[0] == parts[2]) & (parts[0] == parts[3])
    smooth[smooth] = (near - far < _DEEP * near * far) & same
    return smooth, first, count
