"""Cartesia: messages of its WebSocket, and events of its SSE interface, with ``add_timestamps``.

https://docs.cartesia.ai/api-reference/tts/websocket. A message with ``word_timestamps`` has three lists of one length: words,
start and end, in seconds from the beginning of the context. Messages with sound and others say nothing about words.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ...errors import InputError
from ..word_entries import Entry, check_number, check_text

__all__ = ["has_fields", "read"]

_ALIGNMENT, _LISTS = "word_timestamps", ("words", "start", "end")


def has_fields(piece: Mapping[str, Any]) -> bool:
    """Whether an object has times of words, or belongs to a context."""
    return isinstance(piece.get(_ALIGNMENT), dict) or ("context_id" in piece and "type" in piece)


def read(pieces: Iterator[Mapping[str, Any]]) -> Iterator[Entry]:
    """The words of each message.

    Raises:
        InputError: a list is missing, or has another length, or a value is not what it should be.
    """
    for piece in pieces:
        times = piece.get(_ALIGNMENT)
        if times is None:
            continue
        if not isinstance(times, dict):
            raise InputError(f"{_ALIGNMENT} is {str(times)[:40]!r}", f"an object with {', '.join(_LISTS)}")
        words, starts, ends = (_read_list(times, name) for name in _LISTS)
        if not len(words) == len(starts) == len(ends):
            problem = f"{_ALIGNMENT} has {len(words)} words, {len(starts)} starts and {len(ends)} ends"
            raise InputError(problem, "one value for each word")
        for word, start, end in zip(words, starts, ends, strict=True):
            text = check_text(word, "a word", "a text belongs there")
            label = repr(text[:40])
            yield text, check_number(start, f"start of {label}", "seconds"), check_number(end, f"end of {label}", "seconds")


def _read_list(times: Mapping[str, Any], name: str) -> list[Any]:
    values = times.get(name)
    if not isinstance(values, list):
        raise InputError(f"{_ALIGNMENT} has no list {name}", "one value for each word")
    return values
