"""Draw a strip: pictures of a few moments above the waveform of the speech, as in papers about gesture."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ...audio.speech import Word
from ...motion.rotations import Array

__all__ = ["Sound", "StripLayout", "draw_strip"]

Pictures = NDArray[np.uint8]

_PAPER, _INK, _GREY, _FAINT = (255, 255, 255), (43, 49, 58), (126, 134, 146), (222, 226, 232)
_PEAK, _BODY, _MARK = (190, 207, 222), (92, 134, 170), (214, 92, 66)
_SCALE = 3  # lines and curves are drawn three times as large and shrunk, which makes their edges smooth
_TICKS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600)  # seconds between two, the smallest that fits


@dataclass(frozen=True)
class Sound:
    """Loudness of the speech over time.

    Args:
        step: seconds per value.
        peak: (N,) greatest absolute sample of each step.
        level: (N,) root mean square of each step.
    """

    step: float
    peak: Array
    level: Array


@dataclass(frozen=True)
class StripLayout:
    """The layout of a strip of ``width × height`` pixels with ``cells`` pictures; all in pixels.

    ``rows`` of words are written below the axis. The pictures are as wide as ``widths`` says, equally wide where it is empty.
    The axis begins at ``start`` seconds: a strip may show a part of a take.
    """

    width: int
    height: int
    cells: int
    rows: int = 0
    widths: tuple[int, ...] = ()
    start: float = 0.0

    @property
    def below(self) -> float:
        """Height of the axis' labels and the words, below the waveform."""
        return (3.0 + 1.6 * self.rows) * self.unit

    @property
    def unit(self) -> float:
        """Size of the small letters."""
        return max(7.0, min(self.width / 100, self.height / 36))

    @property
    def margin(self) -> int:
        return round(1.2 * self.unit)

    @property
    def gap(self) -> int:
        return round(0.45 * self.unit)

    @property
    def room(self) -> int:
        """Width of all pictures together."""
        return self.width - 2 * self.margin - (self.cells - 1) * self.gap

    @property
    def cell(self) -> tuple[int, int]:
        """Width and height of pictures that are equally wide."""
        return max(16, self.room // self.cells), max(16, round(self.height - 10.2 * self.unit - self.below - self.margin))

    def edge_of(self, cell: int) -> int:
        """Left edge of a picture."""
        before = sum(self.widths[:cell]) if self.widths else cell * self.cell[0]
        return self.margin + before + cell * self.gap

    def middle_of(self, cell: int) -> float:
        """Middle of a picture."""
        return self.edge_of(cell) + (self.widths[cell] if self.widths else self.cell[0]) / 2

    @property
    def wave(self) -> tuple[float, float]:
        """Top and bottom of the waveform."""
        bottom = self.height - self.below
        return bottom - 5.4 * self.unit, bottom

    def x(self, time: float, duration: float) -> float:
        """Where a time in seconds lies on the axis."""
        return self.margin + (self.width - 2 * self.margin) * time / duration


def draw_strip(
    layout: StripLayout,
    pictures: Sequence[Pictures] | Pictures,
    times: Sequence[float],
    duration: float,
    sound: Sound | None = None,
    words: Sequence[Word] = (),
) -> Pictures:
    """Draw a strip, (H, W, 3).

    Args:
        pictures: N of (h, w, 3), of the height of ``layout.cell``, and of its width or that of ``layout.widths``.
        times: of the pictures, seconds from the beginning of the axis; each is written below its picture where there is room.
        duration: seconds that the axis spans.
        sound: drawn as a waveform where given.
        words: written below it where there is room, without accents; not in scripts other than Latin, for want of a font.
    """
    sheet = _curves(layout, times, duration, sound)
    pen = ImageDraw.Draw(sheet)
    small, tiny = ImageFont.load_default(1.35 * layout.unit), ImageFont.load_default(1.15 * layout.unit)
    free = 0.0
    for k, (picture, time) in enumerate(zip(pictures, times, strict=True)):
        sheet.paste(Image.fromarray(picture), (layout.edge_of(k), layout.margin))
        middle, text = layout.middle_of(k), _clock(layout.start + time, 2 if layout.start + duration < 600 else 0)
        half = small.getlength(text) / 2
        if middle - half >= free:  # where pictures are narrow, every second or third has its time
            pen.text((middle, layout.margin + layout.cell[1] + 1.3 * layout.unit), text, _INK, small, anchor="mm")
            free = middle + half + layout.unit
    _axis(pen, layout, duration, tiny)
    _words(pen, layout, duration, words, small)
    return np.asarray(sheet)


def _curves(layout: StripLayout, times: Sequence[float], duration: float, sound: Sound | None) -> Image.Image:
    """Draw the waveform, the axis and the lines from the pictures to it, with smooth edges."""
    big = Image.new("RGB", (layout.width * _SCALE, layout.height * _SCALE), _PAPER)
    pen = ImageDraw.Draw(big)
    top, bottom = (_SCALE * y for y in layout.wave)
    middle, half = (top + bottom) / 2, (bottom - top) / 2
    left, right = _SCALE * layout.x(0, duration), _SCALE * layout.x(duration, duration)
    line = max(1, round(0.10 * layout.unit * _SCALE))
    if sound is not None and len(sound.peak):
        x = np.arange(int(left), int(right) + 1)
        at = (x - left) / (right - left) * duration / sound.step
        loudest = max(float(sound.peak.max()), 1e-4)
        for values, colour in ((sound.peak, _PEAK), (sound.level, _BODY)):
            curve = _columns(values, at) if at[1] - at[0] > 1 else np.interp(at, np.arange(len(values)) + 0.5, values, right=0)
            height = np.maximum(curve / loudest * half, line / 2)
            outline = [*zip(x, middle - height, strict=True), *zip(x[::-1], middle + height[::-1], strict=True)]
            pen.polygon([(float(a), float(b)) for a, b in outline], fill=colour)
    pen.line([(left, bottom), (right, bottom)], _GREY, line)
    start = _SCALE * (layout.margin + layout.cell[1] + 2.3 * layout.unit)
    for k, time in enumerate(times):
        cell, there = _SCALE * layout.middle_of(k), _SCALE * layout.x(time, duration)
        pen.line([(cell, start), (there, top - 0.2 * layout.unit * _SCALE), (there, bottom)], _MARK, line, joint="curve")
        dot = 0.32 * layout.unit * _SCALE
        pen.ellipse([there - dot, bottom - dot, there + dot, bottom + dot], _MARK)
    return big.resize((layout.width, layout.height), Image.Resampling.BOX)


def _columns(values: Array, at: Array) -> Array:
    """The greatest of ``values`` between each of the positions ``at`` and the next; 0 beyond the end."""
    with_end = np.append(values, 0.0)
    low = np.clip(at.astype(int), 0, len(values))
    high = np.clip(np.append(low[1:], low[-1] + 1), low + 1, len(values) + 1)
    spans = np.stack([low, high], 1).ravel()
    return np.maximum.reduceat(np.append(with_end, 0.0), spans)[::2] * (low < len(values))


def _axis(
    pen: ImageDraw.ImageDraw, layout: StripLayout, duration: float, font: ImageFont.FreeTypeFont | ImageFont.ImageFont
) -> None:
    room = 6 * layout.unit  # pixels between two labels at least
    step = next((t for t in _TICKS if layout.x(t, duration) - layout.margin >= room), _TICKS[-1])
    bottom = layout.wave[1]
    first, last = ceil(layout.start / step - 1e-6), floor((layout.start + duration) / step + 1e-6)
    for k in range(first, last + 1):
        x = layout.x(k * step - layout.start, duration)
        pen.line([(x, bottom), (x, bottom + 0.5 * layout.unit)], _GREY, max(1, round(0.1 * layout.unit)))
        text = _clock(k * step, 1 if step < 1 else 0)
        side = "l" if x < 2 * layout.margin else ("r" if layout.width - x < 2 * layout.margin else "m")
        pen.text((x, bottom + 1.35 * layout.unit), text, _GREY, font, anchor=f"{side}m")


def _words(
    pen: ImageDraw.ImageDraw,
    layout: StripLayout,
    duration: float,
    words: Sequence[Word],
    font: ImageFont.FreeTypeFont | ImageFont.ImageFont,
) -> None:
    """Write each word where it is spoken, in the first row with room; words that do not fit are left out."""
    rows = [layout.wave[1] + (3.2 + 1.6 * row) * layout.unit for row in range(layout.rows)]
    free = [0.0] * len(rows)
    for word in words:
        text = _plain(word.text)
        if text is None or word.start >= duration:
            continue
        x = layout.x((word.start + min(word.end, duration)) / 2, duration)
        half = font.getlength(text) / 2
        for row, y in enumerate(rows):
            if x - half >= free[row] and x + half <= layout.width - 2:
                pen.text((x, y), text, _INK, font, anchor="mm")
                free[row] = x + half + 0.5 * layout.unit
                break


def _plain(word: str) -> str | None:
    """A word in the letters that Pillow's font has, ASCII: without accents; None where that leaves nothing to read."""
    apart = unicodedata.normalize("NFKD", word.replace("ß", "ss").replace("’", "'"))
    bare = "".join(letter for letter in apart if not unicodedata.combining(letter))
    return bare if bare.isascii() and bare.isprintable() else None


def _clock(seconds: float, digits: int) -> str:
    """Time for reading: 3.25 s, 2:05, 1:10:00."""
    if seconds < 60:
        return f"{seconds:.{digits}f} s"
    minutes, rest = divmod(seconds, 60)
    rest_text = f"{rest:0{3 + digits if digits else 2}.{digits}f}"
    return f"{int(minutes)}:{rest_text}" if minutes < 60 else f"{int(minutes) // 60}:{int(minutes) % 60:02d}:{rest_text}"
