"""What a table's metrics make of its control rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..metrics import Score, load_metric
from ..metrics.controls import faults_of_order
from .designs import Cells

__all__ = ["faults_of"]


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
