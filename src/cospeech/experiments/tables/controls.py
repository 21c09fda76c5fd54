"""Control rows of a table: the order in which they take other clips, and the faults of metrics on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from hashlib import blake2b
from math import gcd
from os import PathLike

import numpy as np

from ...corpora.clip import Clip
from ...corpora.store import Store
from ...errors import InputError
from ...metrics import Score, load_metric
from ...metrics.controls import control_rows, faults_of_order
from ...motion.rotations import Array
from .paper_tables import Cells

__all__ = ["ORACLE", "check_oracle", "far_rows", "faults_of", "oracle_key", "order_apart"]

ORACLE = "oracle: the same speech, another take"
"""Row of a synthetic corpus: the rules perform the same speech with another seed; no system can be expected to be nearer."""


def check_oracle(store: Store, other: Store) -> None:
    """Check that two stores have the same clips.

    Raises:
        InputError: they have other clips, poses or frame rates.
    """
    ours, theirs = ([(clip.name, clip.frames) for clip in each.clips] for each in (store, other))
    if ours != theirs or store.pose != other.pose or store.fps != other.fps:
        raise InputError(
            f"{str(other.folder)!r} has other clips than {str(store.folder)!r}",
            "an oracle has the same speech (synthesise … --gestures 1); prepare both stores with --no-filters",
        )


def oracle_key(folder: str | PathLike[str] | None) -> list[str]:
    """Key of the oracle in the cache of control rows: a digest of its poses; empty without an oracle."""
    if folder is None:
        return []
    store = Store(folder)
    sums = np.asarray(store.arrays["pose"][:: max(1, len(store.arrays["pose"]) // 1000)], np.float64).tobytes()
    return [blake2b(sums, digest_size=6).hexdigest()]


def order_apart(count: int) -> Array:
    """(count,) an order in which neighbours are about half of the clips apart."""
    step = next(s for s in range(count // 2 or 1, count + 1) if gcd(s, count) == 1)
    return np.arange(count) * step % count


def far_rows(clips: Sequence[Clip]) -> dict[str, list[Clip]]:
    """All control rows, by name, in the order of the clips. "Another clip" is from far away: half of all clips lie between."""
    order = order_apart(len(clips))
    rows, back = control_rows([clips[k] for k in order]), np.argsort(order)
    return {name: [row[k] for k in back] for name, row in rows.items()}


def faults_of(controls: Mapping[str, Cells], columns: Sequence[str]) -> dict[str, list[str]]:
    """What each metric puts in the wrong order among the control rows."""
    faults = {}
    for metric in columns:
        scores: dict[str, Score | None] = {
            name: Score(cells[metric]["value"], tuple(ends) if (ends := cells[metric]["interval"]) else None)
            if "value" in cells[metric] else None
            for name, cells in controls.items()
        }  # fmt: skip
        faults[metric] = faults_of_order(load_metric(metric).about, scores)
    return faults
