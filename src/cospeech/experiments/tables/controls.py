"""Control rows of a table: the order in which they take other clips, and what metrics make of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import gcd

import numpy as np

from ...corpora.clip import Clip
from ...metrics import Score, load_metric
from ...metrics.controls import control_rows, faults_of_order
from ...motion.rotations import Array
from .paper_tables import Cells

__all__ = ["far_rows", "faults_of", "order_apart"]


def order_apart(count: int) -> Array:
    """(count,) an order in which neighbours are about half of all apart."""
    step = next(s for s in range(count // 2 or 1, count + 1) if gcd(s, count) == 1)
    return np.arange(count) * step % count


def far_rows(clips: Sequence[Clip]) -> dict[str, list[Clip]]:
    """All control rows, by name, as the clips are ordered. "Another clip" is one from far away: half of all lie between."""
    order = order_apart(len(clips))
    rows, back = control_rows([clips[k] for k in order]), np.argsort(order)
    return {name: [made[k] for k in back] for name, made in rows.items()}


def faults_of(controls: Mapping[str, Cells], columns: Sequence[str]) -> dict[str, list[str]]:
    """What each metric puts in the wrong order among the control rows."""
    found = {}
    for metric in columns:
        scores: dict[str, Score | None] = {
            name: Score(cells[metric]["value"], tuple(ends) if (ends := cells[metric]["interval"]) else None)
            if "value" in cells[metric] else None
            for name, cells in controls.items()
        }  # fmt: skip
        found[metric] = faults_of_order(load_metric(metric).about, scores)
    return found
