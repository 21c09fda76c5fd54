"""Heat maps of gesture: where the arms move, right red, left blue, a cell for each style and speech (Mix-StAGE, figure 7).

A cell shows a person from the front, so the right arm is on the left. Forearm and hand leave ink where they move, in proportion
to the square of their speed. So a stroke leaves much ink, an arm at rest none, and an arm that trembles very little. Where both
arms move, the inks mix.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ...errors import InputError
from ...motion.rotations import Array
from ...motion.skeletons import pats, ted

__all__ = ["FIGURES", "Cell", "Figure", "Frame", "draw_heat", "frame_of", "heat"]

Pictures = NDArray[np.uint8]
Cell = Sequence[Array]
"""Clips, each (T, J, 2 or 3): positions of the joints, y up, the person's left at +x. Between two clips nothing moves."""

_PAPER, _INK, _GREY, _EDGE = (255, 255, 255), (43, 49, 58), (126, 134, 146), (222, 226, 232)
_BONE, _BODY = (186, 192, 201), (238, 240, 243)
_RED, _BLUE = (222, 58, 50), (38, 98, 204)  # as much ink as there is, on paper; figure 7: right red, left blue
_SCALE = 4  # lines are drawn four times as large and shrunk
_CELL, _GAP, _MARGIN, _LEGEND = 190, 8, 20, 56  # pixels; _CELL: the shorter side of a cell
_KEYS = 620  # pixels: width of the legend
_BLUR = 0.055  # of the ink, in shoulders' breadths
_POINTS, _STEPS = 9, 8  # along an arm, and between two frames, where ink is left
_FULL, _GAMMA = 98.5, 0.52  # percentile of the fullest cell's ink that has full colour; exponent for less ink; by eye
_HEAD = 0.34  # radius, in shoulders' breadths; a head is 22 cm high, shoulders' joints are 35 cm apart
_SPARE = 0.22  # around all that is shown, in shoulders' breadths


@dataclass(frozen=True)
class Figure:
    """The joints of a layout.

    Args:
        joints: their number.
        root: the neck, which stands still.
        head: a joint about the middle of the head.
        right, left: joints along the arm: shoulder, elbow, wrist and on. From the elbow on they leave ink; the distance of the
            shoulders is the unit of length.
    """

    joints: int
    root: int
    head: int
    right: Sequence[int]
    left: Sequence[int]


_PATS_ARM = ("Shoulder", "Elbow", "Wrist", "HandMiddle1", "HandMiddle3")
FIGURES: Mapping[str, Figure] = {
    "pats": Figure(
        len(pats.JOINTS), 0, pats.JOINTS.index("Nose"),
        *(tuple(pats.JOINTS.index(side + part) for part in _PATS_ARM) for side in "RL"),
    ),
    "ted": Figure(
        len(ted.JOINTS), ted.JOINTS.index("neck"), ted.JOINTS.index("nose"),
        *(tuple(ted.JOINTS.index(side + part) for part in ("Shoulder", "Elbow", "Wrist")) for side in ("right", "left")),
    ),
}  # fmt: skip
"""Layout of key points (`cospeech.corpora.clip.Points`) → its figure."""


@dataclass(frozen=True)
class Frame:
    """The part of the plane that every cell shows.

    Args:
        low, high: (2,) corners, in shoulders' breadths from the root.
        size: of a cell, pixels.
    """

    low: Array
    high: Array
    size: tuple[int, int]

    @property
    def scale(self) -> float:
        """Pixels per shoulders' breadth."""
        return float(self.size[0] / (self.high - self.low)[0])

    def pixels(self, points: Array) -> Array:
        """(…, 2) places → columns and rows, as fractions."""
        column = (points[..., 0] - self.low[0]) * self.scale
        return np.stack([column, (self.high[1] - points[..., 1]) * self.scale], -1)


def _align_to_root(clips: Cell, figure: Figure) -> list[Array]:
    """(T, J, 2) of each clip, relative to the root, in median shoulders' breadths."""
    whole = [np.asarray(clip, np.float64) for clip in clips]
    lines = np.concatenate([clip[:, figure.left[0]] - clip[:, figure.right[0]] for clip in whole])
    breadth = max(float(np.median(np.linalg.norm(lines, axis=-1))), 1e-9)
    return [(clip - clip[:, [figure.root]])[..., :2] / breadth for clip in whole]


def _limb(points: Array, arm: Sequence[int]) -> Array:
    """(T, `_POINTS`, 2) points of an arm from the elbow on, evenly spaced from joint to joint."""
    chain = points[:, list(arm[1:])]
    at = np.linspace(0, chain.shape[1] - 1, _POINTS)
    low = np.minimum(at.astype(int), chain.shape[1] - 2)
    part = (at - low)[:, None]
    return np.asarray(chain[:, low] * (1 - part) + chain[:, low + 1] * part)


