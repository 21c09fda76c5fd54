"""Nods of a head: a row of them, each smaller than the one before."""

from __future__ import annotations

import numpy as np

from ..motion.rotations import Array

__all__ = ["nod_curve"]

_LESS = 0.65  # the size of each nod after the first [ours, as nods on accents in the rules]


def nod_curve(times: Array, begin: Array | float, count: Array | int, size: Array | float, pace: Array | float) -> Array:
    """(n,) by how much the head is lowered.

    Args:
        times: (n,) seconds.
        begin: of the row, seconds.
        count: of its nods.
        size: of the first one; the result has its unit.
        pace: seconds of a nod.
    """
    u = (times - begin) / pace
    number = np.floor(u)
    inside = (u >= 0) & (number < count)
    curve = np.where(inside, size * _LESS ** np.clip(number, 0, 3) * np.sin(np.pi * (u - number)) ** 2, 0.0)
    return np.asarray(curve)
