"""Words with times as JSON: of recognisers and aligners."""

from __future__ import annotations

from collections.abc import Iterator

from ..errors import InputError
from ..files import parse_json
from ..limits import TRANSCRIPT_JSON_VALUES
from .word_entries import Entry, read_time

__all__ = ["read_entries", "read_json"]

TEXT_KEYS = ("word", "text", "w", "t", "label", "punctuated_word", "value")
START_KEYS = ("start", "b", "begin", "start_time", "startTime", "xmin", "from", "s")
END_KEYS = ("end", "stop", "end_time", "endTime", "xmax", "to", "e")
LIST_KEYS = ("words", "w", "segments", "result", "results", "word_segments", "fragments", "transcript")


def read_json(text: str, name: str = "the transcript") -> Iterator[Entry]:
    """A list of {word, start, end}; or that list, or segments that hold such lists, named as recognisers do.

    Args:
        text: of the document.
        name: how messages call it.

    Raises:
        InputError: it is no JSON, or as of `read_entries`.
    """
    yield from read_entries(parse_json(text, name, TRANSCRIPT_JSON_VALUES))


def read_entries(node: object, depth: int = 0) -> Iterator[Entry]:
    """The words of JSON that is parsed.

    Args:
        node: a list of {word, start, end}, one of these, or an object that holds such a list.
        depth: of objects and lists around it.

    Raises:
        InputError: it holds no words, or something else than a time.
    """
    if depth > 4:
        raise InputError("JSON in which words are nested too deeply", "a list of words with start and end")
    if isinstance(node, list):
        for item in node:
            if not isinstance(item, dict):
                raise InputError(f"{str(item)[:40]!r} in a list of words", '{"word": …, "start": …, "end": …} belongs there')
            yield from read_entries(item, depth + 1)
        return
    if not isinstance(node, dict):
        raise InputError(f"JSON that holds {str(node)[:40]!r}", "a list of words with start and end")
    inner = next((node[key] for key in LIST_KEYS if isinstance(node.get(key), list) and node[key]), None)
    if inner is not None:
        yield from read_entries(inner, depth + 1)
        return
    said = next((node[key] for key in TEXT_KEYS if isinstance(node.get(key), str)), None)
    start = next((node[key] for key in START_KEYS if node.get(key) is not None), None)
    end = next((node[key] for key in END_KEYS if node.get(key) is not None), None)
    if said is not None and start is not None:
        length = next((node[key] for key in ("d", "duration", "dur") if node.get(key) is not None), None)
        if end is None and length is None:
            raise InputError(f"{said[:40]!r} has a start but no end", "give each word start and end")
        begin = read_time(start)
        yield said, begin, begin + read_time(length) if end is None else read_time(end)
    elif depth == 0 and not any(isinstance(node.get(key), list) for key in LIST_KEYS):
        raise InputError(
            f"JSON without words: its names are {', '.join(map(repr, list(node)[:5]))}", "a list of words with times"
        )
    # A word without any time is one that the recogniser could not place: it is left out.
