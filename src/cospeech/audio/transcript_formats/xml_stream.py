"""XML that streams by: no tree is built, and a document type, which could hold entities, is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Protocol
from xml.parsers import expat

from ...errors import InputError

__all__ = ["XmlReader", "compile_head", "parse_xml"]


class XmlReader(Protocol):
    """Takes the parts of a document, in order."""

    def open(self, tag: str, attributes: Mapping[str, str]) -> None:
        """An element begins."""

    def close(self, tag: str) -> None:
        """An element ends."""

    def hear(self, text: str) -> None:
        """Text between elements, or a part of it."""


def compile_head(element: str) -> re.Pattern[str]:
    """The pattern of the beginning of a document, up to its first element, which has this name."""
    return re.compile(rf"\s*+(?:<\?xml[^<>]*+>)?+\s*+(?:<!--(?:[^-]|-(?!->))*+-->\s*+)*+<(?:\w++:)?+{element}[\s>]")


def parse_xml(text: str, reader: XmlReader, what: str) -> None:
    """Give the parts of a document to ``reader``.

    Args:
        text: of the document.
        reader: takes its parts.
        what: name of the format, for a message.

    Raises:
        InputError: it is no XML, or has a document type; or an error of ``reader``.
    """

    def refuse(*arguments: object) -> None:
        raise InputError("it has a document type", f"remove <!DOCTYPE …>; {what} needs none")

    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler, parser.EndElementHandler = reader.open, reader.close
    parser.CharacterDataHandler = reader.hear
    try:
        parser.Parse(re.sub(r"^\s*<\?xml[^<>]*\?>", "", text, count=1).encode(), True)
    except expat.ExpatError as error:
        raise InputError(f"it is no XML: {error}", "is it cut off?") from None
