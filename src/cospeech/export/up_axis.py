"""Recognise worlds with Z up in files that do not state it, and turn them."""

from __future__ import annotations

import numpy as np

from ..motion.rotations import Array, axis_angle_to_quat

__all__ = ["Z_TO_Y", "has_z_up"]

Z_TO_Y = axis_angle_to_quat((1.0, 0, 0), -np.pi / 2)
"""(4,) the rotation of such a world into ours, which has Y up."""
_UPRIGHT = 0.5  # mean along Z of a spine that is upright for most of the time; ours


def has_z_up(directions: Array) -> bool:
    """Whether a body stands along Z, by (T, 3) unit vectors that point up its spine in the world of the file."""
    if not len(directions):
        return False
    _, y, z = np.mean(directions, 0)
    return bool(z > _UPRIGHT and z > abs(y))
