"""Amazon Polly: speech marks, one on each line.

https://docs.aws.amazon.com/polly/latest/dg/output.html. ``time`` is in milliseconds. ``start`` and ``end`` are no times: they
are bytes of the text. A mark does not say when a word ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ...errors import InputError
from ..forced_alignment import count_syllables
from ..word_entries import Entry, check_number, check_text

__all__ = ["has_fields", "read"]

_TYPES = ("word", "sentence", "viseme", "ssml")
_MILLISECOND = 1e-3  # seconds
_SYLLABLE = 0.3  # seconds of a syllable, at most [ours: a fifth of a second is usual, and before a pause they are longer]


def has_fields(piece: Mapping[str, Any]) -> bool:
    """Whether an object has a time and a type."""
    return "time" in piece and "type" in piece


def read(pieces: Iterator[Mapping[str, Any]]) -> Iterator[Entry]:
    """The words. A word ends where the next one begins; before a pause it is as long as its syllables need.

    Raises:
        InputError: a field is missing or is not what it should be.
    """
    for piece in pieces:
        kind = piece.get("type")
        if kind not in _TYPES:
            raise InputError(f"type is {str(kind)[:40]!r}" if kind is not None else "a mark has no type", ", ".join(_TYPES))
        if kind == "word":
            word = check_text(piece.get("value"), "value", "the word belongs there")
            start = check_number(piece.get("time"), f"time of {word[:40]!r}", "milliseconds") * _MILLISECOND
            yield word, start, start + _SYLLABLE * count_syllables(word)
