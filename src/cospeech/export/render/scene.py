"""A character in front of a backdrop: pose in, picture out.

`points` finds the visible points. Pixels that show one smooth piece of surface are shaded once, in their middle; without a
texture, the 8-bit colours of the vertices are interpolated. Pixels at an outline, at a border between two parts or on a glossy
part are shaded at four samples and averaged in linear light.
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...motion.rotations import Array
from ..mannequin import Character, pose_surface
from . import light, raster
from .camera import Camera
from .patch import Patch
from .planes import Slopes
from .points import ShownPoints, find_points
from .raster import evaluate, pick
from .shadow import FloorShadow, floor_shadow, measure_light, openness
from .texture import LaidTextures, SurfaceTable

__all__ = ["Scene"]

_PENUMBRA = 0.05  # metres: blur of the key light's shadows; ours, as of a large soft box, and no finer than the mesh
_COARSE = 0.024  # metres: side of the cubes in which one vertex stands for all in shadows; ours, half the penumbra
_STEP = 32  # pixels; sides of patches are multiples of it; ours: even, as films want; most patches have one size
_GLOSSY = 0.5  # roughness below which a highlight is smaller than the triangles: eyes, teeth, tongue


# The arguments of `light.shade`, at every vertex.
_Shine = tuple[raster.Floats, raster.Floats, raster.Floats, raster.Floats, raster.Floats, raster.Floats]


class _Visible(NamedTuple):
    """The visible points of a picture, and the K triangles that may be seen there.

    Attributes:
        width: of the picture, pixels.
        points: the visible points.
        corners: (3, K) vertices of the triangles.
        slopes: of the triangles.
        glossy: (K,) triangles on which a highlight is smaller than they are.
        textures: on the triangles.
    """

    width: int
    points: ShownPoints
    corners: raster.Indices
    slopes: Slopes
    glossy: NDArray[np.bool_]
    textures: LaidTextures


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
        self._casting = _casters(character)
        self._open = _openness(character)
        self._backdrop = light.backdrop(width, height, background)[:, :, 0].copy()  # (3, H): it is the same along a row
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
        vertices, normals = (rows.T for rows in pose_surface(self.character, rotations, positions, face))
        screen, shadow = camera.project(vertices), floor_shadow(camera, vertices)
        window = _window(screen, camera.width, camera.height)
        patch = self._bare_patch(window, shadow)
        if window is None:
            return patch
        screen[:, :2] -= patch.left, patch.top
        visible = self._see(screen, *patch.pixels.shape[1::-1])
        shine = self._shine(camera, vertices, normals, _list_corners(visible))
        shading = _Shading(visible, shine, light.shade(*shine))
        canvas, points = patch.pixels.reshape(-1, 3).T, visible.points
        _paint_whole(canvas, visible, shading)
        colour = shading.look(points.sample_triangle, *raster.sample_positions(points.sample, visible.width))
        row, column = np.divmod(points.edge.astype(np.int32), np.int32(visible.width))
        behind = self._behind(row + patch.top, column + patch.left, shadow)
        _put(canvas, points.edge, light.develop(_average(colour, points.coverage, behind)))
        return patch

    def _see(self, screen: raster.Floats, width: int, height: int) -> _Visible:
        """Find what a picture of that size shows of vertices (V, 3)."""
        triangles = raster.Raster(screen, self._corners, width, height, side=1)
        corners, glossy = pick(self._corners, triangles.number, 1), pick(self._glossy, triangles.number)
        slopes = Slopes(screen, corners)
        textures = self._surfaces.lay(screen, slopes, corners, triangles.number)
        holes = textures.open if textures.open.any() else None
        keeps = None if holes is None else _make_keeps(textures, width)
        points = find_points(triangles, pick(self._part, triangles.number), glossy, holes, keeps)
        return _Visible(width, points, corners, slopes, glossy, textures)

    def _bare_patch(self, window: tuple[slice, slice] | None, shadow: FloorShadow | None) -> Patch:
        """The backdrop of the part of the picture with the character, in its ``window``, and its shadow on the floor."""
        parts = [] if window is None else [window]
        if shadow is not None:
            parts.append((shadow.rows, shadow.columns))
        (top, bottom), (left, right) = (_span([part[axis] for part in parts]) for axis in range(2))
        pixels = self.blank[top:bottom, left:right].copy()
        if shadow is not None:
            dark = light.develop(self._backdrop[:, shadow.rows, None] * shadow.light).transpose(1, 2, 0)
            Patch(shadow.rows.start - top, shadow.columns.start - left, dark).paste(pixels)
        return Patch(top, left, pixels)

    def _behind(self, row: raster.Indices, column: raster.Indices, shadow: FloorShadow | None) -> raster.Floats:
        """(3, N) linear colours of the backdrop at pixels."""
        colour: raster.Floats = pick(self._backdrop, row, 1)
        return colour if shadow is None else colour * shadow.share(row, column)

    def _shine(self, camera: Camera, vertices: Array, normals: Array, corners: raster.Indices) -> _Shine:
        """The arguments of `light.shade` at the vertices; the light only at ``corners``, those of visible triangles."""
        axes = camera.axes * np.array([[1], [1], [-1]])  # right, up, back to the camera
        key = (light.KEY @ axes).astype(np.float32)
        mask = np.zeros(len(vertices), bool)
        mask[corners] = True
        mask &= normals @ key > light.REACH
        lit = measure_light(vertices, normals, self._casting, key, _PENUMBRA, mask)
        sight = (axes @ (camera.position - vertices).T).astype(np.float32)
        sight /= np.sqrt(_dot(sight, sight))
        return axes.astype(np.float32) @ normals.T, sight, self._colour, self._roughness, self._open, lit


def _list_corners(visible: _Visible) -> raster.Indices:
    """(3, N) vertices of the triangles that a picture shows."""
    mask = np.zeros(visible.corners.shape[1], bool)
    mask[visible.points.triangle] = mask[visible.points.sample_triangle] = True
    return pick(visible.corners, np.flatnonzero(mask), 1)


def _make_keeps(textures: LaidTextures, width: int) -> raster.Keeps:
    """Make the function that finds the visible samples of surfaces with holes."""

    def keeps(sample: raster.Indices, triangle: raster.Indices) -> NDArray[np.bool_]:
        is_shown = np.ones(len(sample), bool)
        indices = np.flatnonzero(pick(textures.open, triangle))
        for some in raster.chunks(len(indices)):
            own, places = pick(triangle, indices[some]), pick(sample, indices[some])
            opacity = textures.opacity(own, *raster.sample_positions(places, width))
            is_shown[indices[some]] = textures.shows_surface(own, places, opacity)
        return is_shown

    return keeps


def _paint_whole(canvas: NDArray[np.uint8], visible: _Visible, shading: _Shading) -> None:
    """Paint the pixels of the canvas (3, P) that show one smooth piece of surface."""
    pixel, triangle = visible.points.whole, visible.points.triangle
    has_texture = pick(visible.textures.has_texture, triangle)
    exact = np.flatnonzero(has_texture)
    for some in raster.chunks(len(exact)):
        at, own = pick(pixel, exact[some]), pick(triangle, exact[some])
        _put(canvas, at, light.develop(shading.look(own, *raster.middle_positions(at, visible.width))))
    if len(exact):
        plain = np.flatnonzero(~has_texture)
        pixel, triangle = pick(pixel, plain), pick(triangle, plain)
    if len(pixel):
        half = np.float32(0.5)  # so that the cast to whole numbers rounds
        planes = visible.slopes.planes(light.tone(shading.colours) + half)
        for some in raster.chunks(len(pixel)):
            tones = evaluate(planes, triangle[some], *raster.middle_positions(pixel[some], visible.width))
            _put(canvas, pixel[some], np.clip(tones, 0, 255, out=tones).astype(np.uint8))


def _put(canvas: NDArray[np.uint8], pixel: raster.Indices, colour: NDArray[np.uint8]) -> None:
    """Set pixels (N,) of the canvas (3, P) to colours (3, N)."""
    for channel, values in zip(canvas, colour, strict=True):  # several times faster than all at once
        channel[pixel] = values


class _Shading:
    """Gives the colours of places on the triangles of a picture.

    Args:
        visible: the picture.
        shine: of all vertices.
        colours: (3, V) linear colours of the vertices.
    """

    def __init__(self, visible: _Visible, shine: _Shine, colours: raster.Floats) -> None:
        self._visible, self._shine, self.colours = visible, shine, colours

    @cached_property
    def _planes(self) -> raster.Floats:
        return self._visible.slopes.planes(self.colours)

    @cached_property
    def _bare_planes(self) -> raster.Floats:
        """Planes of the diffuse light, by which a texture is multiplied."""
        normal, _, albedo, _, open_sky, lit = self._shine
        return self._visible.slopes.planes(light.scatter(normal, open_sky, lit) * albedo)

    def look(self, triangle: raster.Indices, x: raster.Floats, y: raster.Floats) -> raster.Floats:
        """Linear colours (3, N) of places x and y, in pixels, on triangles (N,), with their texture and gloss."""
        visible = self._visible
        colour = evaluate(self._planes, triangle, x, y)
        indices, texture = np.flatnonzero(pick(visible.textures.has_texture, triangle)), np.ones((3, 0), np.float32)
        if len(indices):
            own = pick(triangle, indices), pick(x, indices), pick(y, indices)
            texture = visible.textures.look(*own)
            bare = evaluate(self._bare_planes, *own)
            bare *= texture - 1
            colour[:, indices] += bare
        glossy = np.flatnonzero(pick(visible.glossy, triangle))
        if len(glossy):
            normal, sight, albedo, others = self._interpolate(pick(triangle, glossy), pick(x, glossy), pick(y, glossy))
            both = np.searchsorted(indices, glossy)
            has = np.flatnonzero(np.append(indices, -1)[both] == glossy)
            albedo[:, has] *= texture[:, both[has]]
            colour[:, glossy] = light.shade(normal, sight, albedo, *others)
        return colour

    def _interpolate(
        self, triangle: raster.Indices, x: raster.Floats, y: raster.Floats
    ) -> tuple[raster.Floats, raster.Floats, raster.Floats, raster.Floats]:
        """The arguments of `light.shade` at places: normal, sight, colour, and the rest."""
        mask = np.zeros(len(self._visible.glossy), bool)
        mask[triangle] = True
        which = np.flatnonzero(mask)  # few triangles: planes of so many values are computed for these only
        values = np.concatenate([np.atleast_2d(value) for value in self._shine])
        values = evaluate(self._visible.slopes.some(which).planes(values), np.searchsorted(which, triangle), x, y)
        normal = values[:3]
        normal /= np.sqrt(_dot(normal, normal) + np.float32(1e-12))
        return normal, values[3:6], values[6:9], values[9:]


def _span(parts: list[slice]) -> tuple[int, int]:
    """Start of the first and end of the last of some slices, in whole steps of `_STEP`."""
    start, stop = min((part.start for part in parts), default=0), max((part.stop for part in parts), default=0)
    return start // _STEP * _STEP, -(-stop // _STEP) * _STEP


def _window(screen: raster.Floats, width: int, height: int) -> tuple[slice, slice] | None:
    """Rows and columns of the part of the picture in which the points (V, 3) may lie; None where there is none."""
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
    """(3, F) vertices of the triangles that cast shadows.

    Translucent surfaces cast none. Shadows are soft: a coarser mesh is enough. Of the vertices in a cube of `_COARSE` that
    mostly follow the same joint, one stands for all; triangles that collapse are left out.
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


def _average(colour: raster.Floats, count: raster.Ints, behind: raster.Floats) -> raster.Floats:
    """Colours (3, P) of pixels: ``count`` (P,) of their samples show ``colour`` (3, N), and the others show ``behind``."""
    total = np.add.reduceat(np.clip(colour, 0, 1), np.cumsum(count) - count, axis=1)
    average: raster.Floats = (total + behind * (raster.SAMPLES - count)) * np.float32(1 / raster.SAMPLES)
    return average


def _dot(a: raster.Floats, b: raster.Floats) -> raster.Floats:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
