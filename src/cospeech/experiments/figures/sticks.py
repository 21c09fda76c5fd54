"""Stick figures: bodies in space as lines, left and right in their own colours, with a trail behind the hands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ...audio.speech import Word
from ...errors import InputError
from ...export.render.strip import Sound, StripLayout, draw_strip
from ...motion.rotations import Array

__all__ = ["Sticks", "draw_sticks"]

Pictures = NDArray[np.uint8]

_PAPER, _INK, _GREY = (255, 255, 255), (43, 49, 58), (126, 134, 146)
_MIDDLE, _LEFT, _RIGHT = (74, 84, 99), (214, 92, 66), (52, 120, 176)
_SCALE = 4  # drawn four times as large and shrunk
_TURN, _TILT = np.radians(24.0), np.radians(8.0)  # of the camera, to the person's left and up, which shows depth
_HEAD = 0.10  # metres, radius
_TRAIL = 0.45  # seconds of the trail of the hands
_NEAR = 0.35  # by how much a line is thicker if it is half a metre nearer


@dataclass(frozen=True)
class Sticks:
    """A row of the picture.

    Args:
        label: beside it.
        positions: (T, J, 3) metres, Y up.
        parents: of the J joints; −1: none.
        names: of the joints: "left…" and "right…" are coloured, "…head…" gets a head, "…wrist" and "…hand" leave a trail.
    """

    label: str
    positions: Array
    parents: Sequence[int]
    names: Sequence[str]

    def __post_init__(self) -> None:
        joints = self.positions.shape[1] if self.positions.ndim == 3 else -1
        if self.positions.shape[2:] != (3,) or not len(self.parents) == len(self.names) == joints:
            raise InputError(
                f"stick figures of positions {self.positions.shape}", "(T, J, 3), and a name and parent for each joint"
            )

    def colour(self, joint: int) -> tuple[int, int, int]:
        """Colour of the line to a joint."""
        name = self.names[joint].lower()
        return _LEFT if name.startswith("left") else _RIGHT if name.startswith("right") else _MIDDLE

    @property
    def hands(self) -> list[int]:
        """The joints that leave a trail."""
        return [k for k, name in enumerate(self.names) if name.lower().endswith(("wrist", "hand"))]

    @property
    def head(self) -> int | None:
        """The joint in the middle of the head."""
        return next((k for k, name in reversed([*enumerate(self.names)]) if "head" in name.lower()), None)


def _project(positions: Array) -> Array:
    """(…, 3) metres → to the right, up, and towards the camera."""
    x, y, z = np.moveaxis(positions, -1, 0)
    right, deep = x * np.cos(_TURN) - z * np.sin(_TURN), x * np.sin(_TURN) + z * np.cos(_TURN)
    up, near = y * np.cos(_TILT) - deep * np.sin(_TILT), y * np.sin(_TILT) + deep * np.cos(_TILT)
    return np.stack([right, up, near], -1)


def _mix_colour(colour: tuple[int, int, int], share: float) -> tuple[int, int, int]:
    """A colour, mixed with paper."""
    return tuple(round(c * share + p * (1 - share)) for c, p in zip(colour, _PAPER, strict=True))  # type: ignore[return-value]


class _Window:
    """The part of space that each cell shows: it holds the poses of all rows."""

    def __init__(self, views: Sequence[Array], size: tuple[int, int]) -> None:
        points = np.concatenate([poses[..., :2].reshape(-1, 2) for poses in views])
        low, high = points.min(0), points.max(0)
        self.middle = (low + high) / 2
        room = np.maximum(high - low + np.array([0.10, 2 * _HEAD + 0.08]), 0.5)
        self.scale = min(size[0] / room[0], size[1] / room[1]) * _SCALE
        self.size = (size[0] * _SCALE, size[1] * _SCALE)

    def __call__(self, point: Array) -> tuple[float, float]:
        x, y = (point[:2] - self.middle) * self.scale
        return self.size[0] / 2 + float(x), self.size[1] / 2 - float(y)


def _figure(sticks: Sticks, view: Array, frame: int, trail: int, window: _Window) -> Image.Image:
    """One pose in its cell: trails, then bones from back to front, then the head."""
    image = Image.new("RGB", window.size, _PAPER)
    pen, pose = ImageDraw.Draw(image), view[frame]
    line = 0.026 * window.scale
    for hand in sticks.hands:
        path = view[max(0, frame - trail) : frame + 1, hand]
        for k in range(len(path) - 1):
            share = 0.10 + 0.40 * (k + 1) / len(path)
            pen.line([window(path[k]), window(path[k + 1])], _mix_colour(sticks.colour(hand), share), max(1, round(line * 0.7)))
    bones = [(k, parent) for k, parent in enumerate(sticks.parents) if parent >= 0]
    for k, parent in sorted(bones, key=lambda bone: pose[list(bone), 2].mean()):
        near = pose[[k, parent], 2].mean() - pose[:, 2].mean()
        wide, colour = max(2, round(line * (1 + _NEAR * near / 0.5))), sticks.colour(k)
        a, b = window(pose[parent]), window(pose[k])
        pen.line([a, b], colour, wide)
        for x, y in (a, b):
            pen.ellipse([x - wide / 2, y - wide / 2, x + wide / 2, y + wide / 2], colour)
    for hand in sticks.hands:
        (x, y), r = window(pose[hand]), 1.1 * line
        pen.ellipse([x - r, y - r, x + r, y + r], sticks.colour(hand))
    if sticks.head is not None:
        (x, y), r = window(pose[sticks.head]), _HEAD * window.scale
        pen.ellipse([x - r, y - r, x + r, y + r], _mix_colour(_MIDDLE, 0.12), _MIDDLE, max(2, round(line * 0.8)))
    return image.resize((window.size[0] // _SCALE, window.size[1] // _SCALE), Image.Resampling.BOX)


def draw_sticks(
    rows: Sequence[Sticks],
    fps: float,
    *,
    cells: int = 10,
    width: int = 1600,
    row_height: int = 150,
    sound: Sound | None = None,
    words: Sequence[Word] = (),
) -> Pictures:
    """Rows of stick figures above their speech, (H, W, 3).

    Args:
        rows: all with the same number of frames.
        fps: frames per second.
        cells: moments shown, evenly over the time.
        width: of the picture, pixels.
        row_height: of one row, pixels.
        sound: the speech, drawn as a waveform.
        words: written below the waveform; seconds from the first frame.

    Raises:
        InputError: no rows, rows of different lengths, or fewer frames than cells.
    """
    lengths = sorted({len(row.positions) for row in rows})
    if len(lengths) != 1 or not 1 <= cells <= lengths[0]:
        raise InputError(f"{cells} moments of rows of {lengths} frames", "rows of one length, with that many frames")
    frames = np.linspace(0, lengths[0] - 1, cells + 1).round().astype(int)[1:]
    font = ImageFont.load_default(17)
    side = round(max(font.getlength(part) for row in rows for part in row.label.split("\n")) + 24)
    plan = StripLayout(width - side, 100, cells, 2)
    height = round(10.2 * plan.unit + plan.below + plan.margin) + row_height * len(rows)
    for _ in range(3):  # the size of the text depends on the height, and the height on the text
        plan = StripLayout(width - side, height, cells, 2 if words else 0)
        height = round(10.2 * plan.unit + plan.below + plan.margin) + row_height * len(rows)
    plan = StripLayout(width - side, height, cells, 2 if words else 0)
    wide, high = plan.cell
    pictures = np.full((cells, high, wide, 3), 255, np.uint8)
    views = [_project(row.positions) for row in rows]
    window = _Window([poses[frames] for poses in views], (wide, high // len(rows)))
    for n, row in enumerate(rows):
        top = n * (high // len(rows))
        for k, frame in enumerate(frames):
            figure = np.asarray(_figure(row, views[n], int(frame), round(_TRAIL * fps), window))
            pictures[k, top : top + figure.shape[0]] = figure
    strip = draw_strip(plan, pictures, [float(f / fps) for f in frames], lengths[0] / fps, sound, words)
    sheet = Image.new("RGB", (width, strip.shape[0]), _PAPER)
    sheet.paste(Image.fromarray(strip), (side, 0))
    pen = ImageDraw.Draw(sheet)
    for n, row in enumerate(rows):
        middle = plan.margin + (n + 0.5) * (high // len(rows))
        pen.multiline_text((14, middle), row.label, _INK, font, anchor="lm", spacing=3)
        if n:
            edge = plan.margin + n * (high // len(rows))
            pen.line([(14, edge), (width - 14, edge)], _mix_colour(_GREY, 0.35), 1)
    return np.asarray(sheet)
