"""TTML (.ttml, .dfxp), the subtitles of broadcasters and streaming services: https://www.w3.org/TR/ttml1/.

Paragraphs have times; those of spans in them are read, too, as lyrics have them for each word.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from ...errors import InputError
from ...limits import WORDS
from ..word_entries import Entry, Note, read_clock
from .cues import Cue
from .subtitles import say_cues
from .xml_stream import compile_head, parse_xml

__all__ = ["fits", "read"]

_HEAD = compile_head("tt")
_OFFSET = re.compile(r"(\d{1,12}(?:\.\d{1,12})?)(h|m|s|ms|f|t)")
_FRAMES = re.compile(r"(\d{1,4}:\d\d:\d\d)[:;](\d{1,4})(?:\.\d+)?")
_SECONDS = {"h": 3600.0, "m": 60.0, "s": 1.0, "ms": 0.001}
_RATE = 30.0  # frames a second where the document says none (TTML 1, 6.2.4)
_SPACE = re.compile(r"\s+")
_TOLERANCE = 0.001  # seconds; times have milliseconds
_DEPTH = 200  # elements in each other; documents have some six [ours]
_HINT = 'each <p> needs begin and end, such as begin="00:00:01.500" end="00:00:03.000"'


def fits(text: str) -> bool:
    """Whether a text is XML whose first element is tt."""
    return _HEAD.match(text[:10_000]) is not None


def read(text: str, note: Note) -> Iterator[Entry]:
    """The texts of the paragraphs.

    Raises:
        InputError: it is no XML, has a document type or elements nested too deeply, or no paragraph has times.
    """
    document = _Document()
    parse_xml(text, document, "TTML")
    if not document.cues:
        raise InputError("no paragraph has times", _HINT)
    if document.loss_count:
        note(f"{document.loss_count} of {document.loss_count + document.paragraphs} paragraphs left out, they have no times")
    return say_cues(document.cues)


class _Element(NamedTuple):
    """An element that is open: its name, the time from which its times count, and its own times."""

    name: str
    origin: float
    start: float | None
    end: float | None


class _Document:
    """Collects cues while a document streams by."""

    def __init__(self) -> None:
        self.cues: list[Cue] = []
        self.loss_count = self.paragraphs = self._count = 0
        self._open: list[_Element] = []
        self._parts: list[Cue] = []  # of the paragraph: text outside of spans with times, and inside; times as they stand
        self._rates: tuple[float, float] = _RATE, 1.0
        self._paragraph: _Element | None = None

    def open(self, tag: str, attributes: Mapping[str, str]) -> None:
        name, origin = tag.rpartition(":")[2], self._open[-1].origin if self._open else 0.0
        self._count += 1
        if len(self._open) >= _DEPTH or self._count > 4 * WORDS:
            fault = "nested too deeply" if len(self._open) >= _DEPTH else f"more than {4 * WORDS:,}"
            raise InputError(f"XML in which elements are {fault}", "is it TTML?")
        if not self._open:
            self._rates = _read_rates({key.rpartition(":")[2]: value for key, value in attributes.items()})
        start, end, length = (self._read_time(attributes.get(key)) for key in ("begin", "end", "dur"))
        if end is None and length is not None:
            end = (start or 0.0) + length
        if name == "br":
            self._add("\n")
        elif name == "p":
            self._paragraph, self._parts = _Element(name, origin, start, end), []
        elif self._paragraph is None:  # body, div: times inside count from its beginning
            origin += start or 0.0
        elif name == "span" and start is not None and end is not None:
            self._parts.append(Cue([""], start, end))
        self._open.append(_Element(name, origin, start, end))

    def close(self, tag: str) -> None:
        element = self._open.pop()
        if element.name == "p" and self._paragraph is not None:
            self._end_paragraph(self._paragraph)
            self._paragraph = None
        elif element.name == "span" and element.start is not None and self._paragraph is not None:
            self._parts.append(Cue([""], -1.0, -1.0))  # what comes behind it has no times

    def hear(self, text: str) -> None:
        """Add text. A line break of the document is none of the subtitle."""
        self._add(text.replace("\n", " "))

    def _add(self, text: str) -> None:
        if self._paragraph is None:
            return
        if not self._parts:
            self._parts.append(Cue([""], -1.0, -1.0))
        self._parts[-1].lines.append(text)

    def _end_paragraph(self, paragraph: _Element) -> None:
        parts = [part._replace(lines=_split_lines("".join(part.lines))) for part in self._parts]
        parts = [part for part in parts if any(map(str.strip, part.lines))]
        has_times = bool(parts) and all(part.start >= 0 for part in parts)
        if not has_times:
            if paragraph.start is None or paragraph.end is None:
                self.loss_count += bool(parts)
                return
            lines = [line for part in parts for line in part.lines]
            parts = [Cue(lines or [""], paragraph.start, paragraph.end)]
        elif paragraph.start and not _lies_inside(
            parts, paragraph
        ):  # times of spans count from their paragraph's, as TTML has it
            parts = [part._replace(start=part.start + paragraph.start, end=part.end + paragraph.start) for part in parts]
        self.paragraphs += 1
        self.cues += [part._replace(start=part.start + paragraph.origin, end=part.end + paragraph.origin) for part in parts]
        if len(self.cues) > 2 * WORDS:
            raise InputError(f"more than {2 * WORDS:,} subtitles", "cut it into pieces")

    def _read_time(self, text: str | None) -> float | None:
        """Seconds; None without a time.

        Raises:
            InputError: it is no time.
        """
        if text is None:
            return None
        text = text.strip()
        clock, offset, frames = read_clock(text), _OFFSET.fullmatch(text), _FRAMES.fullmatch(text)
        if clock is not None:
            return clock
        frame_rate, tick_rate = self._rates
        if frames is not None:
            return (read_clock(frames[1]) or 0.0) + int(frames[2]) / frame_rate
        if offset is None:
            raise InputError(f"{text[:40]!r} is not a time", _HINT)
        number, unit = float(offset[1]), offset[2]
        return number * _SECONDS[unit] if unit in _SECONDS else number / (frame_rate if unit == "f" else tick_rate)


def _lies_inside(parts: Sequence[Cue], paragraph: _Element) -> bool:
    """Whether times of spans count from the start of the document, as some programs write them: all lie in the paragraph."""
    early = min(part.start for part in parts) < (paragraph.start or 0.0) - _TOLERANCE
    return not early and (paragraph.end is None or max(part.end for part in parts) <= paragraph.end + _TOLERANCE)


def _split_lines(text: str) -> list[str]:
    """Lines; a run of blanks, as in an indented document, becomes one blank."""
    return [_SPACE.sub(" ", line) for line in text.split("\n")]


def _read_rates(attributes: Mapping[str, str]) -> tuple[float, float]:
    """Frames and ticks a second.

    Raises:
        InputError: one is no number above 0.
    """
    try:
        frames = float(attributes.get("frameRate", _RATE))
        over, under = (float(each) for each in attributes.get("frameRateMultiplier", "1 1").replace(":", " ").split())
        ticks = float(attributes["tickRate"]) if "tickRate" in attributes else (frames if "frameRate" in attributes else 1.0)
        rates = frames * over / under, ticks
    except (ValueError, ZeroDivisionError):
        raise InputError("its rates are no numbers", 'such as ttp:frameRate="25" ttp:tickRate="10000000"') from None
    if not all(0 < rate < 1e12 for rate in rates):
        raise InputError("its rates make no sense", 'such as ttp:frameRate="25" ttp:tickRate="10000000"')
    return rates
