"""A gesture as the planner made it, and what a plan may ask of one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..motion.rotations import Array

__all__ = ["CHAINED", "CROWDED", "LEFT", "RIGHT", "RUN_UP", "Gesture", "GestureOverride"]

LEFT, RIGHT = 0, 1
RUN_UP = 0.45
"""Seconds before the first frame in which a gesture for the first word may already have begun. [ours]"""
CROWDED = 0.6
"""Seconds between two strokes of a hand below which one takes the place of the other. [ours] A gesture with its preparation
takes about so long."""
_SLOWEST, _FASTEST = 3.0, 0.6  # factors on the length of a stroke that a plan may ask for [ours: slower ones are poses]


class Gesture(NamedTuple):
    """A planned stroke, for annotations and pictures: times in seconds."""

    start: float
    stroke: float
    end: float
    form: str
    hands: str
    word: str
    score: float


@dataclass(frozen=True)
class GestureOverride:
    """What a plan fixes of a gesture; the planner chooses what is None.

    Args:
        stroke: seconds at which the speed of the first stroke peaks.
        start: seconds at which the preparation begins.
        end: seconds at which the last stroke ends.
        hold: seconds for which the hands stay after it.
        hands: "left", "right" or "both".
        size: factor on the size.
        place: (3,) where the wrist of the leading hand ends its first stroke; arm lengths out, up and forward of the shoulder.
    """

    stroke: float
    start: float
    end: float | None = None
    hold: float | None = None
    hands: str | None = None
    size: float = 1.0
    place: tuple[float, float, float] | None = None

    def choose_hands(self, usual: list[int], label: str) -> tuple[list[int], str]:
        """The hands that perform, leader first; ``usual`` are those that the planner would take."""
        if self.hands is None or self.hands == label:
            return usual, label
        both = [usual[0], 1 - usual[0]]
        return (both if self.hands == "both" else [RIGHT if self.hands == "right" else LEFT]), self.hands

    def shift(self, poses: list[Array]) -> None:
        """Move all poses so that the first stroke ends at the place."""
        if self.place is not None:
            way = np.array(self.place) - poses[1][:3]
            for pose in poses:
                pose[:3] += way

    def slow_down(self, lengths: list[float]) -> list[float]:
        """Seconds of each stroke so that the last one ends in time; ``lengths`` are those of an unhurried speaker."""
        if self.end is None:
            return lengths
        usual = last_end(lengths) - lengths[0] / 2
        factor = min(max((self.end - self.stroke) / usual, _FASTEST), _SLOWEST)
        return [length * factor for length in lengths]


CHAINED = 0.82
"""Share of a stroke after which the next one of the same gesture begins ([ours])."""


def last_end(lengths: list[float]) -> float:
    """Seconds from the first onset of strokes of these lengths to the end of the last."""
    return sum(lengths[:-1]) * CHAINED + lengths[-1]
