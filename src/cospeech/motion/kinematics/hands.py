"""Hand shapes, and the meaning of a hand's channels.

A hand is a row of channels on a `Track`. Its wrist has a place in gesture space: each arm has a frame that follows the upper
chest, with the shoulder joint of the T-pose as origin, in units of arm length (shoulder to wrist). All values are for the left
hand; the right is its mirror image. Angles are in degrees here, because people edit these tables.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..rotations import Array

__all__ = ["CHANNELS", "HAND_SHAPES", "HAND_VARIANTS", "LAGS", "Channel", "HandShape"]


class Channel:
    """Columns of a hand's track."""

    OUT, UP, FORWARD = 0, 1, 2  # wrist: outward of the own shoulder, above it, in front of it; arm lengths
    SWIVEL = 3  # elbow about the shoulder–wrist line, degrees; positive lifts it outward
    PRONATION = 4  # degrees; 0 thumb up, +90 palm down, −90 palm up (forearm level in front)
    FLEXION = 5  # wrist, degrees; positive towards the palm
    DEVIATION = 6  # wrist, degrees; positive towards the little finger
    KNUCKLES = slice(7, 11)  # index … little, flexion at the first joint, degrees
    MIDDLES = slice(11, 15)  # index … little, flexion at the middle joint; the last joint follows with two thirds
    SPREAD = 15  # degrees between neighbouring fingers
    THUMB = slice(16, 19)  # opposition, flexion at the base, flexion of both outer joints; degrees
    SHRUG = 19  # shoulder, degrees upward


CHANNELS = 20
LAGS = np.array([0, 0, 0, 0.02, 0.04, 0.06, 0.06] + [0.08, 0.09, 0.10, 0.11] * 2 + [0.07, 0.07, 0.07, 0.08] + [0.0])
"""Seconds by which each channel trails the wrist: motion runs outward along the arm (ours, by eye: 40–110 ms)."""


class HandShape(NamedTuple):
    """Finger angles in degrees: knuckles and middle joints of index, middle, ring, little; spread; thumb."""

    knuckles: tuple[float, float, float, float]
    middles: tuple[float, float, float, float]
    spread: float
    thumb: tuple[float, float, float]

    def values(self) -> Array:
        """(12,) in the order of the channels 7 … 18."""
        return _values_of(self).copy()


@lru_cache(256)
def _values_of(shape: HandShape) -> Array:
    return np.array([*shape.knuckles, *shape.middles, shape.spread, *shape.thumb], float)


HAND_SHAPES: dict[str, HandShape] = {
    "relaxed": HandShape((18, 24, 28, 30), (28, 34, 38, 36), 3, (12, 8, 14)),
    "soft_open": HandShape((8, 12, 16, 16), (14, 20, 24, 24), 5, (10, 2, 10)),
    "open": HandShape((0, 2, 4, 4), (8, 10, 12, 12), 8, (6, -6, 4)),
    "spread": HandShape((-6, -4, -4, -4), (10, 12, 14, 14), 13, (4, -14, 2)),
    "flat": HandShape((4, 4, 4, 4), (4, 4, 4, 4), 1, (10, 6, 6)),
    "bowl": HandShape((24, 26, 28, 30), (34, 36, 38, 40), 7, (30, 4, 16)),
    "claw": HandShape((10, 12, 14, 16), (52, 54, 56, 58), 10, (26, -4, 30)),
    "frame": HandShape((30, 34, 38, 40), (26, 30, 34, 36), 4, (28, -8, 8)),
    "ring": HandShape((48, 34, 26, 20), (52, 38, 30, 26), 6, (44, 14, 28)),  # thumb meets index: precision grip
    "pinch": HandShape((52, 56, 58, 58), (46, 48, 52, 54), 2, (46, 16, 26)),
    "purse": HandShape((54, 56, 56, 54), (34, 34, 36, 38), 1, (46, 18, 20)),
    "loose_fist": HandShape((52, 58, 62, 62), (70, 74, 76, 74), 2, (30, 18, 34)),
    "fist": HandShape((74, 78, 80, 80), (94, 96, 96, 94), 0, (40, 26, 44)),
    "point": HandShape((6, 62, 66, 66), (8, 78, 80, 78), 2, (34, 18, 32)),
    "point_soft": HandShape((10, 40, 46, 48), (14, 52, 58, 58), 3, (24, 12, 22)),
    "two": HandShape((2, 2, 66, 68), (6, 6, 84, 84), 9, (44, 26, 36)),
    "three": HandShape((0, 0, 2, 66), (6, 6, 8, 84), 9, (46, 26, 36)),
    "thumb": HandShape((70, 74, 76, 76), (88, 90, 92, 90), 0, (-6, -18, 0)),
}
"""Ours, set by eye on the mannequin; names are those of gesture annotation schemes where there is one. Networks code hands in
the principal directions of this table (`cospeech.motion.poses.humanoid`): further shapes belong in `HAND_VARIANTS`."""

HAND_VARIANTS: dict[str, HandShape] = {
    "curl": HandShape((30, 38, 46, 52), (44, 52, 58, 60), 3, (18, 8, 18)),
    "cradle": HandShape((10, 18, 28, 36), (22, 28, 36, 42), 7, (20, 0, 12)),
    "fan": HandShape((-6, 6, 18, 30), (6, 16, 26, 36), 9, (4, -10, 4)),
    "wide": HandShape((-10, -8, -6, -2), (4, 6, 8, 10), 15, (0, -20, 0)),
    "cup": HandShape((20, 26, 32, 38), (18, 24, 30, 34), 4, (26, 4, 10)),
    "tent": HandShape((42, 44, 46, 48), (10, 12, 14, 16), 8, (36, -4, 8)),
    "half_fist": HandShape((38, 46, 52, 56), (50, 58, 62, 62), 3, (26, 12, 28)),
    "lazy_point": HandShape((14, 46, 56, 60), (22, 62, 70, 68), 4, (16, 6, 14)),
}
"""Shapes that replace those of `HAND_SHAPES` now and then, so that hands vary; ours, by eye."""
