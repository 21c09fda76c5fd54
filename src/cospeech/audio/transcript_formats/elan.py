"""ELAN (.eaf), annotations of video and sound: https://www.mpi.nl/tools/elan/EAF_Annotation_Format_3.0_and_ELAN.pdf.

A tier has annotations with times, or annotations that belong to those of a parent tier and have their times. Times stand in
slots, in milliseconds. A slot may have none: then it lies between its neighbours in the tier.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

from ...errors import InputError
from ...limits import WORDS
from ..word_entries import Entry
from .tiers import Tier
from .xml_stream import compile_head, parse_xml

__all__ = ["fits", "read_tiers"]

_HEAD = compile_head("ANNOTATION_DOCUMENT")
_TEXT = "ANNOTATION_VALUE"
_PARENTS = 20  # tiers above a tier [ours: files have up to five]

_Span = tuple[float, float]
"""Start and end in seconds."""


class _Annotation(NamedTuple):
    """An annotation: between two slots, or with the time of another annotation."""

    id: str
    first: str
    last: str
    parent: str
    text: str


def fits(text: str) -> bool:
    """Whether a text is XML whose first element is that of ELAN."""
    return _HEAD.match(text[:10_000]) is not None


def read_tiers(text: str) -> list[Tier]:
    """All tiers. Annotations that share the time of one parent, as words of a sentence, are one entry.

    Raises:
        InputError: it is no XML, has a document type, a time is no number, or no annotation has times.
    """
    document = _Document()
    parse_xml(text, document, "ELAN")
    spans = dict[str, _Span]()
    for rows in document.tiers.values():
        spans |= _find_spans(rows, document.slots)
    parents = {each.id: each.parent for rows in document.tiers.values() for each in rows if each.parent}
    tiers = [Tier(name, _join(rows, spans, parents)) for name, rows in document.tiers.items()]
    if not any(tier.entries for tier in tiers):
        raise InputError("no annotation has times", "was the file saved by ELAN?")
    return tiers


class _Document:
    """Collects slots and tiers while a document streams by."""

    def __init__(self) -> None:
        self.slots = dict[str, float | None]()
        self.tiers = dict[str, list[_Annotation]]()
        self._tier: list[_Annotation] = []
        self._annotation: _Annotation | None = None
        self._parts: list[str] | None = None
        self._count = 0

    def open(self, tag: str, attributes: Mapping[str, str]) -> None:
        if tag == "TIME_SLOT":
            self.slots[attributes.get("TIME_SLOT_ID", "")] = _read_time(attributes.get("TIME_VALUE"))
        elif tag == "TIER":
            self._tier = self.tiers.setdefault(attributes.get("TIER_ID", ""), [])
        elif tag in ("ALIGNABLE_ANNOTATION", "REF_ANNOTATION"):
            self._count += 1
            if self._count > 4 * WORDS:  # as of a TextGrid
                raise InputError(f"more than {4 * WORDS:,} annotations", "cut it into pieces")
            keys = ("ANNOTATION_ID", "TIME_SLOT_REF1", "TIME_SLOT_REF2", "ANNOTATION_REF")
            name, first, last, parent = (attributes.get(key, "") for key in keys)
            self._annotation = _Annotation(name, first, last, parent, "")
        elif tag == _TEXT:
            self._parts = []

    def close(self, tag: str) -> None:
        if tag == _TEXT and self._annotation is not None:
            self._tier.append(self._annotation._replace(text="".join(self._parts or ()).strip()))
            self._annotation = None
        if tag == _TEXT:
            self._parts = None

    def hear(self, text: str) -> None:
        """Add text of an annotation."""
        if self._parts is not None:
            self._parts.append(text)


def _read_time(text: str | None) -> float | None:
    """Seconds; None of a slot without a time.

    Raises:
        InputError: it is no whole number.
    """
    if text is None:
        return None
    if not (text.strip().isascii() and text.strip().isdigit() and len(text) < 16):
        raise InputError(f"{text[:40]!r} is not a time", "TIME_VALUE counts milliseconds")
    return int(text) / 1000


def _find_spans(rows: list[_Annotation], slots: Mapping[str, float | None]) -> dict[str, _Span]:
    """Id → times of the annotations of one tier that have slots; slots without a time lie evenly between others."""
    intervals = [each for each in rows if each.first and each.last]
    chains = list[list[str]]()
    for each in intervals:
        if not chains or chains[-1][-1] != each.first:
            chains.append([each.first])
        chains[-1].append(each.last)
    times = dict[str, float]()
    for chain in chains:
        places = [k for k, slot in enumerate(chain) if slots.get(slot) is not None]
        times |= {chain[k]: slots[chain[k]] or 0.0 for k in places}
        for low, high in pairwise(places):
            start, end = times[chain[low]], times[chain[high]]
            times |= {chain[k]: start + (end - start) * (k - low) / (high - low) for k in range(low + 1, high)}
    return {each.id: (times[each.first], times[each.last]) for each in intervals if each.first in times and each.last in times}


def _join(rows: list[_Annotation], spans: Mapping[str, _Span], parents: Mapping[str, str]) -> list[Entry]:
    """Entries of a tier; those that have the time of one annotation above are one entry."""
    texts = dict[str, list[str]]()
    for each in rows:
        root = each.id
        for _ in range(_PARENTS):
            if root in spans or root not in parents:
                break
            root = parents[root]
        if root in spans:
            texts.setdefault(root, []).append(each.text)
    return [(" ".join(parts), *spans[root]) for root, parts in texts.items()]
