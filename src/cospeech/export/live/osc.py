"""Open Sound Control 1.0: messages and bundles as bytes.

Specification: https://opensoundcontrol.stanford.edu/spec-1_0.html. Everything is big-endian and padded to four bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence

__all__ = ["bundle", "message", "split_bundles"]

_BUNDLE = b"#bundle\0" + struct.pack(">Q", 1)  # the time tag 1 says: at once


def message(address: str, *arguments: str | int | float) -> bytes:
    """One message; texts, whole numbers (int32) and numbers (float32) have the types s, i and f."""
    tags, values = ",", []
    for argument in arguments:
        if isinstance(argument, str):
            tags += "s"
            values.append(_text(argument))
        elif isinstance(argument, int):
            tags += "i"
            values.append(struct.pack(">i", argument))
        else:
            tags += "f"
            values.append(struct.pack(">f", argument))
    return _text(address) + _text(tags) + b"".join(values)


def bundle(messages: Iterable[bytes]) -> bytes:
    """Messages that the receiver acts on together."""
    return _BUNDLE + b"".join(struct.pack(">i", len(each)) + each for each in messages)


def split_bundles(messages: Sequence[bytes], most: int) -> list[bytes]:
    """Split messages into as few bundles of at most ``most`` bytes as possible, in order; a message is never cut."""
    bundles: list[bytes] = []
    now: list[bytes] = []
    size = len(_BUNDLE)
    for each in messages:
        if now and size + 4 + len(each) > most:
            bundles.append(bundle(now))
            now, size = [], len(_BUNDLE)
        now.append(each)
        size += 4 + len(each)
    return [*bundles, bundle(now)]


def _text(text: str) -> bytes:
    data = text.encode() + b"\0"
    return data + b"\0" * (-len(data) % 4)
