"""LRC, the lyrics of music players: ``[00:12.50]What is sung``, with times of words, ``<00:12.90>``, where they are known.

There is no standard; https://en.wikipedia.org/wiki/LRC_(file_format) describes what players read. A line lasts until the next.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from io import StringIO
from itertools import islice, pairwise

from ...errors import InputError, say_count
from ...limits import WORDS
from ..forced_alignment import count_syllables, tokenise
from ..word_entries import Entry, Note, read_clock

__all__ = ["fits", "read"]

_TIME = r"\d{1,3}:\d{1,2}(?:[.:]\d{1,3})?"
_STAMPS = re.compile(rf"\s*+((?:\[{_TIME}\]\s*+)++)(.*+)")
_EXACT = re.compile(r"\s*+\[\d{1,3}:\d{1,2}\.\d{1,3}\]")
_STAMP = re.compile(rf"\[({_TIME})\]")
_WORD = re.compile(rf"<({_TIME})>")
_OFFSET = re.compile(r"\s*+\[offset:\s*+([+-]?\d{1,9})\s*+\]\s*+", re.IGNORECASE)
_FACT = re.compile(r"\s*+\[[a-zA-Z#_]{1,20}:.*+")  # [ar:…], [ti:…], [length:…]
_SYLLABLE = 1.0  # seconds of a syllable, at most, where nothing says when a line ends [ours: slow singing]


def fits(text: str) -> bool:
    """Whether the first line that is no fact about the song begins with a time in brackets: [00:12.50], and no [00:12:50]."""
    lines = (line for line in StringIO(text) if not line.isspace() and not _FACT.match(line))
    return _EXACT.match(next(lines, "")) is not None


def read(text: str, note: Note) -> Iterator[Entry]:
    """The lines of a song, or its words where they have times. A line with several times is sung several times.

    Raises:
        InputError: no line has a time.
    """
    lines, shift, others = list[tuple[float, str]](), 0.0, list[str]()
    for line in StringIO(text):
        offset, stamps = _OFFSET.match(line), _STAMPS.match(line)
        if offset:
            shift = int(offset[1]) / 1000  # above 0: everything comes sooner
        elif stamps:
            lines += [(_read_stamp(stamp), stamps[2]) for stamp in islice(_STAMP.findall(stamps[1]), 2 * WORDS)]
            if len(lines) >= 2 * WORDS:
                raise InputError(f"a transcript of more than {WORDS:,} words", "cut it into pieces")
        elif not line.isspace() and not _FACT.match(line):
            others.append(line.strip()[:60])
    if not lines:
        raise InputError("no line of the lyrics has a time", "[00:12.50] belongs before each")
    if others:
        note(f"{len(others)} of {len(others) + len(lines)} lines left out, they have no time: {others[0]!r}")
    lines.sort(key=lambda line: line[0])
    unique = [
        line
        for before, line in pairwise([(-1.0, ""), *lines])
        if line[0] != before[0] or not line[1].strip() or not before[1].strip()
    ]
    if len(unique) < len(lines):
        count = say_count(len(lines) - len(unique), "line")
        note(f"{count} left out: another one has the same time, as of a translation")
    lines = unique
    for (start, words), (until, _) in pairwise([*lines, (float("inf"), "")]):
        yield from _read_words(words, start - shift, until - shift, shift)


def _read_words(line: str, start: float, until: float, shift: float) -> Iterator[Entry]:
    """A line as an entry, or each part of it that has a time."""
    parts = _WORD.split(line)
    times = [start, *(_read_stamp(time) - shift for time in parts[1::2])]
    if any(after < before for before, after in pairwise(times)):  # sung again: its words have the times of the first time
        parts, times = [_WORD.sub(" ", line)], [start]
    for part, (begin, end) in zip(parts[::2], pairwise([*times, until]), strict=True):
        longest = _SYLLABLE * sum(map(count_syllables, tokenise(part)))
        yield part, begin, max(begin, min(end, begin + longest))


def _read_stamp(stamp: str) -> float:
    """Seconds; hundredths may stand behind a colon. It matches `_TIME`, so that it is a time."""
    minutes, _, rest = stamp.partition(":")
    return read_clock(f"{minutes}:{rest.replace(':', '.')}") or 0.0
