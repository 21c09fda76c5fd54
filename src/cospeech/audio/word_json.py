"""Words with times as JSON: of recognisers, aligners, and text-to-speech services."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import Any

from ..errors import InputError
from .recognisers import SHAPES, Shape
from .tts_words import SERVICES, Service
from .word_entries import Entry, read_time

__all__ = ["read_documents"]

TEXT_KEYS = ("word", "text", "w", "t", "label", "punctuated_word", "value")
START_KEYS = ("start", "b", "begin", "start_time", "startTime", "xmin", "from", "s")
END_KEYS = ("end", "stop", "end_time", "endTime", "xmax", "to", "e")
LIST_KEYS = ("words", "w", "segments", "result", "results", "word_segments", "fragments", "transcript")


def read_documents(documents: Iterator[object]) -> Iterator[Entry]:
    """The words of JSON that is parsed, each as soon as it is certain.

    Args:
        documents: of a recogniser or an aligner, each by itself; or those of a text-to-speech service, in their order.

    Raises:
        InputError: one holds no words, or a field is not what it should be.
    """
    for document in documents:
        first = document[0] if isinstance(document, list) and document else document
        service = _find_service(first) if isinstance(first, dict) else None
        if service is not None:
            yield from _read_pieces(service, chain([document], documents))
        elif isinstance(document, dict) and (shape := _find_shape(document)) is not None:
            yield from shape.read(document)
        else:
            yield from _read_entries(document)


def _find_service(piece: dict[str, Any]) -> Service | None:
    return next((service for service in SERVICES.values() if service.has_fields(piece)), None)


def _find_shape(document: dict[str, Any]) -> Shape | None:
    return next((shape for shape in SHAPES.values() if shape.has_fields(document)), None)


def _read_pieces(service: Service, documents: Iterator[object]) -> Iterator[Entry]:
    """The words of a service; the message of an error says which of its objects is wrong."""
    at = 0

    def pieces() -> Iterator[dict[str, Any]]:
        nonlocal at
        count = 0
        for document in documents:
            for piece in document if isinstance(document, list) else [document]:
                count += 1
                if not isinstance(piece, dict):
                    raise InputError(f"object {count} is {str(piece)[:40]!r}", "a JSON object belongs there")
                at = count
                yield piece
            at = 0  # an error of the next document is not this one's

    try:
        yield from service.read(pieces())
    except InputError as error:
        raise InputError(f"object {at}: {error.problem}" if at else error.problem, error.hint) from None


def _read_entries(node: object, depth: int = 0) -> Iterator[Entry]:
    """The words of a list of {word, start, end}, of one such object, or of an object or segments that hold such lists."""
    if depth > 4:
        raise InputError("JSON in which words are nested too deeply", "a list of words with start and end")
    if isinstance(node, list):
        for item in node:
            if not isinstance(item, dict):
                raise InputError(f"{str(item)[:40]!r} in a list of words", '{"word": …, "start": …, "end": …} belongs there')
            yield from _read_entries(item, depth + 1)
        return
    if not isinstance(node, dict):
        raise InputError(f"JSON that holds {str(node)[:40]!r}", "a list of words with start and end")
    inner = next((node[key] for key in LIST_KEYS if isinstance(node.get(key), list) and node[key]), None)
    if inner is not None:
        yield from _read_entries(inner, depth + 1)
        return
    text = next((node[key] for key in TEXT_KEYS if isinstance(node.get(key), str)), None)
    start = next((node[key] for key in START_KEYS if node.get(key) is not None), None)
    end = next((node[key] for key in END_KEYS if node.get(key) is not None), None)
    if text is not None and start is not None:
        length = next((node[key] for key in ("d", "duration", "dur") if node.get(key) is not None), None)
        if end is None and length is None:
            raise InputError(f"{text[:40]!r} has a start but no end", "give each word start and end")
        begin = read_time(start)
        yield text, begin, begin + read_time(length) if end is None else read_time(end)
    elif depth == 0 and text is not None and end is None:
        raise InputError(f"{text[:40]!r} has no start and no end", "give each word start and end, seconds")
    elif depth == 0 and not any(isinstance(node.get(key), list) for key in LIST_KEYS):
        names = f": its names are {', '.join(map(repr, list(node)[:5]))}" if node else ""
        raise InputError(f"JSON without words{names}", "a list of words with times")
    # A word without any time is one that the recogniser could not place: it is left out.