def _check(clips: Cell, figure: Figure) -> None:
    if not len(clips):
        raise InputError("a heat map without a clip", "one for each cell at least")
    for clip in clips:
        if clip.ndim != 3 or len(clip) < 2 or clip.shape[1] != figure.joints or clip.shape[2] not in (2, 3):
            raise InputError(f"a heat map of positions {clip.shape}", f"(T, {figure.joints}, 2 or 3), two frames at least")
        if not np.isfinite(clip).all():
            raise InputError("a heat map of positions that are not finite", "leave those frames out")


def frame_of(cells: Sequence[Cell], figure: Figure) -> Frame:
    """The frame that shows, in all cells, the mean figures and nearly all places of the arms.

    Args:
        cells: clips of two frames at least.
        figure: of the joints.

    Raises:
        InputError: other shapes, numbers that are not finite, or no cell.
    """
    limits = []
    for clips in cells:
        _check(clips, figure)
        points = np.concatenate(_align_to_root(clips, figure))
        arms = np.concatenate([_limb(points, figure.right), _limb(points, figure.left)], 1).reshape(-1, 2)
        head = points[:, figure.head].mean(0)
        still = np.concatenate([points.mean(0), [head - _HEAD, head + _HEAD]])
        limits.append(np.concatenate([still, np.percentile(arms, [0.2, 99.8], axis=0)]))
    if not limits:
        raise InputError("a heat map without cells", "one at least")
    points = np.concatenate(limits)
    low, high = points.min(0) - _SPARE, points.max(0) + _SPARE
    half = max(-low[0], high[0])  # the root in the middle, so that left and right can be compared
    low[0], high[0] = -half, half
    wide, tall = high - low
    return Frame(low, high, (round(_CELL * max(1.0, wide / tall)), round(_CELL * max(1.0, tall / wide))))


def _blur_ink(image: Array, sigma: float) -> Array:
    """Blur the rows and columns with a Gaussian; ink beyond the edge is lost."""
    reach = int(np.ceil(3 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(sigma, 1e-6)) ** 2)
    kernel /= kernel.sum()
    for axis in (0, 1):
        padded = np.pad(image, [(reach, reach) if k == axis else (0, 0) for k in (0, 1)])
        image = np.lib.stride_tricks.sliding_window_view(padded, len(kernel), axis) @ kernel
    return image


def heat(clips: Cell, figure: Figure, frame: Frame, fps: float) -> Array:
    """(2, H, W) ink of the right and the left arm: squared speed per area, in shoulders' breadths and seconds.

    Its sum over the area (1 / scale² for a pixel) is the mean square of the speed of the points of the arm.
    """
    poses, inks = _align_to_root(clips, figure), []
    wide, tall = frame.size
    part = ((np.arange(_STEPS) + 0.5) / _STEPS)[:, None, None, None]
    for arm in (figure.right, figure.left):
        ways = [_limb(points, arm) for points in poses]
        step = np.concatenate([np.diff(way, axis=0) for way in ways])
        start = np.concatenate([way[:-1] for way in ways])
        energy = np.square(step * fps).sum(-1) / (len(step) * _STEPS * _POINTS)
        places = np.floor(frame.pixels(start + part * step)).astype(int).reshape(-1, 2)
        inside = ((places >= 0) & (places < [wide, tall])).all(1)
        amount = np.broadcast_to(energy, (_STEPS, *energy.shape)).ravel()[inside]
        ink = np.bincount(places[inside] @ [1, wide], amount, wide * tall).reshape(tall, wide)
        inks.append(_blur_ink(ink, _BLUR * frame.scale))
    return np.stack(inks) * frame.scale**2


def _mix_ink(paper: Array, ink: Array) -> Array:
    """(…, 3) paper under (…, 2) shares of red and blue ink, 0 … 1; where there are both, the colours mix."""
    cover = 1 - np.prod(1 - ink, -1, keepdims=True)
    colour = ink @ np.array([_RED, _BLUE], np.float64) / np.maximum(ink.sum(-1, keepdims=True), 1e-9)
    return np.asarray(paper * (1 - cover) + colour * cover)


