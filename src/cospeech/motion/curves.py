"""Curves between 0 and 1."""

from __future__ import annotations

import numpy as np

from .rotations import Array

__all__ = ["smoothstep"]


def smoothstep(u: Array) -> Array:
    """From 0 to 1 without a slope at either end; ``u`` of any shape is clipped to 0 … 1."""
    u = np.minimum(np.maximum(u, 0), 1)  # as numpy.clip, which takes three times as long over few values
    return u * u * (3 - 2 * u)  # type: ignore[no-any-return]
