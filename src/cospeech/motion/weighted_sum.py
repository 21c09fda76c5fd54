"""Weighted sums with the same bits in every company: what a stream in pieces needs to be what the whole is.

A matrix product of BLAS, and NumPy's sum along rows, group their terms by how many there are, so that the last bit of a row
changes with the number of rows and with terms of weight 0. Here terms are added one after the other.
"""

from __future__ import annotations

import numpy as np

from .rotations import Array

__all__ = ["add_weighted_rows"]

_MANY = 1000  # numbers of a result from which adding row after row is quicker than all terms in one array (measured; ours)


def add_weighted_rows(weights: Array, rows: Array | None = None) -> Array:
    """Rows added up by weights, each after the one before.

    Args:
        weights: (T, K).
        rows: (K, C); ones, with C = 1, where not given.

    Returns:
        (T, C) float64: row t follows from ``weights[t]`` alone, and terms of weight 0 change no bit of it.

    >>> add_weighted_rows(np.array([[1.0, 0.0, 2.0]]), np.array([[1.0, 2.0], [5.0, 5.0], [0.5, 1.0]])).tolist()
    [[2.0, 4.0]]
    """
    if rows is None:
        rows = np.ones((weights.shape[1], 1))
    used = np.flatnonzero(weights.any(0))
    if len(weights) * rows.shape[1] >= _MANY or not len(used):
        total: Array = np.zeros((len(weights), rows.shape[1]))
        for k in used:
            total += weights[:, k, None] * rows[k]
        return total
    return np.add.accumulate(weights[:, used, None] * rows[used], axis=1)[:, -1]
