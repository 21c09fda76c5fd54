"""JSON of recognisers whose words have no plain ``start`` and ``end``, or lie deep in the document; each has a row in `SHAPES`.

The names of the fields show which recogniser it is. Other documents are read by the names that most recognisers share
(`cospeech.audio.word_json`). Nothing here calls a recogniser.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from ..errors import InputError
from .forced_alignment import count_syllables
from .word_entries import Entry, check_number, check_text, read_google_time, read_time

__all__ = ["SHAPES", "Shape"]

Document = Mapping[str, Any]
_MILLISECOND, _TICK = 1e-3, 1e-7  # seconds
_LONG = 20.0  # whole numbers are milliseconds if words are longer than this on the mean [ours]
_SYLLABLE = 0.3  # seconds of a syllable, at most, where an end is missing [ours, as of `tts_words.polly`]
_HINT = "a list of words with times"
_SPECIAL = re.compile(r"\s*\[_[A-Z]+_?\d*_?\]")  # tokens of whisper.cpp that are no text: [_BEG_], [_TT_150]


class Shape(NamedTuple):
    """How to recognise and read the document of a recogniser."""

    has_fields: Callable[[Document], bool]
    """Whether a document has the names of its fields."""
    read: Callable[[Document], Iterator[Entry]]
    """Its words; InputError names the field that is wrong."""


def _rows(value: object, name: str) -> list[Document]:
    """The objects of a list.

    Raises:
        InputError: it is no list, or one is no object.
    """
    if not isinstance(value, list):
        raise InputError(f"{name} is {str(value)[:40]!r}", "a list belongs there")
    for each in value:
        if not isinstance(each, dict):
            raise InputError(f"{str(each)[:40]!r} in {name}", "a JSON object belongs there")
    return value


def _best(row: Document) -> Document:
    """The first alternative of a row; an empty one where there is none."""
    return next(iter(_rows(row.get("alternatives", []), "alternatives")), {})


def _is_row(value: object, *names: str) -> bool:
    """Whether a value is a list whose first object has one of these names."""
    first = value[0] if isinstance(value, list) and value else None
    return isinstance(first, dict) and any(name in first for name in names)


def _read_whisper_cpp(document: Document) -> Iterator[Entry]:
    """https://github.com/ggml-org/whisper.cpp, ``--output-json``; with ``-full`` there are tokens, which are parts of words."""
    for row in _rows(document["transcription"], "transcription"):
        tokens = _rows(row.get("tokens") or [row], "tokens")
        text, start, end = "", 0.0, 0.0
        for token in tokens:
            part = check_text(token.get("text"), "text", "what is said belongs there")
            if _SPECIAL.match(part):
                continue
            offsets = token.get("offsets")
            times = offsets if isinstance(offsets, dict) else {}
            begin, until = (check_number(times.get(key), f"offsets.{key}", "milliseconds") for key in ("from", "to"))
            if part[:1].isspace() and text:
                yield text, start, max(start, end)
                text = ""
            text, start, end = text + part, start if text else begin * _MILLISECOND, until * _MILLISECOND
        if text:
            yield text, start, max(start, end)


def _read_chunks(document: Document) -> Iterator[Entry]:
    """Pipelines of Hugging Face Transformers, ``return_timestamps``; the last end may be null."""
    for row in _rows(document["chunks"], "chunks"):
        text, times = check_text(row.get("text"), "text", "what is said belongs there"), row.get("timestamp")
        if not isinstance(times, list) or len(times) != 2:
            raise InputError(f"timestamp of {text[:40]!r} is {str(times)[:40]}", "[start, end] belongs there")
        if times[0] is not None:  # else it could not be placed
            start = read_time(times[0])
            yield text, start, _end_of(text, start) if times[1] is None else read_time(times[1])


def _end_of(text: str, start: float) -> float:
    return start + _SYLLABLE * sum(map(count_syllables, text.split()))


def _read_deepgram(document: Document) -> Iterator[Entry]:
    """https://developers.deepgram.com/docs/pre-recorded-audio: the words of every channel."""
    for channel in _rows(document["results"]["channels"], "channels"):
        for word in _rows(_best(channel).get("words", []), "words"):
            text = check_text(word.get("punctuated_word", word.get("word")), "word", _HINT)
            yield text, read_time(word.get("start")), read_time(word.get("end"))


def _read_aws(document: Document) -> Iterator[Entry]:
    """https://docs.aws.amazon.com/transcribe/latest/dg/how-input.html: items; punctuation has no times."""
    yield from _read_items(document["results"]["items"])


def _read_speechmatics(document: Document) -> Iterator[Entry]:
    """https://docs.speechmatics.com, json-v2: results; punctuation lasts no time."""
    yield from _read_items(document["results"])


