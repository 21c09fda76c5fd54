"""The joint between motion that is given and what goes on from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..motion.edit import OffsetFade
from ..motion.motion import Motion
from ..motion.rotations import Array
from .conditioning import FADE

__all__ = ["Seam"]


class Seam:
    """What is missing from the last frame of a motion to the first that goes on from it, faded out within half a second.

    A network goes on in its own representation, which does not say all: one has fewer numbers for a thumb than a thumb has
    angles, or none for feet and eyes. Here every joint goes on from where it was.

    Args:
        before: the motion, of any skeleton that is recognised; one frame at least.
        fps: of what goes on.
        still: joints that are not generated, and stay as they are.
        placed: whether the hips' place is generated.
    """

    def __init__(self, before: Motion, fps: float, *, still: Sequence[int] = (), placed: bool = True) -> None:
        last = before[len(before) - 1 :].retarget("humanoid")
        self._rotations, self._root = np.asarray(last.rotations[0], float), np.asarray(last.root[0], float)
        self._fps, self._still, self._placed = fps, list(still), placed
        self._gap: OffsetFade | None = None

    def blend(self, rotations: Array, root: Array, first: int) -> tuple[Array, Array]:
        """Rotations (n, J, 4) and places (n, 3) of the frames from ``first`` on, which is 0 at the first call."""
        if self._gap is None:
            self._gap = OffsetFade(self._rotations, self._root, rotations[0], root[0])
            self._gap.turns[self._still] = 0.0
            self._gap.way *= self._placed
        left = np.clip(1 - (first + np.arange(len(rotations)) + 1) / (FADE * self._fps), 0, 1)  # all of it a frame before
        return self._gap.apply(rotations, root, left)
