"""A character in front of a backdrop: pose in, picture out.

`points` finds which points are seen. Pixels that show one smooth piece of surface are shaded once, in their middle. Pixels at
an outline, at a border of two parts or on a glossy part are shaded at four samples and averaged in linear light.
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
from .patch import Patch
from .points import ShownPoints, find_points
from .shadow import FloorShadow, floor_shadow, measure_light, openness
from .texture import SurfaceTable

__all__ = ["Scene"]

_PENUMBRA = 0.05  # metres: blur of the key's shadows; ours, as of a large soft box, and no finer than the mesh
_SLIVER = 1e-2  # pixels²; ours: below half this area a triangle has one colour
_COARSE = 0.024  # metres: side of the cubes in which one vertex casts the shadow of all; ours, half the penumbra
_STEP = 32  # pixels by which patches grow; ours: even, as films want, and so long that most pictures have patches of one size
_GLOSSY = 0.5  # roughness below which a highlight is smaller than the triangles: eyes, teeth, tongue


# What `light.shade` wants to know, at every vertex.
_Shine = tuple[raster.Floats, raster.Floats, raster.Floats, raster.Floats, raster.Floats, raster.Floats]


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
        self._corners = _corners(character)
        self._part = np.repeat(np.arange(len(parts), dtype=np.int32), [len(p.triangles) for p in parts])
        colours = [np.broadcast_to(np.asarray(p.colour, np.float32), p.vertices.shape) for p in parts]
        self._colour = np.concatenate(colours).T.copy()  # (3, V)
        self._roughness = np.concatenate([np.full(len(p.vertices), p.roughness, np.float32) for p in parts])
        self._glossy = np.array([p.roughness < _GLOSSY for p in parts])[self._part]
        self._surfaces = SurfaceTable(character)
        self._exact = self._glossy | self._surfaces.textured
        self._casting = _casters(character)
        self._open = _openness(character)
        self._backdrop = light.backdrop(width, height, background)
        self.blank = light.draw_backdrop(width, height, background)

    def draw(self, camera: Camera, rotations: Array, positions: Array, face: Array | None = None) -> NDArray[np.uint8]:
        """One picture (H, W, 3), 8-bit sRGB; arguments as of `draw_part`."""
        return self.draw_part(camera, rotations, positions, face).paste(self.blank.copy())

    def draw_part(self, camera: Camera, rotations: Array, positions: Array, face: Array | None = None) -> Patch:
        """The part of a picture that is not the bare backdrop.

        Args:
            camera: of the size of the pictures.
            rotations: (J, 4) world rotations of the joints, xyzw.
            positions: (J, 3) their world positions, metres.
            face: (52,) ARKit weights.
        """
        posed, turned = skin_with_normals(self.character, rotations, positions, face)
        vertices, normals = np.concatenate(posed), np.concatenate(turned)
        screen, shadow = camera.project(vertices), floor_shadow(camera, vertices)
        window = _window(screen, camera.width, camera.height)
        patch = self._bare_patch(window, shadow)
        if window is None:
            return patch
        rows, columns = window
        screen[:, :2] -= columns.start, rows.start
        size = columns.stop - columns.start, rows.stop - rows.start
        levels = self._surfaces.levels(screen, self._corners)
        holes = self._surfaces.open if self._surfaces.open.any() else None
        keeps = None if holes is None else self._holes(screen, levels, size[0])
        drawn = raster.Raster(screen, self._corners, *size, side=1)
        points = find_points(drawn, self._part, self._glossy, holes, keeps)
        colour = self._shade(points, _Posed(screen, self._shine(camera, vertices, normals, points.triangle), levels))
        behind = self._behind(points.mixed // size[0] + rows.start, points.mixed % size[0] + columns.start, shadow)
        wholes = len(points.whole)
        mixed = _average(colour[:, wholes:], points.covered, behind)
        across = patch.pixels.shape[1]
        part, first = patch.pixels.reshape(-1, 3), (rows.start - patch.top) * across + columns.start - patch.left
        for pixel, values in ((points.whole, colour[:, :wholes]), (points.mixed, mixed)):
            at = pixel + (pixel // size[0] * (across - size[0]) + first)
            for channel, value in zip(part.T, values, strict=True):  # several times faster than all at once
                channel[at] = light.develop(value)
        return patch

    def _bare_patch(self, window: tuple[slice, slice] | None, shadow: FloorShadow | None) -> Patch:
        """The backdrop where the character in its ``window`` and its shadow on the floor are in the picture."""
        parts = [] if window is None else [window]
        if shadow is not None:
            parts.append((shadow.rows, shadow.columns))
        (top, bottom), (left, right) = (_span([part[axis] for part in parts]) for axis in range(2))
        pixels = self.blank[top:bottom, left:right].copy()
        if shadow is not None:
            dark = light.develop(self._backdrop[:, shadow.rows, shadow.columns] * shadow.left).transpose(1, 2, 0)
            Patch(shadow.rows.start - top, shadow.columns.start - left, dark).paste(pixels)
        return Patch(top, left, pixels)

    def _behind(self, row: raster.Indices, column: raster.Indices, shadow: FloorShadow | None) -> raster.Floats:
        """(3, N) linear colours of the backdrop at pixels."""
        colour: raster.Floats = self._backdrop[:, row, column]
        return colour if shadow is None else colour * shadow.share(row, column)

    def _shine(self, camera: Camera, vertices: Array, normals: Array, triangle: raster.Indices) -> _Shine:
        """What `light.shade` wants to know at the vertices, if these triangles are seen."""
        axes = camera.axes * np.array([[1], [1], [-1]])  # right, up, back to the camera
        shown, asked = np.zeros(len(self._part), bool), np.zeros(len(vertices), bool)
        shown[triangle] = True
        asked[self._corners.take(np.flatnonzero(shown), axis=1)] = True
        key = (light.KEY @ axes).astype(np.float32)
        asked &= normals @ key > light.REACH
        lit = measure_light(vertices, normals, self._casting, key, _PENUMBRA, asked)
        sight = (axes @ (camera.position - vertices).T).astype(np.float32)
        sight /= np.sqrt(_dot(sight, sight))
        return axes.astype(np.float32) @ normals.T, sight, self._colour, self._roughness, self._open, lit

    def _holes(self, screen: Array, levels: raster.Ints, width: int) -> raster.Keeps:
        """What tells which samples of surfaces with holes are seen."""

        def keeps(sample: raster.Indices, triangle: raster.Indices) -> NDArray[np.bool_]:
            kept = np.ones(len(sample), bool)
            asked = np.flatnonzero(self._surfaces.open.take(triangle))
            own, places = triangle[asked], sample[asked]
            corner = self._corners.take(own, axis=1)
            weight = _weights(screen, corner, *raster.sample_positions(places, width))
            looked = self._surfaces.look(own, corner, weight, levels)
            kept[asked] = self._surfaces.shows_surface(own, places, looked.opacity)
            return kept

        return keeps

    def _shade(self, points: ShownPoints, posed: _Posed) -> raster.Floats:
        """Linear colours (3, N) of surface points: from vertex to vertex, but exactly on surfaces with texture or gloss."""
        shaded, triangle = light.shade(*posed.shine), points.triangle
        colour = _slant(shaded, posed.screen, self._corners, points)
        which = np.flatnonzero(self._exact.take(triangle)) if self._exact.any() else ()
        if len(which):
            triangle = triangle.take(which)
            weight = _weights(posed.screen, self._corners.take(triangle, axis=1), points.x.take(which), points.y.take(which))
            colour[:, which] = self._shade_exactly(shaded, triangle, weight, posed)
        return colour

    def _shade_exactly(
        self, shaded: raster.Floats, triangle: raster.Indices, weight: raster.Floats, posed: _Posed
    ) -> raster.Floats:
        """Colours (3, N) of points with textures or gloss, from those of the vertices."""
        shine, corner = posed.shine, self._corners.take(triangle, axis=1)  # (3, N)
        colour = _mix(shaded, corner, weight)
        textured = np.flatnonzero(self._surfaces.textured.take(triangle))
        texture = np.ones((3, 0), np.float32)
        if len(textured):
            own = corner[:, textured], weight[:, textured]
            texture = self._surfaces.look(triangle[textured], *own, posed.levels).colour
            normal, _, albedo, _, open_sky, lit = shine
            colour[:, textured] += _mix(light.scatter(normal, open_sky, lit) * albedo, *own) * (texture - 1)
        glossy = np.flatnonzero(self._glossy.take(triangle))
        if len(glossy):
            corner, weight = corner[:, glossy], weight[:, glossy]
            normal, sight, albedo, *others = (_mix(np.atleast_2d(values), corner, weight) for values in shine)
            normal /= np.sqrt(_dot(normal, normal) + np.float32(1e-12))
            both = np.searchsorted(textured, glossy)
            has = np.flatnonzero(np.append(textured, -1)[both] == glossy)
            albedo[:, has] *= texture[:, both[has]]
            colour[:, glossy] = light.shade(normal, sight, albedo, *(values[0] for values in others))
        return colour


def _span(parts: list[slice]) -> tuple[int, int]:
    """Where the first of some parts of a row begins and the last ends, in whole steps of `_STEP`."""
    start, stop = min((part.start for part in parts), default=0), max((part.stop for part in parts), default=0)
    return start // _STEP * _STEP, -(-stop // _STEP) * _STEP


def _window(screen: raster.Floats, width: int, height: int) -> tuple[slice, slice] | None:
    """Rows and columns of the part of the picture that the points (V, 3) may lie in; None where there is none."""
    x, y, inverse = np.ascontiguousarray(screen.T)
    before = inverse > 0
    if not before.any():
        return None
    if not before.all():
        x, y = x[before], y[before]
    most = width, height
    low, high = np.floor(np.clip((x.min(), y.min()), 0, most)), np.ceil(np.clip((x.max(), y.max()), 0, most))
    (left, top), (right, bottom) = low.astype(int).tolist(), high.astype(int).tolist()
    return (slice(top, bottom), slice(left, right)) if right > left and bottom > top else None


def _corners(character: Character) -> raster.Indices:
    """(3, F) vertices of all triangles, one part after the other."""
    starts = np.cumsum([0] + [len(p.vertices) for p in character.parts[:-1]])
    rows = [p.triangles + start for p, start in zip(character.parts, starts, strict=True)]
    return np.concatenate(rows).T.astype(np.intp)


@lru_cache(2)
def _casters(character: Character) -> raster.Indices:
    """(3, F) vertices of the triangles that keep light away.

    Surfaces that are seen through in proportion keep none away. Shadows are soft: a coarser mesh is enough. Of the vertices
    in a cube of `_COARSE` that follow the same joint most, one stands for all; what is no triangle then is left out.
    """
    corners, stands, start = _corners(character), [], 0
    for number, part in enumerate(character.parts):
        joint = part.joints[np.arange(len(part.joints)), part.weights.argmax(1)]
        cell = np.floor(part.vertices / _COARSE).astype(np.int64)
        key = np.column_stack([np.full(len(cell), number), joint, cell])
        _, first, of = np.unique(key, axis=0, return_index=True, return_inverse=True)
        stands.append(start + first.take(of.ravel()))
        start += len(part.vertices)
    solid = [part.surface is None or part.surface.cutoff is not None for part in character.parts]
    corners = np.concatenate(stands).take(corners[:, np.repeat(solid, [len(part.triangles) for part in character.parts])])
    a, b, c = corners
    return np.ascontiguousarray(corners[:, (a != b) & (b != c) & (c != a)])


@lru_cache(2)
def _openness(character: Character) -> raster.Floats:
    """`shadow.openness` of the character in its T-pose; kept, because it takes a third of a second."""
    vertices, normals = (np.concatenate([getattr(p, what) for p in character.parts]) for what in ("vertices", "normals"))
    return openness(vertices, normals, _casters(character))


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


def _slant(values: raster.Floats, screen: raster.Floats, corner: raster.Indices, points: ShownPoints) -> raster.Floats:
    """Values (C, V) of vertices at points, (C, N): linear in the picture over each triangle with corners (3, F), never below 0.

    On triangles of some pixels this looks as with weights in perspective, and is several times as fast.
    """
    shown = np.zeros(corner.shape[1], bool)
    shown[points.triangle] = True
    which = np.flatnonzero(shown)
    number = np.zeros(len(shown), np.intp)
    number[which] = np.arange(len(which))
    corner, triangle = corner.take(which, axis=1), number.take(points.triangle)
    (x0, x1, x2), (y0, y1, y2) = np.ascontiguousarray(screen[:, :2].T).take(corner, axis=1)
    x1, x2, y1, y2 = x1 - x0, x2 - x0, y1 - y0, y2 - y0
    area = x1 * y2 - x2 * y1
    flat = np.abs(area) < _SLIVER
    per_area = np.where(flat, 0, 1 / np.where(flat, 1, area))
    out = np.empty((len(values), len(points.x)), np.float32)
    for row, value in zip(out, values, strict=True):
        v0, v1, v2 = value.take(corner)
        v1, v2 = v1 - v0, v2 - v0
        across, down = (v1 * y2 - v2 * y1) * per_area, (v2 * x1 - v1 * x2) * per_area
        np.multiply(across.take(triangle), points.x, out=row)
        row += down.take(triangle) * points.y
        row += (v0 - x0 * across - y0 * down).take(triangle)
        np.maximum(row, 0, out=row)
    return out


def _average(colour: raster.Floats, count: raster.Ints, behind: raster.Floats) -> raster.Floats:
    """Colours (3, P) of pixels of whose samples the first ``count`` (P,) show ``colour`` (3, N), and the others ``behind``."""
    total = np.add.reduceat(np.minimum(colour, 1), np.cumsum(count) - count, axis=1)
    average: raster.Floats = (total + behind * (raster.SAMPLES - count)) * np.float32(1 / raster.SAMPLES)
    return average


def _dot(a: raster.Floats, b: raster.Floats) -> raster.Floats:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
