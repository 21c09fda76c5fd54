"""Weighted sums with the same bits in every company: what a stream in pieces needs to be what the whole is.

A matrix product of BLAS, and NumPy's sum along rows, group their terms by how many there are, so that the last bit of a row
changes with the number of rows and with terms of weight 0. Here terms are added one after the other.
"""

from __future__ import annotations

import numpy as np

from .rotations import Array

__all__ = ["add_weighted_rows"]


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
    terms = weights[:, :, None] if rows is None else weights[:, :, None] * rows
    if not terms.shape[1]:
        return np.zeros((len(terms), terms.shape[2]))
    return np.add.accumulate(terms, axis=1)[:, -1]
