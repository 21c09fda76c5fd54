"""Maps: points in the plane, coloured by group, a panel for each picture and one legend for all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ...errors import InputError
from ...motion.rotations import Array

__all__ = ["Panel", "draw_map"]

Pictures = NDArray[np.uint8]

_PAPER, _INK, _GREY, _FRAME = (255, 255, 255), (43, 49, 58), (126, 134, 146), (222, 226, 232)
_COLOURS = (
    (228, 87, 72), (66, 133, 197), (88, 166, 92), (242, 166, 54), (150, 105, 180), (64, 182, 176), (214, 117, 172),
    (140, 108, 83), (122, 132, 145), (184, 186, 58), (38, 84, 124), (160, 36, 52), (122, 199, 79), (255, 140, 105),
    (84, 62, 140), (34, 110, 80),
)  # fmt: skip
"""They differ in hue and in lightness. With more groups, the colours begin again, with rings instead of dots."""
_SCALE, _PANEL, _MARGIN, _TOP, _LEGEND = 4, 460, 26, 62, 190  # drawn times, and pixels
_DOT = 4.6


@dataclass(frozen=True)
class Panel:
    """One picture.

    Args:
        title: above it.
        text: below the title.
        points: (N, 2).
        groups: (N,) names, such as speakers.
        behind: (M, 2) points of the same plane, drawn pale behind the others.
    """

    title: str
    text: str
    points: Array
    groups: Sequence[str]
    behind: Array | None = None

    def __post_init__(self) -> None:
        if self.points.ndim != 2 or self.points.shape[1] != 2 or len(self.points) != len(self.groups) or not len(self.points):
            raise InputError(
                f"a map of points {self.points.shape} in {len(self.groups)} groups", "(N, 2), and a group for each"
            )


def _dot(pen: ImageDraw.ImageDraw, x: float, y: float, group: int) -> None:
    """A dot with a white edge, or a ring, around (x, y) of the large drawing."""
    colour, r = _COLOURS[group % len(_COLOURS)], _DOT * _SCALE
    pen.ellipse([x - r - _SCALE, y - r - _SCALE, x + r + _SCALE, y + r + _SCALE], _PAPER)
    if group < len(_COLOURS):
        pen.ellipse([x - r, y - r, x + r, y + r], colour)
    else:
        pen.ellipse([x - r, y - r, x + r, y + r], _PAPER, colour, round(0.4 * r))


def _panel(panel: Panel, names: Sequence[str]) -> Image.Image:
    side = _PANEL * _SCALE
    image = Image.new("RGB", (side, side), _PAPER)
    pen = ImageDraw.Draw(image)
    pen.rounded_rectangle([_SCALE, _SCALE, side - _SCALE, side - _SCALE], 10 * _SCALE, _PAPER, _FRAME, 2 * _SCALE)
    behind = np.zeros((0, 2)) if panel.behind is None else panel.behind
    both = np.concatenate([panel.points, behind])
    low, high = both.min(0), both.max(0)
    room = side - 2 * (_DOT + 14) * _SCALE
    scale = room / max(float((high - low).max()), 1e-12)
    for place in behind:
        x, y = (place - (low + high) / 2) * scale
        r = 0.8 * _DOT * _SCALE
        pen.ellipse([side / 2 + x - r, side / 2 - y - r, side / 2 + x + r, side / 2 - y + r], _FRAME)
    for k in np.random.default_rng(0).permutation(len(panel.points)):  # so that no group lies on top of all
        x, y = (panel.points[k] - (low + high) / 2) * scale
        _dot(pen, side / 2 + float(x), side / 2 - float(y), names.index(panel.groups[k]))
    return image.resize((_PANEL, _PANEL), Image.Resampling.BOX)


def draw_map(panels: Sequence[Panel]) -> Pictures:
    """Panels side by side and a legend, (H, W, 3).

    Raises:
        InputError: there is no panel.
    """
    if not panels:
        raise InputError("a map without panels", "one at least")
    names = sorted({name for panel in panels for name in panel.groups})
    size = (_MARGIN + len(panels) * (_PANEL + _MARGIN) + _LEGEND, _TOP + max(_PANEL, 26 * len(names)) + _MARGIN)
    sheet = Image.new("RGB", size, _PAPER)
    pen, title, small = ImageDraw.Draw(sheet), ImageFont.load_default(20), ImageFont.load_default(15)
    for k, panel in enumerate(panels):
        left = _MARGIN + k * (_PANEL + _MARGIN)
        pen.text((left + 4, 22), panel.title, _INK, title, anchor="lm")
        pen.text((left + 4, 46), panel.text, _GREY, small, anchor="lm")
        sheet.paste(_panel(panel, names), (left, _TOP))
    left, big = size[0] - _LEGEND + 6, Image.new("RGB", (24 * _SCALE, 26 * len(names) * _SCALE), _PAPER)
    for k in range(len(names)):
        _dot(ImageDraw.Draw(big), 12 * _SCALE, (26 * k + 13) * _SCALE, k)
    sheet.paste(big.resize((24, 26 * len(names)), Image.Resampling.BOX), (left, _TOP))
    for k, name in enumerate(names):
        pen.text((left + 32, _TOP + 26 * k + 13), name, _INK, small, anchor="lm")
    return np.asarray(sheet)
