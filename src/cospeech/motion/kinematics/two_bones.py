"""The place of the joint between two bones of an arm or a leg."""

from __future__ import annotations

import numpy as np

from ..curves import clip
from ..rotations import Array

__all__ = ["place_middle_joint"]


def place_middle_joint(along: Array, distance: Array, pole: Array, bones: tuple[float, float], most: float = 1.0) -> Array:
    """Position of an elbow or a knee, relative to the joint above it, by the law of cosines.

    Args:
        along: (..., 3) direction from the joint above to the end of the second bone.
        distance: (...) metres between these two.
        pole: (..., 3) direction at right angles to ``along`` in which the middle joint lies.
        bones: metres of the first and of the second bone.
        most: the largest cosine of the angle between the first bone and ``along``.

    Returns:
        (..., 3) metres.
    """
    first, second = bones
    cosine = clip((first**2 + distance**2 - second**2) / (2 * first * distance), -most, most)
    result: Array = along * (first * cosine)[..., None] + pole * (first * np.sqrt(1 - cosine**2))[..., None]
    return result
