"""TextGrid of Praat, long or short: https://www.fon.hum.uva.nl/praat/manual/TextGrid_file_formats.html."""

from __future__ import annotations

import re
from collections.abc import Iterator

from ...errors import InputError
from ...limits import WORDS
from ..word_entries import Entry
from .tiers import Tier

__all__ = ["fits", "read_tiers"]


def fits(text: str) -> bool:
    """Whether a text begins as a TextGrid does."""
    return "ooTextFile" in text.lstrip()[:400]


# "++", "*+": what was taken is not given back, so that each character is looked at once
_TOKEN = re.compile(r'"([^"]*+(?:""[^"]*+)*+)"|(<[a-z]++>)|![^\n]*+|[^\s"]++')
_NUMBER = re.compile(r"[+-]?(?:\d++(?:\.\d*+)?|\.\d++)(?:[eE][+-]?\d++)?$")


def read_tiers(text: str) -> list[Tier]:
    """The tiers of intervals. Only free-standing numbers, quoted strings and <flags> count, as in Praat itself.

    Raises:
        InputError: it is no TextGrid, is cut off, or has no tier of intervals.
    """
    values: Iterator[str | float] = _praat_values(text)

    def take(kind: type) -> str | float:
        value = next(values, None)
        if value is None or not isinstance(value, kind):
            value_name = "its end" if value is None else repr(value)[:40]
            raise InputError(
                f"a TextGrid with {value_name} where a {'text' if kind is str else 'number'} belongs", "is it cut off?"
            )
        return value

    if (take(str), take(str)) != ("ooTextFile", "TextGrid"):
        raise InputError("not a TextGrid: no 'ooTextFile', 'TextGrid' at its head", "save it as text from Praat")
    take(float), take(float)
    if take(str) != "<exists>":
        raise InputError("a TextGrid without tiers", "add a word tier")
    tiers: list[Tier] = []
    read = 0
    for _ in range(_count(take(float))):
        kind, name = str(take(str)), str(take(str))
        take(float), take(float)
        entries: list[Entry] = []
        for _ in range(_count(take(float))):
            read += 1
            if read > 4 * WORDS:  # a word and the sounds that it is made of
                raise InputError(f"a TextGrid of more than {4 * WORDS:,} entries", "cut it into pieces")
            start = float(take(float))
            end = float(take(float)) if kind == "IntervalTier" else start
            entries.append((str(take(str)), start, end))
        if kind == "IntervalTier":
            tiers.append(Tier(name, entries))
    if not tiers:
        raise InputError("a TextGrid without an interval tier", "words have a start and an end")
    return tiers


def _praat_values(text: str) -> Iterator[str | float]:
    for match in _TOKEN.finditer(text):
        if match[1] is not None:
            yield match[1].replace('""', '"')
        elif match[2]:
            yield match[2]
        elif _NUMBER.match(match[0]):
            yield float(match[0])


def _count(number: str | float) -> int:
    if not (isinstance(number, float) and 0 <= number < 1e8 and number == int(number)):
        raise InputError(f"a TextGrid that announces {number} entries", "is it damaged?")
    return int(number)
