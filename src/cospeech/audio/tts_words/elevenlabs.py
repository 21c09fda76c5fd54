"""ElevenLabs: the times of characters, of a whole speech or of the pieces of a stream.

https://elevenlabs.io/docs/api-reference/text-to-speech/convert-with-timestamps and …/stream-with-timestamps. Each object has
``alignment``, of the text that was sent, and ``normalized_alignment``, of the text that is spoken: "5" becomes "five". The
times of all pieces of a stream count from its beginning.

Messages of the WebSocket (…/api-reference/text-to-speech/v-1-text-to-speech-voice-id-stream-input) have other names, and
milliseconds that count from the beginning of each message's sound. A message's sound ends where its last character ends.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from ...errors import InputError
from ..forced_alignment import ENDS, UNSPACED
from ..word_entries import Entry, check_number

__all__ = ["has_fields", "read"]

_ALIGNMENTS = ("normalized_alignment", "normalizedAlignment", "alignment")  # the spoken text first: lips follow it
_SHORT, _STARTS_MS, _LONG_MS = "chars", "charStartTimesMs", ("charDurationsMs", "charsDurationsMs")  # both are seen
_CHARACTERS, _STARTS, _ENDS = "characters", "character_start_times_seconds", "character_end_times_seconds"
_SIGN = re.compile(f"[{UNSPACED}]")  # of a script without blanks: a word of its own
_BACK = 0.05  # seconds by which a time may be before the one ahead of it [ours: times are rounded to milliseconds]


def has_fields(piece: Mapping[str, Any]) -> bool:
    """Whether an object has an alignment, or is one."""
    has_name = any(name in piece for name in ("audio_base64", "isFinal", _STARTS, _STARTS_MS))
    return has_name or any(isinstance(piece.get(name), dict) for name in _ALIGNMENTS)


def read(pieces: Iterator[Mapping[str, Any]]) -> Iterator[Entry]:
    """The words between blanks. A word that a piece cuts goes on with the next one.

    Raises:
        InputError: a field is missing or is not what it should be, arrays differ in length, or times go back.
    """
    word, start, end = "", 0.0, 0.0
    for piece in pieces:
        for character, begin, finish in _characters(piece, end):
            if begin < end - _BACK:
                problem = f"{_STARTS} goes back from {end:g} to {begin:g} s"
                raise InputError(problem, "the times of several requests do not count from one beginning: add what came before")
            if word and (character.isspace() or _SIGN.match(character)):
                yield word, start, end
                word = ""
            if not character.isspace():
                start, word = start if word else begin, word + character
            end = finish
        if word and word[-1] in ENDS:  # the piece does not cut a word
            yield word, start, end
            word = ""
    if word:
        yield word, start, end


def _characters(piece: Mapping[str, Any], before: float) -> Iterator[tuple[str, float, float]]:
    """Character, start and end in seconds; of a piece without an alignment, none.

    Args:
        piece: an object.
        before: seconds of the pieces before it.
    """
    name = next((name for name in _ALIGNMENTS if piece.get(name) is not None), None)
    alignment = piece if name is None else piece[name]
    if name is None and not any(field in piece for field in (_CHARACTERS, _STARTS, _ENDS, _STARTS_MS)):
        return
    where = "the alignment" if name is None else name
    if not isinstance(alignment, dict):
        raise InputError(f"{where} is {str(alignment)[:40]!r}", f"an object with {_CHARACTERS}, {_STARTS} and {_ENDS}")
    if _STARTS_MS in alignment or _SHORT in alignment:
        long = next((field for field in _LONG_MS if field in alignment), _LONG_MS[0])
        yield from _read_message(alignment, where, (_SHORT, _STARTS_MS, long), before)
        return
    lists = _read_lists(alignment, where, (_CHARACTERS, _STARTS, _ENDS))
    for k, (character, start, end) in enumerate(zip(*lists, strict=True)):
        if not isinstance(character, str):
            raise InputError(f"{_CHARACTERS}[{k}] of {where} is {str(character)[:40]!r}", "a character belongs there")
        begin = check_number(start, f"{_STARTS}[{k}] of {where}", "seconds")
        finish = check_number(end, f"{_ENDS}[{k}] of {where}", "seconds")
        if finish < begin:
            raise InputError(f"{_ENDS}[{k}] of {where} is {finish:g}, before its start at {begin:g}", "seconds")
        yield character, begin, finish


def _read_message(
    alignment: Mapping[str, Any], where: str, fields: tuple[str, str, str], before: float
) -> Iterator[tuple[str, float, float]]:
    """Character, start and end in seconds of a message of the WebSocket."""
    for k, (character, start, long) in enumerate(zip(*_read_lists(alignment, where, fields), strict=True)):
        if not isinstance(character, str):
            raise InputError(f"{fields[0]}[{k}] of {where} is {str(character)[:40]!r}", "a character belongs there")
        begin = before + check_number(start, f"{fields[1]}[{k}] of {where}", "milliseconds") / 1000
        yield character, begin, begin + check_number(long, f"{fields[2]}[{k}] of {where}", "milliseconds") / 1000


def _read_lists(alignment: Mapping[str, Any], where: str, fields: tuple[str, str, str]) -> list[list[Any]]:
    """The lists of an alignment, which are of one length.

    Raises:
        InputError: one is missing, is no list, or has another length.
    """
    lists = list[list[Any]]()
    for field in fields:
        if not isinstance(alignment.get(field), list):
            problem = (
                f"{field} of {where} is {str(alignment[field])[:40]!r}" if field in alignment else f"{where} has no {field}"
            )
            raise InputError(problem, "a list belongs there")
        lists.append(alignment[field])
        if len(lists[-1]) != len(lists[0]):
            problem = f"{field} of {where} has {len(lists[-1])} values, and {fields[0]} has {len(lists[0])}"
            raise InputError(problem, "one for each character")
    return lists
