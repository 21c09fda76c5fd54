"""JSON of recognisers, aligners and text-to-speech services, one document or one on each line; see `word_json`."""

from __future__ import annotations

from collections.abc import Iterator
from io import StringIO

from ...errors import InputError
from ...files import parse_json
from ...limits import TRANSCRIPT_JSON_VALUES
from ..word_entries import Entry, Note
from ..word_json import read_documents

__all__ = ["fits", "read"]


def fits(text: str) -> bool:
    """Whether a text begins as JSON does."""
    head = text.lstrip()[:400]
    return head[:1] in ("[", "{") and head[1:].lstrip()[:1] in ('"', "{", "[", "]", "}")


def read(text: str, note: Note) -> Iterator[Entry]:
    """The words of a JSON document, or of JSON lines: a document on each line.

    Raises:
        InputError: it is no JSON, or as of `read_documents`.
    """
    return read_documents(_documents(text))


def _documents(text: str) -> Iterator[object]:
    first, _, rest = text.lstrip().partition("\n")
    if not rest or rest.isspace() or not _is_document(first):
        yield parse_json(text, "the transcript", TRANSCRIPT_JSON_VALUES)
        return
    for number, line in enumerate(StringIO(text), 1):
        if not line.isspace():
            yield parse_json(line, f"line {number}", TRANSCRIPT_JSON_VALUES)


def _is_document(line: str) -> bool:
    try:
        parse_json(line, "the first line", TRANSCRIPT_JSON_VALUES)
    except InputError:
        return False
    return True
