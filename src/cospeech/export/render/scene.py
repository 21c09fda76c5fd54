"""A character in front of a backdrop: pose in, picture out.

What is seen is found at four samples per pixel (`raster`). Pixels that show one smooth piece of surface are shaded once, in
their middle; pixels at an outline or at a border of two parts are shaded at every sample and averaged in linear light.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...motion.rotations import Array
from ..mannequin import Character, skin_with_normals
from . import light, raster
from .camera import Camera
from .shadow import floor_shadow, measure_light, openness
from .texture import SurfaceTable

__all__ = ["Scene"]

_PENUMBRA = 0.05  # metres: blur of the key's shadows; ours, as of a large soft box, and no finer than the mesh
_GLOSSY = 0.5  # roughness below which a highlight is smaller than the triangles: eyes, teeth, tongue
_DEEP = 0.012  # metres of depth within one pixel above which it shows an outline; ours: half a finger


# What `light.shade` wants to know, at every vertex.
_Shine = tuple[raster.Floats, raster.Floats, raster.Floats, raster.Floats, raster.Floats, raster.Floats]


class _Points(NamedTuple):
    """Points to shade: place in the picture, pixels; triangle."""

    x: raster.Floats
    y: raster.Floats
    triangle: raster.Ints


class _Posed(NamedTuple):
    """The character before the camera.

    Attributes:
        screen: (V, 3) its vertices in the picture, as `raster.see` takes them.
        shine: what `light.shade` wants to know of them.
        levels: (F,) as `texture.SurfaceTable.levels` gives them.
    """

    screen: raster.Floats
    shine: _Shine
    levels: raster.Ints


class Scene:
    """Draws one character.

    Args:
        character: see `cospeech.export.mannequin`.
        width: of the pictures, pixels.
        height: of the pictures, pixels.
        background: 8-bit sRGB colour of the backdrop.
    """

    def __init__(self, character: Character, width: int, height: int, background: tuple[int, int, int]) -> None:
        self.character = character
        parts = character.parts
        self._triangles = _triangles(character)
        self._corners = self._triangles.T.astype(np.intp)  # what numpy indexes with fastest
        self._part = np.repeat(np.arange(len(parts), dtype=np.int32), [len(p.triangles) for p in parts])
        colours = [np.broadcast_to(np.asarray(p.colour, np.float32), p.vertices.shape) for p in parts]
        self._colour = np.concatenate(colours).T.copy()  # (3, V)
        self._roughness = np.concatenate([np.full(len(p.vertices), p.roughness, np.float32) for p in parts])
        self._glossy = np.array([p.roughness < _GLOSSY for p in parts])[self._part]
        self._surfaces = SurfaceTable(character)
        self._casting = self._triangles[_casting(character)]
        self._open = _openness(character)
        self._backdrop = light.backdrop(width, height, background)
        self._blank = light.develop(self._backdrop).transpose(1, 2, 0).copy()

    def draw(self, camera: Camera, rotations: Array, positions: Array, face: Array | None = None) -> NDArray[np.uint8]:
        """One picture (H, W, 3), 8-bit sRGB.

        Args:
            camera: of the size of the pictures.
            rotations: (J, 4) world rotations of the joints, xyzw.
            positions: (J, 3) their world positions, metres.
            face: (52,) ARKit weights.
        """
        posed, turned = skin_with_normals(self.character, rotations, positions, face)
        vertices, normals = np.concatenate(posed), np.concatenate(turned)
        axes = camera.axes * np.array([[1], [1], [-1]])  # right, up, back to the camera
        screen = camera.project(vertices)
        levels = self._surfaces.levels(screen, self._corners)
        front = np.flatnonzero(raster.front_facing(screen, self._triangles)).astype(np.int32)
        keeps = self._holes(screen, levels, front, camera.width) if self._surfaces.open.any() else None
        seen = raster.see(screen, self._triangles[front], camera.width, camera.height, keeps)
        seen = seen._replace(triangle=front.take(seen.triangle))
        picture, backdrop = self._blank.copy(), self._backdrop
        shadow = floor_shadow(camera, vertices)
        if shadow is not None:
            (rows, columns), left = shadow
            backdrop = backdrop.copy()
            backdrop[:, rows, columns] *= left
            picture[rows, columns] = light.develop(backdrop[:, rows, columns]).transpose(1, 2, 0)
        if len(seen.sample):
            shown, asked = np.zeros(len(self._triangles), bool), np.zeros(len(vertices), bool)
            shown[seen.triangle] = True
            asked[self._triangles[shown]] = True
            key = (light.KEY @ axes).astype(np.float32)
            lit = measure_light(vertices, normals, self._casting, key, _PENUMBRA, asked)
            sight = (axes @ (camera.position - vertices).T).astype(np.float32)
            sight /= np.sqrt(_dot(sight, sight))
            shine = (axes.astype(np.float32) @ normals.T, sight, self._colour, self._roughness, self._open, lit)
            pixel, colour = self._resolve(camera, seen, _Posed(screen, shine, levels), backdrop)
            picture.reshape(-1, 3)[pixel] = light.develop(colour).T
        return picture

    def _resolve(
        self, camera: Camera, seen: raster.VisibleSamples, posed: _Posed, backdrop: Array
    ) -> tuple[raster.Ints, raster.Floats]:
        """Pixels that show the character, and their linear colours (3, P)."""
        width = camera.width
        of_sample = seen.sample >> 2
        first = np.flatnonzero(np.r_[True, of_sample[1:] != of_sample[:-1]])
        count = np.diff(np.r_[first, len(of_sample)])
        pixel = of_sample[first]
        smooth = count == raster.SAMPLES
        whole = np.repeat(smooth, count)
        inverse = seen.inverse[whole].reshape(-1, raster.SAMPLES).T
        part = self._part.take(seen.triangle[whole]).reshape(-1, raster.SAMPLES).T
        near, far = _over(np.maximum, inverse), _over(np.minimum, inverse)
        smooth[smooth] = (near - far < _DEEP * near * far) & (_over(np.maximum, part) == _over(np.minimum, part))
        rough = np.repeat(~smooth, count)
        middle_y = pixel[smooth] // np.int32(width)
        middle_x = (pixel[smooth] - middle_y * np.int32(width)).astype(np.float32) + np.float32(0.5)
        middle_y = middle_y.astype(np.float32) + np.float32(0.5)
        edge_x, edge_y = raster.sample_positions(seen.sample[rough], width)
        points = _Points(
            np.concatenate([middle_x, edge_x]),
            np.concatenate([middle_y, edge_y]),
            np.concatenate([seen.triangle[first[smooth]], seen.triangle[rough]]),
        )
        colour = self._shade(points, posed)
        middles = len(middle_x)
        out = np.empty((3, len(pixel)), np.float32)
        out[:, smooth] = colour[:, :middles]
        if middles < len(points.x):
            counts = count[~smooth]
            starts = np.cumsum(counts) - counts
            behind = backdrop.reshape(3, -1)[:, pixel[~smooth]]
            total = np.add.reduceat(np.minimum(colour[:, middles:], 1), starts, axis=1)
            out[:, ~smooth] = (total + behind * (raster.SAMPLES - counts)) * np.float32(1 / raster.SAMPLES)
        return pixel, out

    def _holes(self, screen: Array, levels: raster.Ints, front: raster.Ints, width: int) -> raster.Keeps:
        """What tells which samples of surfaces with holes are seen; triangles are those of ``front``."""

        def keeps(sample: raster.Ints, triangle: raster.Ints) -> NDArray[np.bool_]:
            kept = np.ones(len(sample), bool)
            asked = np.flatnonzero(self._surfaces.open.take(front).take(triangle))
            whole, places = front.take(triangle[asked]), sample[asked]
            corner = self._corners.take(whole, axis=1)
            weight = _weights(screen, corner, *raster.sample_positions(places, width))
            looked = self._surfaces.look(whole, corner, weight, levels)
            kept[asked] = self._surfaces.shows_surface(whole, places, looked.opacity)
            return kept

        return keeps

    def _shade(self, points: _Points, posed: _Posed) -> raster.Floats:
        """Linear colours (3, N) of surface points: of glossy parts point by point, of others from vertex to vertex."""
        shine = posed.shine
        corner = self._corners.take(points.triangle, axis=1)  # (3, N)
        weight = _weights(posed.screen, corner, points.x, points.y)
        colour = _mix(light.shade(*shine), corner, weight)
        has_texture = self._surfaces.textured
        textured = np.flatnonzero(has_texture.take(points.triangle) if has_texture.any() else has_texture[:0])
        texture = np.ones((3, 0), np.float32)
        if len(textured):
            own = corner[:, textured], weight[:, textured]
            texture = self._surfaces.look(points.triangle[textured], *own, posed.levels).colour
            normal, _, albedo, _, open_sky, lit = shine
            colour[:, textured] += _mix(light.scatter(normal, open_sky, lit) * albedo, *own) * (texture - 1)
        glossy = np.flatnonzero(self._glossy.take(points.triangle))
        if len(glossy):
            corner, weight = corner[:, glossy], weight[:, glossy]
            normal, sight, albedo, *others = (_mix(np.atleast_2d(values), corner, weight) for values in shine)
            normal /= np.sqrt(_dot(normal, normal) + np.float32(1e-12))
            both = np.searchsorted(textured, glossy)
            has = np.flatnonzero(np.append(textured, -1)[both] == glossy)
            albedo[:, has] *= texture[:, both[has]]
            colour[:, glossy] = light.shade(normal, sight, albedo, *(values[0] for values in others))
        return colour


def _triangles(character: Character) -> raster.Ints:
    """Triangles of all parts, as indices into their vertices one part after the other."""
    starts = np.cumsum([0] + [len(p.vertices) for p in character.parts[:-1]])
    return np.concatenate([p.triangles + s for p, s in zip(character.parts, starts, strict=True)]).astype(np.int32)


def _casting(character: Character) -> NDArray[np.bool_]:
    """(F,) which triangles keep light away: all but those that are seen through in proportion."""
    solid = [part.surface is None or part.surface.cutoff is not None for part in character.parts]
    return np.repeat(solid, [len(part.triangles) for part in character.parts])


@lru_cache(2)
def _openness(character: Character) -> raster.Floats:
    """`shadow.openness` of the character in its T-pose; kept, because it takes a third of a second."""
    vertices, normals = (np.concatenate([getattr(p, what) for p in character.parts]) for what in ("vertices", "normals"))
    return openness(vertices, normals, _triangles(character)[_casting(character)])


def _weights(screen: Array, corner: NDArray[np.integer], x: raster.Floats, y: raster.Floats) -> raster.Floats:
    """Perspective-correct barycentric weights (3, N) of points in the triangles with corners (3, N)."""
    (ax, bx, cx), (ay, by, cy), (az, bz, cz) = np.ascontiguousarray(screen.T).take(corner, axis=1)
    ax, bx, cx, ay, by, cy = ax - x, bx - x, cx - x, ay - y, by - y, cy - y
    area = np.stack([(bx * cy - cx * by) * az, (cx * ay - ax * cy) * bz, (ax * by - bx * ay) * cz])
    total = area[0] + area[1] + area[2]
    total[np.abs(total) < 1e-12] = 1
    area /= total
    np.clip(area, 0, 1, out=area)  # the middle of a pixel may lie beside the triangle that was seen in it
    area /= area[0] + area[1] + area[2]
    return area


def _mix(values: raster.Floats, corner: NDArray[np.integer], weight: raster.Floats) -> raster.Floats:
    """Values (C, V) of vertices, mixed by weights (3, N) at the corners (3, N) of triangles: (C, N)."""
    mixed = np.empty((len(values), corner.shape[1]), np.float32)
    for row, value in zip(mixed, values, strict=True):
        np.multiply(value.take(corner[0]), weight[0], out=row)
        row += value.take(corner[1]) * weight[1]
        row += value.take(corner[2]) * weight[2]
    return mixed


def _over(function: np.ufunc, rows: Array) -> Array:
    """Maximum or minimum of the four rows; faster than reducing along an axis."""
    return function(function(rows[0], rows[1]), function(rows[2], rows[3]))


def _dot(a: raster.Floats, b: raster.Floats) -> raster.Floats:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