def _person(clips: Cell, figure: Figure, frame: Frame) -> Image.Image:
    """The mean figure in pale colours: mean arms, a chest as wide as the shoulders, a head."""
    image = Image.new("RGB", (frame.size[0] * _SCALE, frame.size[1] * _SCALE), _PAPER)
    pen, unit = ImageDraw.Draw(image), frame.scale * _SCALE
    pose = frame.pixels(np.concatenate(_align_to_root(clips, figure)).mean(0)) * _SCALE
    thick, hips = 0.075 * unit, pose[figure.root] + np.array([[-0.36, 1.5], [0.36, 1.5]]) * unit
    right, left = pose[list(figure.right)], pose[list(figure.left)]
    pen.polygon([(float(x), float(y)) for x, y in (right[0], left[0], hips[1], hips[0])], _BODY)
    for chain in (np.stack([pose[figure.root], pose[figure.head]]), np.concatenate([right[::-1], left])):
        places = [(float(x), float(y)) for x, y in chain]
        pen.line(places, _BONE, round(thick))
        for x, y in places:
            pen.ellipse([x - thick / 2, y - thick / 2, x + thick / 2, y + thick / 2], _BONE)
    (x, y), r = pose[figure.head], _HEAD * unit
    pen.ellipse([x - r, y - r, x + r, y + r], _BODY, _BONE, round(0.7 * thick))
    return image.resize(frame.size, Image.Resampling.BOX)


def _legend(sheet: Image.Image, left: int, top: int) -> None:
    """What the colours mean."""
    pen, small = ImageDraw.Draw(sheet), ImageFont.load_default(15)
    shares = np.linspace(0, 1, 90)[None, :, None] * np.ones((12, 1, 1))
    for name, weights in (("right arm moves", (1, 0)), ("left arm moves", (0, 1)), ("both", (1, 1))):
        bar = _mix_ink(np.full((12, 90, 3), 255.0), shares * np.array(weights)).round().astype(np.uint8)
        sheet.paste(Image.fromarray(bar), (left, top - 6))
        pen.rectangle([left, top - 6, left + 89, top + 5], None, _EDGE)
        pen.text((left + 98, top), name, _GREY, small, anchor="lm")
        left += round(98 + small.getlength(name) + 26)


def draw_heat(
    cells: Sequence[Sequence[Cell]],
    figure: Figure,
    fps: float,
    *,
    columns: Sequence[str],
    rows: Sequence[str],
    title: str = "",
    frame: Frame | None = None,
) -> Pictures:
    """A grid of heat maps, (H, W, 3); all cells are to one scale, of place and of colour.

    Args:
        cells: rows of columns.
        figure: of the joints.
        fps: of all clips.
        columns: heads of the columns, such as styles.
        rows: labels of the rows; they may have several lines.
        title: of the whole picture.
        frame: what every cell shows; None: see `frame_of`.

    Raises:
        InputError: no cells, rows of different lengths, or labels that are more or fewer.
    """
    if len(rows) != len(cells) or not cells or any(len(row) != len(columns) for row in cells):
        counts = f"{[len(row) for row in cells]} cells, {len(rows)} labels, {len(columns)} heads"
        raise InputError(f"a heat map of {counts}", "a label for each row, a head for each column")
    frame = frame_of([cell for row in cells for cell in row], figure) if frame is None else frame
    inks = np.stack([[heat(cell, figure, frame, fps) for cell in row] for row in cells])
    full = max(float(np.percentile(inks.max(2), _FULL, axis=(2, 3)).max()), 1e-12)
    big, small, head = (ImageFont.load_default(size) for size in (20, 15, 17))
    side = _MARGIN + round(max(small.getlength(line) for label in rows for line in label.split("\n"))) + 14
    above = (44 if title else 10) + 34 + 19 * max(text.count("\n") for text in columns)
    (wide, tall), count = frame.size, len(columns)
    width = max(side + count * (wide + _GAP) - _GAP + _MARGIN, side + _KEYS)
    sheet = Image.new("RGB", (width, above + len(rows) * (tall + _GAP) - _GAP + _LEGEND), _PAPER)
    pen = ImageDraw.Draw(sheet)
    pen.text((_MARGIN, 28), title, _INK, big, anchor="lm")
    for c, text in enumerate(columns):
        middle = (side + c * (wide + _GAP) + wide / 2, above - 8)
        pen.multiline_text(middle, text, _INK, head, anchor="md", align="center", spacing=3)
    for r, row in enumerate(cells):
        top = above + r * (tall + _GAP)
        pen.multiline_text((_MARGIN, top + tall / 2), rows[r], _INK, small, anchor="lm", spacing=3)
        for c, cell in enumerate(row):
            left = side + c * (wide + _GAP)
            ink = np.minimum(np.moveaxis(inks[r, c], 0, -1) / full, 1) ** _GAMMA
            picture = _mix_ink(np.asarray(_person(cell, figure, frame), np.float64), ink)
            sheet.paste(Image.fromarray(picture.round().astype(np.uint8)), (left, top))
            pen.rounded_rectangle([left, top, left + wide - 1, top + tall - 1], 5, None, _EDGE)
    _legend(sheet, side, sheet.height - _LEGEND // 2)
    return np.asarray(sheet)
