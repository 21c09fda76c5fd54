"""Transcripts with times: each format has a module, and a row in `FORMATS`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from ..word_entries import Entry, Note
from . import elan, json_words, lyrics, subtitles, tables, textgrid, timed_text
from .tiers import Tier, find_word_tier

__all__ = ["FORMATS", "SUFFIXES", "TranscriptFormat", "find_format"]


class TranscriptFormat(NamedTuple):
    """How to recognise and read a format."""

    suffixes: tuple[str, ...]
    fits: Callable[[str], bool]
    """Whether a text whose suffix says nothing is of this format."""
    read: Callable[[str, Note], Iterable[Entry]]
    """Its entries, in any order; InputError says what is wrong, and a note what is left out or guessed."""
    read_tiers: Callable[[str], Sequence[Tier]] | None = None
    """All its tiers, where the format has some; then the user may name the one that counts."""


def _of_tiers(
    suffixes: tuple[str, ...], fits: Callable[[str], bool], read_tiers: Callable[[str], Sequence[Tier]]
) -> TranscriptFormat:
    """A format with tiers; its entries are those of the tier of words."""
    return TranscriptFormat(suffixes, fits, lambda text, note: find_word_tier(read_tiers(text), note), read_tiers)


FORMATS: dict[str, TranscriptFormat] = {
    "TextGrid": _of_tiers((".textgrid",), textgrid.fits, textgrid.read_tiers),
    "ELAN": _of_tiers((".eaf",), elan.fits, elan.read_tiers),
    "JSON": TranscriptFormat((".json", ".jsonl", ".marks"), json_words.fits, json_words.read),
    "TTML": TranscriptFormat((".ttml", ".dfxp"), timed_text.fits, timed_text.read),
    "SubRip, WebVTT": TranscriptFormat((".srt", ".vtt"), subtitles.fits, subtitles.read),
    "SubViewer": TranscriptFormat((".sbv",), subtitles.fits_sbv, subtitles.read_sbv),
    "LRC": TranscriptFormat((".lrc",), lyrics.fits, lyrics.read),
    "table": TranscriptFormat((".tsv", ".csv"), tables.fits, tables.read),
}
"""Name → format; where the suffix says nothing, the first that fits is read."""
SUFFIXES = (*(suffix for each in FORMATS.values() for suffix in each.suffixes), ".txt")
"""Suffixes of all transcripts, also of plain text."""


def find_format(suffix: str, text: str) -> TranscriptFormat | None:
    """The format of a suffix in small letters; where it says nothing, the first format that fits; None for plain text."""
    by_suffix = (each for each in FORMATS.values() if suffix in each.suffixes)
    return next(by_suffix, None) or next((each for each in FORMATS.values() if each.fits(text)), None)