def _read_items(items: object) -> Iterator[Entry]:
    for item in _rows(items, "results"):
        if item.get("type") not in ("punctuation", "speaker_change") and "start_time" in item:
            text = check_text(_best(item).get("content"), "content", _HINT)
            yield text, read_time(item["start_time"]), read_time(item.get("end_time"))


def _read_google(document: Document) -> Iterator[Entry]:
    """https://cloud.google.com/speech-to-text/docs/async-time-offsets: "1.2s", or seconds and nanos; 0 is left out."""
    results = _rows(document["results"], "results")
    last = _rows(_best(results[-1]).get("words", []), "words") if results else []
    if any("speakerTag" in word or "speaker_tag" in word for word in last):  # it repeats the words of all results
        results = results[-1:]
    for result in results:
        for word in _rows(_best(result).get("words", []), "words"):
            text = check_text(word.get("word"), "word", _HINT)
            start, end = (_read_google_time(word, key) for key in ("start", "end"))
            yield text, start, end


def _read_google_time(word: Document, key: str) -> float:
    value = next((word[name] for name in (f"{key}Time", f"{key}Offset", f"{key}_time", f"{key}_offset") if name in word), "0s")
    if isinstance(value, dict):
        return read_time(value.get("seconds", 0)) + read_time(value.get("nanos", 0)) * 1e-9
    return read_google_time(value)


def _is_google(document: Document) -> bool:
    rows = document.get("results")
    best = rows[0].get("alternatives") if _is_row(rows, "alternatives") and isinstance(rows, list) else None
    words = best[0].get("words") if _is_row(best, "transcript", "words") and isinstance(best, list) else None
    return _is_row(
        words, "startTime", "endTime", "startOffset", "endOffset", "start_time", "end_time", "start_offset", "end_offset"
    )


def _read_rev(document: Document) -> Iterator[Entry]:
    """https://docs.rev.ai/api/asynchronous/transcripts: elements of monologues; punctuation has no times."""
    for monologue in _rows(document["monologues"], "monologues"):
        for element in _rows(monologue.get("elements", []), "elements"):
            if element.get("type") == "text" and element.get("ts") is not None:
                text = check_text(element.get("value"), "value", _HINT)
                yield text, read_time(element["ts"]), read_time(element.get("end_ts"))


def _read_azure(document: Document) -> Iterator[Entry]:
    """https://learn.microsoft.com/azure/ai-services/speech-service, detailed results: ticks of 100 ns."""
    for word in _rows(_rows(document["NBest"], "NBest")[0].get("Words", []), "Words"):
        text = check_text(word.get("Word"), "Word", _HINT)
        start, length = (check_number(word.get(key), key, "ticks of 100 ns") * _TICK for key in ("Offset", "Duration"))
        yield text, start, start + length


def _read_milliseconds(document: Document) -> Iterator[Entry]:
    """AssemblyAI, https://www.assemblyai.com/docs: start and end in whole milliseconds."""
    for word in document["words"]:
        text = check_text(word.get("text", word.get("word")), "text", _HINT)
        yield text, word["start"] * _MILLISECOND, word["end"] * _MILLISECOND


def _is_in_milliseconds(document: Document) -> bool:
    words = document.get("words")
    if not (isinstance(words, list) and words and all(isinstance(word, dict) for word in words)):
        return False
    spans = [(word.get("start"), word.get("end")) for word in words]
    if not all(type(start) is int and type(end) is int and 0 <= start <= end < 1e12 for start, end in spans):
        return False
    return sum(end - start for start, end in spans) > _LONG * len(spans)


def _get_results(document: Document) -> Document:
    results = document.get("results")
    return results if isinstance(results, dict) else {}


SHAPES: dict[str, Shape] = {
    "whisper.cpp": Shape(lambda document: _is_row(document.get("transcription"), "offsets"), _read_whisper_cpp),
    "Transformers": Shape(lambda document: _is_row(document.get("chunks"), "timestamp"), _read_chunks),
    "Deepgram": Shape(lambda document: "channels" in _get_results(document), _read_deepgram),
    "Amazon Transcribe": Shape(lambda document: "items" in _get_results(document), _read_aws),
    "Google Speech-to-Text": Shape(_is_google, _read_google),
    "Speechmatics": Shape(lambda document: _is_row(document.get("results"), "start_time"), _read_speechmatics),
    "Rev": Shape(lambda document: "monologues" in document, _read_rev),
    "Azure Speech to Text": Shape(lambda document: _is_row(document.get("NBest"), "Words"), _read_azure),
    "AssemblyAI": Shape(_is_in_milliseconds, _read_milliseconds),
}
"""Name → shape."""
