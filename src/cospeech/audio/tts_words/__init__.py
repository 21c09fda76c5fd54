"""Word times as text-to-speech services give them; each service has a module, and a row in `SERVICES`.

A service gives JSON objects: one, a list of them, or one on each line. `cospeech.audio.word_json` recognises them by the names
of their fields, so their files need no suffix of their own. Nothing here calls a service.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

from ..word_entries import Entry
from . import azure, cartesia, elevenlabs, polly

__all__ = ["SERVICES", "Service"]

Piece = Mapping[str, Any]


class Service(NamedTuple):
    """How to recognise and read the objects of a service."""

    has_fields: Callable[[Piece], bool]
    """Whether an object has the names of its fields."""
    read: Callable[[Iterator[Piece]], Iterator[Entry]]
    """Its objects, as they come → words, each as soon as it is certain; InputError names the field that is wrong."""


SERVICES: dict[str, Service] = {
    "ElevenLabs": Service(elevenlabs.has_fields, elevenlabs.read),
    "Azure Speech": Service(azure.has_fields, azure.read),
    "Amazon Polly": Service(polly.has_fields, polly.read),
    "Cartesia": Service(cartesia.has_fields, cartesia.read),
}
"""Name → service."""
