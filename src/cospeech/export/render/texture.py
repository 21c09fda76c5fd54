"""Look up the textures of a character at points of triangles, at the sharpness that the picture can show.

All textures lie one after another in one array, each with smaller and smaller copies of itself (a mip pyramid, Williams 1983).
A triangle uses the copy whose pixels are about as large as the picture's, so that nothing flickers. Every copy has a border of
one pixel, with the values beyond the edge: so the four pixels around a point are always neighbours.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..mannequin import Character
from ..surface import Texture
from .light import from_srgb
from .planes import Slopes
from .raster import Floats, Indices, Ints, evaluate, pick

__all__ = ["LaidTextures", "SurfaceTable"]

# Linear red, green and blue of a pixel lie in one number of 64 bits, 21 bits each, so that one multiplication weighs all three:
# 13 bits of light, finer than 8 bits of sRGB where these are finest, times weights of which four make 256.
_LANE, _SHARES = 21, 8
_MOST_LIGHT = (1 << _LANE - _SHARES) - 1
_LINEAR = np.round(from_srgb(np.arange(256) / 255) * _MOST_LIGHT).astype(np.int64)
_FARTHEST = 1e4  # ours: no texture is repeated so often; damaged files have coordinates beyond
_STEPS = np.array([0.125, 0.625, 0.875, 0.375], np.float32)  # opacities above which the samples of a pixel show the surface
_FOLDS = {"repeat": 0, "mirror": 1, "clamp": 2}


class SurfaceTable:
    """The surfaces of all parts of a character, by triangle and by vertex.

    Args:
        character: its parts in their order.

    Attributes:
        has_texture: (F,) whether a triangle has a texture.
        open: (F,) whether a triangle may have holes.
    """

    def __init__(self, character: Character) -> None:
        counts = [len(part.triangles) for part in character.parts]
        surfaces = [part.surface for part in character.parts]
        kinds: dict[int, int] = {}
        textures: list[Texture] = []
        number = []
        for surface in surfaces:
            if surface is None or surface.texture is None:
                number.append(-1)
                continue
            if id(surface.texture) not in kinds:
                kinds[id(surface.texture)] = len(textures)
                textures.append(surface.texture)
            number.append(kinds[id(surface.texture)])
        self._texture = np.repeat(np.array(number, np.int32), counts)
        self.has_texture = self._texture >= 0
        cutoffs = [0.0 if s is None else np.nan if s.cutoff is None else s.cutoff for s in surfaces]
        self._cutoff = np.repeat(np.array(cutoffs, np.float32), counts)
        self.open = self._cutoff != 0
        rows = list(zip(surfaces, character.parts, strict=True))
        places = np.concatenate([np.zeros((len(p.vertices), 2)) if s is None else s.places for s, p in rows])
        places = np.clip(np.nan_to_num(places), -_FARTHEST, _FARTHEST)
        self._places = np.ascontiguousarray(places.T, np.float32)
        opacity = [np.ones(len(p.vertices)) if s is None else s.opacity for s, p in rows]
        self._opacity = np.concatenate(opacity).astype(np.float32)
        self._measure(textures)

    def _measure(self, textures: list[Texture]) -> None:
        """Find the place of each copy of each texture; `_fill` computes a copy when it is needed."""
        self._pictures: list[tuple[Texture, tuple[int, int]]] = []
        self._levels: list[tuple[int, int]] = []
        for texture in textures:
            first, (height, width) = len(self._pictures), texture.pixels.shape[:2]
            self._pictures.append((texture, (width, height)))
            while max(width, height) > 1:
                width, height = max(1, width // 2), max(1, height // 2)
                self._pictures.append((texture, (width, height)))
            self._levels.append((first, len(self._pictures) - first))
        sizes = np.array([size for _, size in self._pictures], np.int64).reshape(-1, 2)
        counts = (sizes + 2).prod(1)
        # width, height, first pixel, pixels per row: in one table, for one lookup
        self._tables = np.column_stack([sizes, np.cumsum(counts) - counts, sizes[:, 0] + 2]).astype(np.int32)
        self._folds = np.array([[_FOLDS[axis] for axis in texture.wrap] for texture in textures]).reshape(-1, 2)
        self._ready = np.zeros(len(counts), bool)
        # memory that is not written to takes no room (the system gives zeros)
        self._texels, self._alphas = np.zeros(counts.sum(), np.int64), np.zeros(counts.sum(), np.uint8)

    def _fill(self, level: int) -> None:
        texture, size = self._pictures[level]
        picture = Image.fromarray(texture.pixels)
        if picture.size != size:
            picture = picture.resize(size, Image.Resampling.BOX)
        across, down = ("wrap" if axis == "repeat" else "edge" for axis in texture.wrap)
        pixels = np.pad(np.asarray(picture), ((0, 0), (1, 1), (0, 0)), mode=across)  # type: ignore[call-overload]
        pixels = np.pad(pixels, ((1, 1), (0, 0), (0, 0)), mode=down)  # type: ignore[call-overload]
        red, green, blue, alpha = pixels.reshape(-1, 4).T
        start = int(self._tables[level, 2])
        self._texels[start : start + len(red)] = _LINEAR[red] << 2 * _LANE | _LINEAR[green] << _LANE | _LINEAR[blue]
        self._alphas[start : start + len(red)] = alpha
        self._ready[level] = True

    def lay(self, screen: Floats, slopes: Slopes, corners: Indices, number: Indices) -> LaidTextures:
        """Lay the textures on triangles in this picture.

        Args:
            screen: (V, 3) as `raster.Raster` takes it.
            slopes: of the triangles.
            corners: (3, K) their vertices.
            number: (K,) their numbers among all triangles.
        """
        return LaidTextures(self, screen, slopes, corners, number)


class LaidTextures:
    """The textures on K triangles in one picture, as `SurfaceTable.lay` makes them."""

    def __init__(self, table: SurfaceTable, screen: Floats, slopes: Slopes, corners: Indices, number: Indices) -> None:
        self._table, self._screen, self._slopes = table, screen, slopes
        self._texture, self._cutoff = pick(table._texture, number), pick(table._cutoff, number)
        self.has_texture = self._texture >= 0
        self.open = self._cutoff != 0
        self._levels = self._find_levels(corners)
        for level in np.unique(self._levels[self._levels >= 0]).tolist():
            if not table._ready[level]:
                table._fill(level)

    def _find_levels(self, corners: Indices) -> Ints:
        """(K,) which copy of which texture each triangle uses, −1 for none."""
        table, levels = self._table, np.full(len(self._texture), -1, np.int32)
        which = np.flatnonzero(self.has_texture)
        if not len(which):
            return levels
        corner, number = pick(corners, which, 1), self._texture[which]
        first, count = np.array(table._levels, np.int32)[number].T
        texels = _areas(*pick(table._places, corner, 1)) * table._tables[first, :2].astype(np.float32).prod(1)
        pixels = _areas(*pick(np.ascontiguousarray(self._screen[:, :2].T), corner, 1))
        level = np.round(0.5 * np.log2(np.maximum(texels, 1e-9) / np.maximum(pixels, 1e-6)))
        levels[which] = first + np.clip(level, 0, count - 1).astype(np.int32)
        return levels

    @cached_property
    def _planes(self) -> Floats:
        """Planes of inverse depth, and of texture coordinates times inverse depth: these are linear in the picture."""
        inverse = np.ascontiguousarray(self._screen[:, 2])
        return self._slopes.planes(np.stack([inverse, *(self._table._places * inverse)]))

    def look(self, triangle: Indices, x: Floats, y: Floats) -> Floats:
        """Linear RGB (3, N) of textures at places, in pixels, on triangles (N,) that have a texture."""
        table, total = self._table, np.zeros(len(triangle), np.int64)
        for place, share in self._find_texels(triangle, x, y):
            texel = pick(table._texels, place)
            texel *= share
            total += texel
        rgb = np.empty((3, len(triangle)), np.float32)
        for row, shift in zip(rgb, (2 * _LANE, _LANE, 0), strict=True):
            row[:] = total >> shift & (1 << _LANE) - 1
            row *= np.float32(1 / (_MOST_LIGHT << _SHARES))
        return rgb

    def opacity(self, triangle: Indices, x: Floats, y: Floats) -> Floats:
        """(N,) opacity of the vertices times that of the textures."""
        opacity = evaluate(self._opacities, triangle, x, y)[0]
        has = np.flatnonzero(pick(self.has_texture, triangle))
        if len(has):
            alpha = np.zeros(len(has), np.int64)
            for place, share in self._find_texels(pick(triangle, has), pick(x, has), pick(y, has)):
                alpha += pick(self._table._alphas, place) * share
            opacity[has] *= alpha.astype(np.float32) * np.float32(1 / (255 << _SHARES))
        return opacity

    @cached_property
    def _opacities(self) -> Floats:
        return self._slopes.planes(self._table._opacity[None])

    def _find_texels(self, triangle: Indices, x: Floats, y: Floats) -> list[tuple[Indices, Ints]]:
        """The four nearest pixels of a texture, and their shares, whose sum is 256."""
        inverse, u, v = evaluate(self._planes, triangle, x, y)
        inverse = np.maximum(inverse, np.float32(1e-6))  # beside a triangle in steep perspective it may be 0
        width, height, start, across = pick(pick(self._table._tables, self._levels, 0), triangle, 0).T
        number = pick(self._texture, triangle)
        columns, rows = (
            (_fold(at / inverse, fold, number) * size + np.float32(0.5)) * np.float32(1 << _SHARES)
            for at, fold, size in zip((u, v), self._table._folds.T, (width, height), strict=True)
        )
        column, row = columns.astype(np.int64), rows.astype(np.int64)
        right, lower = column & (1 << _SHARES) - 1, row & (1 << _SHARES) - 1
        both = right * lower >> _SHARES
        first = (row >> _SHARES) * across + (column >> _SHARES) + start
        below = first + across
        return [
            (first, (1 << _SHARES) - right - lower + both), (first + 1, right - both),
            (below, lower - both), (below + 1, both),
        ]  # fmt: skip

    def shows_surface(self, triangle: Ints, sample: Ints, opacity: Floats) -> NDArray[np.bool_]:
        """Whether each sample (N,) of a picture shows the surface, which has this opacity there, or what lies behind it."""
        cutoff = pick(self._cutoff, triangle)
        return np.where(np.isnan(cutoff), opacity > pick(_STEPS, sample & 3), opacity >= cutoff)


def _areas(x: Floats, y: Floats) -> Floats:
    """(F,) areas of triangles with corners (3, F)."""
    return np.abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])) / 2


def _fold(at: Floats, folds: Ints, number: Ints) -> Floats:
    """Bring texture coordinates (N,) into 0 … 1: repeated, mirrored or clamped, as the textures (N,) say."""
    result: Floats = at - np.floor(at)
    if folds.any():
        fold = pick(folds, number)
        mirror, clamp = np.flatnonzero(fold == 1), np.flatnonzero(fold == 2)
        result[mirror] = 1 - np.abs(np.mod(at[mirror], 2) - 1)
        result[clamp] = np.clip(at[clamp], 0, 1)
    return result
