"""Azure Speech: events of word boundaries, as programs write them down, and the word files of batch synthesis.

https://learn.microsoft.com/azure/ai-services/speech-service/how-to-speech-synthesis ("Subscribe to synthesizer events") and
…/batch-synthesis. The SDKs name the fields in their own ways: ``audio_offset`` (Python), ``audioOffset`` and
``privAudioOffset`` (JavaScript), ``AudioOffset`` (C#). Offsets are in ticks of 100 ns. A duration is in ticks, too, in
JavaScript. Python and C# print it as 0:00:00.1375, and Python's ``total_seconds()`` gives seconds. Batch synthesis writes
``AudioOffset`` and ``Duration`` in milliseconds.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

from ...errors import InputError
from ..word_entries import Entry, check_number, check_text

__all__ = ["has_fields", "read"]

_TICK, _MILLISECOND = 1e-7, 1e-3  # seconds
_SECONDS = 100  # a duration below is in seconds: so many ticks are a hundredth of a millisecond [ours]
_CLOCK = re.compile(r"(\d{1,4}):(\d{1,2}):(\d{1,2}(?:\.\d{1,9})?)$")  # hours, minutes, seconds
_SENTENCE = 2  # of SpeechSynthesisBoundaryType, where a program writes its number


def has_fields(piece: Mapping[str, Any]) -> bool:
    """Whether an object has an offset in the audio."""
    return "audiooffset" in _fields(piece)


def read(pieces: Iterator[Mapping[str, Any]]) -> Iterator[Entry]:
    """The words; boundaries of sentences and visemes are left out, and so is punctuation, which has no letters.

    Raises:
        InputError: a field is missing or is not what it should be.
    """
    for piece in pieces:
        fields = _fields(piece)
        kind = fields.get("boundarytype", ("", None))[1]
        if "visemeid" in fields or kind == _SENTENCE or "sentence" in str(kind).lower():
            continue
        name, text = fields.get("text", ("text", None))
        word = check_text(text, name, "the SDK has it since version 1.21")
        name, offset = fields.get("audiooffset", ("audio_offset", None))
        length_name, length = fields.get("duration", ("duration", None))
        unit = _MILLISECOND if name == "AudioOffset" and not isinstance(length, str) else _TICK
        what = "milliseconds" if unit == _MILLISECOND else "ticks of 100 ns"
        start = check_number(offset, f"{name} of {word[:40]!r}", what) * unit
        yield word, start, start + _read_duration(length, f"{length_name} of {word[:40]!r}", unit, what)


def _fields(piece: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
    """Name in small letters, as all SDKs spell it → the name that it has here, and its value."""
    return {name.removeprefix("priv").replace("_", "").lower(): (name, value) for name, value in piece.items()}


def _read_duration(value: Any, name: str, unit: float, what: str) -> float:
    """Seconds."""
    if isinstance(value, str):
        match = _CLOCK.match(value)
        if match is None:
            raise InputError(f"{name} is {value[:40]!r}", f"{what}, or a text such as 0:00:00.1375")
        return int(match[1]) * 3600 + int(match[2]) * 60 + float(match[3])
    number = check_number(value, name, what)
    return number if unit == _TICK and number < _SECONDS else number * unit
