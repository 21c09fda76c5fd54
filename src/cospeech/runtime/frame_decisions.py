"""Decisions at a rate of their own, for frames of another rate; each frame is asked for once, in order."""

from __future__ import annotations

import numpy as np

from ..motion.rotations import Array

__all__ = ["DECISION_RATE", "FrameDecisions"]

DECISION_RATE = 50  # a second [ours: a decision is then as long as a frame of the rules' slowest display]


class FrameDecisions:
    """How far hands are at rest, 0 … 1, for each decision and each frame; what no frame needs any more is forgotten.

    Args:
        fps: of the frames.
    """

    def __init__(self, fps: float) -> None:
        self._fps = fps
        self._places = list[float]()  # of decisions, from the first that a frame still needs
        self._first = self._frames = 0

    @property
    def count(self) -> int:
        """Of decisions that were added."""
        return self._first + len(self._places)

    def add(self, place: float) -> None:
        """The next decision."""
        self._places.append(place)

    def lack(self, frames: int) -> bool:
        """Whether so many frames, and the one after them, need more decisions."""
        return self.count <= self._index(self._frames + frames)

    def take(self, frames: int) -> Array:
        """(k,) of the next frames, so many at most: of those whose decision is there."""
        index = [self._index(self._frames + k) for k in range(frames)]
        places = np.array([self._places[k - self._first] for k in index if k < self.count], float)
        self._frames += len(places)
        count = max(min(self._index(self._frames) - self._first, len(self._places)), 0)
        del self._places[:count]
        self._first += count
        return places

    def _index(self, frame: int) -> int:
        return round(frame * DECISION_RATE / self._fps)
