"""Read who speaks when in one recording: from RTTM, JSON of recognisers, or subtitles with names.

Programs that tell speakers apart (diarisation) write these files; nothing here does.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..files import parse_json, read_regular
from ..limits import TRANSCRIPT_BYTES, TRANSCRIPT_JSON_VALUES
from .prosodic_events import Phrase
from .transcript_formats import subtitles
from .transcript_formats.text_files import decode
from .word_entries import read_clock, read_google_time, read_time

__all__ = ["read_speakers"]

_NAME_KEYS = ("speaker", "speaker_label", "speaker_id", "speakerId", "speakerTag", "speaker_tag", "spk")
_START_KEYS = ("start", "start_time", "startTime", "begin", "ts", "offsetInTicks", "offset")
_END_KEYS = ("end", "end_time", "endTime", "stop", "end_ts")
_LENGTH_KEYS = ("duration", "durationInTicks", "dur")
_UNITS = (1.0, 1e-3, 1e-7)  # seconds, milliseconds, ticks
_LATER = 1.2  # lengths of the sound up to which times are believed [ours: a wrong unit is off by 1,000]
_JOINS = 0.5  # s; stretches of a speaker that are closer are joined [ours: recognisers give words, with breaths between them]
_DEEP = 12  # levels of JSON [ours: documents of recognisers have six]
_RTTM = re.compile(r"^SPEAKER[ \t]+\S*[^\s:][ \t]+\d+\s", re.MULTILINE)  # no label of a subtitle: SPEAKER 1: Hello
_HINT = "RTTM, the JSON of a recogniser that names speakers, or subtitles with names (`<v Anna>`, `ANNA: Hello`)"

_Stretch = tuple[str, float, float]


def read_speakers(path: str | PathLike[str], seconds: float | None = None) -> dict[str, tuple[Phrase, ...]]:
    """Read who speaks when.

    Args:
        path: ``.rttm``; ``.json`` in which words, segments or utterances have a speaker and times, of WhisperX, Deepgram,
            AssemblyAI, AWS Transcribe, Azure, Google, Speechmatics, Rev and others; ``.srt`` or ``.vtt`` with names.
        seconds: length of the sound; it shows whether times are in seconds or in milliseconds.

    Returns:
        Name → stretches in order, without overlaps; the first speaker comes first.

    Raises:
        InputError: the file cannot be read, or names nobody.
    """
    name = Path(os.fsdecode(path)).name
    text = decode(read_regular(path, "a file that says who speaks", TRANSCRIPT_BYTES), name)
    if _RTTM.search(text):
        stretches = list(_read_rttm(text, name))
    elif text.lstrip()[:1] in ("{", "["):
        stretches = _scale(list(_walk(parse_json(text, repr(name), TRANSCRIPT_JSON_VALUES), None)), seconds)
    elif subtitles.fits(text):
        stretches = list(subtitles.name_speakers(text, lambda message: None))
    else:
        stretches = []
    if not stretches:
        raise InputError(f"{name!r} does not say who speaks when", _HINT)
    speakers: dict[str, list[Phrase]] = {}
    for who, start, end in sorted(stretches, key=lambda each: each[1:]):
        phrases = speakers.setdefault(who, [])
        if phrases and start <= phrases[-1].end + _JOINS:
            phrases[-1] = Phrase(phrases[-1].start, max(phrases[-1].end, end))
        else:
            phrases.append(Phrase(start, end))
    return {who: tuple(phrases) for who, phrases in speakers.items()}


def _read_rttm(text: str, name: str) -> Iterator[_Stretch]:
    """NIST's Rich Transcription Time Marked: type, file, channel, onset, duration, two fields, name."""
    for number, line in enumerate(text.splitlines(), 1):
        fields = line.split()
        if not fields or fields[0] != "SPEAKER":
            continue
        if len(fields) < 8:
            raise InputError(f"line {number} of {name!r} has {len(fields)} fields", "SPEAKER file 1 0.5 2.1 <NA> <NA> name")
        start, length = read_time(fields[3]), read_time(fields[4])
        if start >= 0 and length > 0:
            yield fields[7], start, start + length


def _walk(node: Any, speaker: str | None, depth: int = 0) -> Iterator[_Stretch]:
    """Stretches of all objects that have times and a speaker: their own, or that of the object around them."""
    if depth > _DEEP:
        return
    if isinstance(node, list):
        for each in node:
            yield from _walk(each, speaker, depth + 1)
    elif isinstance(node, dict):
        own = next((node[key] for key in _NAME_KEYS if _is_name(node.get(key))), None)
        speaker = speaker if own is None else str(own)
        start, end = _find_time(node, _START_KEYS), _find_time(node, _END_KEYS)
        if start is not None and end is None and (length := _find_time(node, _LENGTH_KEYS)) is not None:
            end = start + length
        if speaker is not None and start is not None and end is not None and end > start >= 0:
            yield speaker, start, end
        for each in node.values():
            yield from _walk(each, speaker, depth + 1)


def _is_name(value: object) -> bool:
    return isinstance(value, str | int) and not isinstance(value, bool) and str(value).strip() != ""


def _find_time(node: Mapping[str, Any], keys: tuple[str, ...]) -> float | None:
    """The first of these fields that is a time: a number, or a text such as 1.25, 1.25s or 00:00:01.250."""
    for key in keys:
        value = node.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            continue
        try:
            clock = read_clock(value) if isinstance(value, str) else None
            return read_google_time(value) if clock is None else clock
        except InputError:
            continue
    return None


def _scale(stretches: list[_Stretch], seconds: float | None) -> list[_Stretch]:
    """Stretches in seconds, by the first unit that fits the length of the sound."""
    last = max((end for _, _, end in stretches), default=0.0)
    unit = next((unit for unit in _UNITS if seconds is None or last * unit <= _LATER * seconds), 1.0)
    return [(who, start * unit, end * unit) for who, start, end in stretches]
