"""Weighted sums whose bits do not depend on the other rows, so that a stream in pieces equals the whole.

A matrix product of BLAS, and NumPy's sum along rows, group their terms by their number. So the last bit of a row changes with
the number of rows and with terms of weight 0. Here, terms are added one after the other.
"""

from __future__ import annotations

import numpy as np

from .rotations import Array

__all__ = ["add_weighted_rows"]

_MANY = 1000  # numbers of a result above which adding row by row is faster than one array of all terms [ours, measured]


def add_weighted_rows(weights: Array, rows: Array | None = None) -> Array:
    """Add weighted rows, one after the other.

    Args:
        weights: (T, K).
        rows: (K, C); the default is ones, with C = 1.

    Returns:
        (T, C) float64: row t depends on ``weights[t]`` alone, and terms of weight 0 change no bit of it.

    >>> add_weighted_rows(np.array([[1.0, 0.0, 2.0]]), np.array([[1.0, 2.0], [5.0, 5.0], [0.5, 1.0]])).tolist()
    [[2.0, 4.0]]
    """
    if rows is None:
        rows = np.ones((weights.shape[1], 1))
    columns = np.flatnonzero(weights.any(0))
    if len(weights) * rows.shape[1] >= _MANY or not len(columns):
        total: Array = np.zeros((len(weights), rows.shape[1]))
        for k in columns:
            total += weights[:, k, None] * rows[k]
        return total
    return np.add.accumulate(weights[:, columns, None] * rows[columns], axis=1)[:, -1]
