"""Holm's correction of p values for how many tests there are (Holm 1979)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

__all__ = ["correct"]


def correct(chances: Sequence[float]) -> list[float]:
    """Correct the p values of one family of tests (Holm 1979)."""
    order = np.argsort(chances, kind="stable")
    p_values, largest = [1.0] * len(chances), 0.0
    for rank, k in enumerate(order):
        largest = max(largest, min(1.0, (len(chances) - rank) * chances[k]))
        p_values[k] = largest
    return p_values
