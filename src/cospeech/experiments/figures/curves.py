"""Curves: values measured at a few places between two named ends, a panel for each quantity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ...errors import InputError
from ...motion.rotations import Array

__all__ = ["PlottedCurve", "draw_curves"]

Pictures = NDArray[np.uint8]

_PAPER, _INK, _GREY, _FAINT = (255, 255, 255), (43, 49, 58), (126, 134, 146), (228, 231, 236)
_LINE, _BAND, _BAD = (28, 122, 118), (214, 234, 232), (214, 92, 66)
_SCALE = 4  # drawn four times as large and shrunk
_HIGH, _TOP, _BELOW, _LEFT, _GAP = 190, 62, 52, 58, 34  # pixels: of the field, of the titles, of the axis, of its numbers …
_TICKS = 5  # at most, on the upright axis


@dataclass(frozen=True)
class PlottedCurve:
    """A panel.

    Args:
        title: above it.
        text: below the title.
        good: whether the text is good news (green) or bad news (red); None: neither.
        x: (N,) places, rising; ``ends`` are written below the first and the last.
        y: (N,) values.
        spread: (N,) half of the interval of each value, drawn as a band.
        ends: names of the two ends.
        marks: values of the ends that were measured elsewhere, drawn as rings; None: there are none.
    """

    title: str
    text: str
    good: bool | None
    x: Array
    y: Array
    spread: Array
    ends: tuple[str, str]
    marks: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        shapes = {values.shape for values in (self.x, self.y, self.spread)}
        if len(shapes) != 1 or len(self.x) < 2 or not np.isfinite([self.x, self.y, self.spread]).all():
            raise InputError(f"a curve of shapes {sorted(shapes)}", "two values at least, finite")

    @property
    def ticks(self) -> Array:
        """Ticks of the upright axis: round numbers around all that is drawn."""
        limits = np.concatenate([self.y - self.spread, self.y + self.spread, self.marks or ()])
        low, high = float(limits.min()), float(limits.max())
        low = max(low, 0.0) if (self.y >= 0).all() else low  # an interval may reach below 0, the values cannot
        span = max(high - low, 1e-3 * abs(high), 1e-6)
        rough = span / (_TICKS - 1)
        unit = 10.0 ** np.floor(np.log10(rough))
        step = next(unit * k for k in (1, 2, 5, 10) if unit * k >= rough)
        return step * np.arange(np.floor(low / step), np.ceil(high / step) + 1)


def _ring(pen: ImageDraw.ImageDraw, x: float, y: float, scale: float) -> None:
    r = 5.5 * scale
    pen.ellipse([x - r, y - r, x + r, y + r], None, _BAD, round(2 * scale))


def _panel(curve: PlottedCurve, width: int) -> Image.Image:
    """The field of one curve: lines of the ticks, band, line, dots."""
    big = Image.new("RGB", (width * _SCALE, _HIGH * _SCALE), _PAPER)
    pen, ticks = ImageDraw.Draw(big), curve.ticks
    edge = 12 * _SCALE

    def at(x: float, y: float) -> tuple[float, float]:
        right = (x - curve.x[0]) / (curve.x[-1] - curve.x[0]) * (big.width - 2 * edge)
        return edge + float(right), big.height - edge - float((y - ticks[0]) / (ticks[-1] - ticks[0])) * (big.height - 2 * edge)

    for tick in ticks:
        pen.line([(0, at(0, tick)[1]), (big.width, at(0, tick)[1])], _FAINT, _SCALE)
    above = [at(x, y) for x, y in zip(curve.x, curve.y + curve.spread, strict=True)]
    below = [at(x, y) for x, y in zip(curve.x, np.maximum(curve.y - curve.spread, ticks[0]), strict=True)]
    pen.polygon([*above, *below[::-1]], _BAND)
    for y in (curve.y[0], curve.y[-1]):  # the values of both ends, as lines across the field
        for k in range(0, big.width, 10 * _SCALE):
            pen.line([(k, at(0, y)[1]), (k + 4 * _SCALE, at(0, y)[1])], _GREY, _SCALE)
    places = [at(x, y) for x, y in zip(curve.x, curve.y, strict=True)]
    pen.line(places, _LINE, 3 * _SCALE, joint="curve")
    for x, y in places:
        pen.ellipse([x - 5 * _SCALE, y - 5 * _SCALE, x + 5 * _SCALE, y + 5 * _SCALE], _LINE, _PAPER, _SCALE)
    for x, mark in zip((curve.x[0], curve.x[-1]), curve.marks or (), strict=False):
        _ring(pen, *at(x, mark), _SCALE)
    return big.resize((width, _HIGH), Image.Resampling.BOX)


def draw_curves(curves: Sequence[PlottedCurve], width: int) -> Pictures:
    """Panels side by side, (H, width, 3).

    Raises:
        InputError: there is no curve.
    """
    if not curves:
        raise InputError("curves without a curve", "one at least")
    title, small = ImageFont.load_default(17), ImageFont.load_default(14)
    sheet = Image.new("RGB", (width, _TOP + _HIGH + _BELOW), _PAPER)
    pen, each = ImageDraw.Draw(sheet), (width - _GAP) // len(curves)
    for k, curve in enumerate(curves):
        left, wide = k * each + _LEFT, each - _LEFT
        pen.text((left, 20), curve.title, _INK, title, anchor="lm")
        pen.text((left, 43), curve.text, {None: _GREY, True: _LINE, False: _BAD}[curve.good], small, anchor="lm")
        sheet.paste(_panel(curve, wide), (left, _TOP))
        ticks = curve.ticks
        digits = max(0, -int(np.floor(np.log10(ticks[1] - ticks[0]) + 1e-9)))
        for tick in ticks:
            y = _TOP + _HIGH - 12 - (tick - ticks[0]) / (ticks[-1] - ticks[0]) * (_HIGH - 24)
            pen.text((left - 8, y), f"{tick:.{digits}f}", _GREY, small, anchor="rm")
        for x in curve.x:
            place = left + 12 + (x - curve.x[0]) / (curve.x[-1] - curve.x[0]) * (wide - 24)
            pen.line([(place, _TOP + _HIGH), (place, _TOP + _HIGH + 5)], _GREY)
            pen.text((place, _TOP + _HIGH + 15), f"{x:g}", _GREY, small, anchor="mm")
        pen.text((left, _TOP + _HIGH + 36), curve.ends[0], _INK, small, anchor="lm")
        pen.text((left + wide, _TOP + _HIGH + 36), curve.ends[1], _INK, small, anchor="rm")
        if curve.marks is not None:
            _ring(pen, left + wide / 2 - 42, _TOP + _HIGH + 36, 1)
            pen.text((left + wide / 2 - 30, _TOP + _HIGH + 36), "recordings", _GREY, small, anchor="lm")
    return np.asarray(sheet)
