"""Curves between 0 and 1, and hard and soft bounds."""

from __future__ import annotations

import numpy as np

from .rotations import Array

__all__ = ["clip", "smoothstep", "soft_clip", "soft_positive"]


def clip(x: Array, low: Array | float, high: Array | float) -> Array:
    """`numpy.clip`, but three times as fast for few values."""
    return np.minimum(np.maximum(x, low), high)


def smoothstep(u: Array) -> Array:
    """From 0 to 1 without a slope at either end; ``u`` of any shape is clipped to 0 … 1."""
    u = clip(u, 0, 1)
    return u * u * (3 - 2 * u)  # type: ignore[no-any-return]


def soft_positive(x: Array, width: float) -> Array:
    """The larger of 0 and ``x``, smoothed over about ``width`` on both sides of 0; at 0 it is .69 widths."""
    return width * np.logaddexp(0.0, x / width)  # type: ignore[no-any-return]


def soft_clip(x: Array, low: float, high: float) -> Array:
    """The identity in the middle, a curve within the last fifth of the range on both sides; never at ``low`` or ``high``."""
    middle, half = (low + high) / 2, (high - low) / 2
    u = (x - middle) / half
    over = np.abs(u) - 0.8
    curve = np.sign(u) * (0.8 + 0.2 * np.tanh(np.maximum(over, 0) / 0.2))
    return middle + half * np.where(over > 0, curve, u)
