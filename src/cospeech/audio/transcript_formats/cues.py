"""Cues of subtitles, and what is new in each: where lines roll or grow, a cue repeats what the one before showed."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

__all__ = ["INLINE_TIME", "Cue", "plain_text", "unroll"]

INLINE_TIME = re.compile(r"<((?:\d{1,4}:)?\d{1,2}:\d{1,2}\.\d{1,9})>")
"""A time inside a cue, as WebVTT has them before words."""
_NO_CHARACTER = re.compile(r"&#\d{8,};?")  # beyond all of Unicode
_TAG = re.compile(r"<[^<>\n]*>")
_BREAK = re.compile(r"\\[Nnh]|\[br\]")  # of SubStation Alpha and of SubViewer
_AT_ONCE = 0.1  # s: a cue that is shorter shows nothing new, and one that begins so soon follows at once [ours; YouTube: 0.01]
_PAUSE = 2.0  # s without a cue, after which nothing is shown again [ours: converters leave gaps of some 0.1 s]
_ROLLING = 1 / 3  # of the cues that begin with a line that was shown, from which on the lines roll [ours]
_GROWING = 1 / 2  # the same for words, which people repeat more often than lines [ours]
_GROWING_LEAST = 4  # cues that begin with words that were shown, below which it may be chance [ours]
_WORDS_SHOWN = 60  # words that are compared; three lines have some 25 [ours]


class Cue(NamedTuple):
    """Lines that are shown from ``start`` to ``end``, seconds."""

    lines: list[str]
    start: float
    end: float


def plain_text(line: str) -> str:
    """A line without tags, with the characters that its references stand for."""
    text = _BREAK.sub(" ", _TAG.sub("", line))
    return html.unescape(_NO_CHARACTER.sub("\ufffd", text)).replace("\n", " ")


def unroll(cues: Sequence[Cue]) -> list[Cue]:
    """Cues with what is new in each.

    Lines roll where the first lines of a cue are the last of the cue before. Words grow where a cue begins with the last words
    of the cue before, as captions of live programmes do, and rolling lines that a converter has put into one.
    """
    cues = [cue._replace(lines=[line for line in cue.lines if line.strip()] or [""]) for cue in cues]
    if len(cues) < 2:  # nothing was shown before
        return cues
    by_line = _drop_repeats(cues, lambda cue: [plain_text(line).strip() for line in cue.lines], _drop_lines)
    if by_line.repeats > _ROLLING * len(cues):
        return by_line.cues
    if any(INLINE_TIME.search(line) for cue in cues for line in cue.lines):
        return cues
    by_word = _drop_repeats(cues, lambda cue: " ".join(map(plain_text, cue.lines)).split()[-_WORDS_SHOWN:], _drop_words)
    return by_word.cues if by_word.repeats >= max(_GROWING_LEAST, _GROWING * len(cues)) else cues


class _Fresh(NamedTuple):
    cues: list[Cue]
    repeats: int
    """Cues that began with something that was shown."""


def _drop_repeats(cues: Sequence[Cue], list_units: Callable[[Cue], list[str]], drop: Callable[[Cue, int], list[str]]) -> _Fresh:
    """Cues without the units, lines or words, that the cue before showed.

    Args:
        cues: in order.
        list_units: gives the units that a cue shows.
        drop: gives the lines of a cue without so many of its first units.
    """
    fresh, count = list[Cue](), 0
    before, until = list[str](), -2 * _PAUSE
    for cue in cues:
        units = list_units(cue)
        again = _count_again(before, units) if cue.start - until <= _PAUSE else 0
        is_held = cue.end - cue.start <= _AT_ONCE and abs(cue.start - until) <= _AT_ONCE
        if again and (again < len(units) or is_held):
            fresh.append(cue._replace(lines=drop(cue, again) or [""]))
            count += 1
        else:
            fresh.append(cue)
        before, until = units, cue.end
    return _Fresh(fresh, count)


def _count_again(before: Sequence[str], units: Sequence[str]) -> int:
    """How many of the first units repeat the last ones of the cue before."""
    most = min(len(before), len(units))
    counts = (n for n in range(most, 0, -1) if before[-n] == units[0])
    return next((n for n in counts if before[-n:] == units[:n] and any(units[:n])), 0)


def _drop_lines(cue: Cue, count: int) -> list[str]:
    return cue.lines[count:]


def _drop_words(cue: Cue, count: int) -> list[str]:
    lines = list[str]()
    for line in cue.lines:
        words = plain_text(line).split()
        lines += [" ".join(words[count:])] if words[count:] else []
        count = max(0, count - len(words))
    return lines
