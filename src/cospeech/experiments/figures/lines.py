"""Lines: values of several systems under several conditions, with their intervals, a panel for each quantity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ...errors import InputError
from ...motion.rotations import Array

__all__ = ["Lines", "Series", "draw_lines"]

Pictures = NDArray[np.uint8]

_PAPER, _INK, _GREY, _FAINT = (255, 255, 255), (43, 49, 58), (126, 134, 146), (228, 231, 236)
_COLOURS = ((28, 122, 118), (214, 92, 66), (66, 133, 197), (150, 105, 180), (242, 166, 54), (88, 166, 92))
_SCALE = 4  # drawn four times as large and shrunk
_WIDE, _HIGH, _LEFT, _TOP, _BELOW, _LEGEND = 620, 300, 64, 44, 40, 34  # pixels
_TICKS, _APART = 5, 9  # at most, on the upright axis; pixels between the lines of two systems at one condition


@dataclass(frozen=True)
class Series:
    """One system.

    Args:
        label: name of the system.
        names: (N,) conditions.
        y: (N,) values.
        half: (N,) half of the interval of each value.
    """

    label: str
    names: Sequence[str]
    y: Array
    half: Array

    def __post_init__(self) -> None:
        if not len(self.names) == len(self.y) == len(self.half) or not np.isfinite([self.y, self.half]).all():
            raise InputError(f"{len(self.y)} values of {self.label!r} under {len(self.names)} conditions", "finite, one each")


@dataclass(frozen=True)
class Lines:
    """A panel: its title, and the systems."""

    title: str
    series: Sequence[Series]


def _ticks(panel: Lines) -> Array:
    """Round numbers around all that is drawn."""
    low = min(float((s.y - s.half).min()) for s in panel.series)
    high = max(float((s.y + s.half).max()) for s in panel.series)
    low = max(low, 0.0) if all((s.y >= 0).all() for s in panel.series) else low
    rough = max(high - low, 1e-3 * abs(high), 1e-9) / (_TICKS - 1)
    unit = 10.0 ** np.floor(np.log10(rough))
    step = next(unit * k for k in (1, 2, 5, 10) if unit * k >= rough * (1 - 1e-9))
    return np.asarray(step * np.arange(np.floor(low / step + 1e-9), np.ceil(high / step - 1e-9) + 1))


def _field(panel: Lines, names: Sequence[str], ticks: Array) -> Image.Image:
    """The field of a panel: lines of the ticks, and for each system its dots, their intervals and the line through them."""
    size = ((_WIDE - _LEFT) * _SCALE, _HIGH * _SCALE)
    image = Image.new("RGB", size, _PAPER)
    pen, edge = ImageDraw.Draw(image), 12 * _SCALE

    def up(y: float) -> float:
        y = min(max(y, float(ticks[0])), float(ticks[-1]))
        return size[1] - edge - (y - ticks[0]) / (ticks[-1] - ticks[0]) * (size[1] - 2 * edge)

    for tick in ticks:
        pen.line([(0, up(tick)), (size[0], up(tick))], _FAINT, _SCALE)
    for k, series in enumerate(panel.series):
        colour, shift = _COLOURS[k % len(_COLOURS)], (k - (len(panel.series) - 1) / 2) * _APART * _SCALE
        at = [(names.index(name) + 0.5) / len(names) * size[0] + shift for name in series.names]
        places = [(x, up(float(y))) for x, y in zip(at, series.y, strict=True)]
        if len(places) > 1:
            pen.line(places, colour, 2 * _SCALE, joint="curve")
        for (x, y), value, half in zip(places, series.y, series.half, strict=True):
            pen.line([(x, up(float(value - half))), (x, up(float(value + half)))], colour, 2 * _SCALE)
            pen.ellipse([x - 5 * _SCALE, y - 5 * _SCALE, x + 5 * _SCALE, y + 5 * _SCALE], colour, _PAPER, _SCALE)
    return image.resize((_WIDE - _LEFT, _HIGH), Image.Resampling.BOX)


def draw_lines(panels: Sequence[Lines]) -> Pictures:
    """Panels side by side, their conditions below, and one legend, (H, W, 3).

    Raises:
        InputError: there is nothing to draw.
    """
    if not panels or not all(panel.series and all(len(s.y) for s in panel.series) for panel in panels):
        raise InputError("lines without a system or a value", "a table whose rows were made")
    names = list(dict.fromkeys(name for panel in panels for series in panel.series for name in series.names))
    title, small = ImageFont.load_default(18), ImageFont.load_default(13)
    sheet = Image.new("RGB", (len(panels) * _WIDE + 16, _TOP + _HIGH + _BELOW + _LEGEND), _PAPER)
    pen = ImageDraw.Draw(sheet)
    for k, panel in enumerate(panels):
        left, ticks = k * _WIDE + _LEFT, _ticks(panel)
        pen.text((left, 22), panel.title, _INK, title, anchor="lm")
        sheet.paste(_field(panel, names, ticks), (left, _TOP))
        digits = max(0, -int(np.floor(np.log10(ticks[1] - ticks[0]) + 1e-9)))
        for tick in ticks:
            y = _TOP + _HIGH - 12 - (tick - ticks[0]) / (ticks[-1] - ticks[0]) * (_HIGH - 24)
            pen.text((left - 8, y), f"{tick:.{digits}f}", _GREY, small, anchor="rm")
        for n, name in enumerate(names):
            pen.text((left + (n + 0.5) / len(names) * (_WIDE - _LEFT), _TOP + _HIGH + 16), name, _INK, small, anchor="mm")
    left = _LEFT
    for k, label in enumerate(dict.fromkeys(series.label for panel in panels for series in panel.series)):
        y = _TOP + _HIGH + _BELOW + 14
        pen.rounded_rectangle([left, y - 3, left + 22, y + 3], 3, _COLOURS[k % len(_COLOURS)])
        pen.text((left + 30, y), label, _INK, small, anchor="lm")
        left += 56 + round(small.getlength(label))
    return np.asarray(sheet)
