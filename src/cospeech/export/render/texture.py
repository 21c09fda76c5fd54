"""Textures on the parts of a character: looked up at points of triangles, at the sharpness that the picture can show.

All textures lie one after another in one array, each with smaller and smaller copies of itself (a mip pyramid, Williams
1983). A triangle uses the copy whose pixels are about as large as the picture's, so that nothing flickers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..mannequin import Character
from ..surface import Texture
from .light import from_srgb
from .raster import Floats, Ints

__all__ = ["Looked", "SurfaceTable"]

_LINEAR = from_srgb(np.arange(256) / 255).astype(np.float32)
_STEPS = np.array([0.125, 0.625, 0.875, 0.375], np.float32)  # opacity above which each sample of a pixel shows the surface
_FOLDS = {"repeat": 0, "mirror": 1, "clamp": 2}


class Looked(NamedTuple):
    """What textures say at points: linear RGB (3, N) and opacity (N,)."""

    colour: Floats
    opacity: Floats


class SurfaceTable:
    """The surfaces of all parts of a character, by triangle and by vertex.

    Args:
        character: its parts in their order.

    Attributes:
        textured: (F,) whether a triangle has a texture.
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
        self.textured = self._texture >= 0
        cutoffs = [0.0 if s is None else np.nan if s.cutoff is None else s.cutoff for s in surfaces]
        self._cutoff = np.repeat(np.array(cutoffs, np.float32), counts)
        self.open = self._cutoff != 0
        rows = list(zip(surfaces, character.parts, strict=True))
        self._places = np.concatenate([np.zeros((len(p.vertices), 2)) if s is None else s.places for s, p in rows])
        self._places = np.ascontiguousarray(self._places.T, np.float32)
        self._opacity = np.concatenate([np.ones(len(p.vertices)) if s is None else s.opacity for s, p in rows]).astype(
            np.float32
        )
        self._pyramids(textures)

    def _pyramids(self, textures: list[Texture]) -> None:
        texels: list[NDArray[np.uint8]] = []
        starts: list[int] = []
        sizes: list[tuple[int, int]] = []
        self._levels: list[tuple[int, int]] = []
        start = 0
        for texture in textures:
            picture = Image.fromarray(texture.pixels)
            first = len(starts)
            while True:
                level = np.asarray(picture)
                texels.append(level.reshape(-1, 4))
                starts.append(start)
                sizes.append((picture.width, picture.height))
                start += len(texels[-1])
                if max(picture.size) == 1:
                    break
                picture = picture.resize((max(1, picture.width // 2), max(1, picture.height // 2)), Image.Resampling.BOX)
            self._levels.append((first, len(starts) - first))
        # four bytes in one number, which is looked up once
        self._texels = np.concatenate([*texels, np.zeros((1, 4), np.uint8)]).view("<u4").ravel().astype(np.uint32)
        self._start, self._size = np.array(starts, np.int64), np.array(sizes, np.int32).reshape(-1, 2)
        self._fold = np.array([[_FOLDS[axis] for axis in texture.wrap] for texture in textures]).reshape(-1, 2)

    def levels(self, screen: Floats, corners: NDArray[np.intp]) -> Ints:
        """(F,) which level of which texture each triangle uses in this picture, −1 for none.

        Args:
            screen: (V, 3) as `raster.see` takes it.
            corners: (3, F) vertices of all triangles.
        """
        found = np.full(len(self._texture), -1, np.int32)
        which = np.flatnonzero(self.textured)
        if not len(which):
            return found
        corner, number = corners[:, which], self._texture[which]
        first, count = np.array(self._levels, np.int32)[number].T
        texels = _areas(*self._places.take(corner, axis=1)) * self._size[first].prod(1)
        pixels = _areas(*np.ascontiguousarray(screen[:, :2].T).take(corner, axis=1))
        level = np.round(0.5 * np.log2(np.maximum(texels, 1e-9) / np.maximum(pixels, 1e-6)))
        found[which] = first + np.clip(level, 0, count - 1).astype(np.int32)
        return found

    def look(self, triangle: Ints, corner: NDArray[np.integer], weight: Floats, levels: Ints) -> Looked:
        """Texture times opacity at points.

        Args:
            triangle: (N,) in which they lie.
            corner: (3, N) its vertices.
            weight: (3, N) their barycentric weights.
            levels: of all triangles, from `levels`.
        """
        opacity = sum(self._opacity.take(corner[k]) * weight[k] for k in range(3))
        colour = np.ones((3, len(triangle)), np.float32)
        level = levels.take(triangle)
        has = np.flatnonzero(level >= 0)
        if len(has):
            corner, weight, level = corner[:, has], weight[:, has], level[has]
            u, v = (sum(row.take(corner[k]) * weight[k] for k in range(3)) for row in self._places)
            rgb, alpha = self._sample(u, v, level, self._fold[self._texture[triangle[has]]].T)
            colour[:, has] = rgb
            opacity[has] *= alpha
        return Looked(colour, opacity)

    def _sample(self, u: Floats, v: Floats, level: Ints, folds: Ints) -> tuple[Floats, Floats]:
        """Between the four nearest pixels of a level: (3, N) and (N,)."""
        width, height = self._size.T.take(level, axis=1)
        left, right, across = _neighbours(u, width, folds[0])
        upper, lower, down = _neighbours(v, height, folds[1])
        start = self._start.take(level)
        rgb, alpha = np.zeros((3, len(u)), np.float32), np.zeros(len(u), np.float32)
        for row, share in ((upper, 1 - down), (lower, down)):
            first = start + row * width.astype(np.int64)
            for column, part in ((left, 1 - across), (right, across)):
                texel = self._texels.take(first + column)
                mixed = share * part
                for shift, channel in zip((0, 8, 16), rgb, strict=True):
                    channel += _LINEAR.take(texel >> np.uint32(shift) & np.uint32(255)) * mixed
                alpha += (texel >> np.uint32(24)).astype(np.float32) * (mixed * np.float32(1 / 255))
        return rgb, alpha

    def shows_surface(self, triangle: Ints, sample: Ints, opacity: Floats) -> NDArray[np.bool_]:
        """Whether each sample (N,) of a picture shows the surface, whose opacity is given there, or what lies behind it."""
        cutoff = self._cutoff.take(triangle)
        return np.where(np.isnan(cutoff), opacity > _STEPS.take(sample & 3), opacity >= cutoff)


def _areas(x: Floats, y: Floats) -> Floats:
    """(F,) of triangles with corners (3, F)."""
    return np.abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])) / 2


def _neighbours(at: Floats, size: Ints, fold: Ints) -> tuple[Ints, Ints, Floats]:
    """The two pixels on either side of texture coordinates (N,), and the share of the second."""
    folded = at - np.floor(at)
    mirrored, clamped = np.flatnonzero(fold == 1), np.flatnonzero(fold == 2)
    folded[mirrored] = 1 - np.abs(np.mod(at[mirrored], 2) - 1)
    folded[clamped] = np.clip(at[clamped], 0, 1)
    place = np.nan_to_num(folded) * size.astype(np.float32) - np.float32(0.5)
    low = np.floor(place).astype(np.int32)
    share = (place - low).astype(np.float32)
    high = low + 1
    low = np.where((low < 0) & (fold == 0), size - 1, np.maximum(low, 0))
    high = np.where((high >= size) & (fold == 0), 0, np.minimum(high, size - 1))
    return np.minimum(low, size - 1), high, share
