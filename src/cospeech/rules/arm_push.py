"""Arms that have to be pushed out of the body leave their way early and come back late, so that nothing jerks.

A network's arms are inside the torso for a part of the time. A push out of it, frame by frame, begins and ends within a few
frames. Here the push of a frame counts for the frames around it, too: less, the further away they are.
"""

from __future__ import annotations

import numpy as np

from ..motion.kinematics.arm_clearance import find_pushes, move_wrists
from ..motion.rotations import Array

__all__ = ["ArmPush"]


class ArmPush:
    """Pushes of arms, spread over the frames around them.

    Args:
        behind: frames after a push in which it still counts.
        ahead: frames before it.
        amount: share of the way that arms go, 0 … 1.
    """

    def __init__(self, behind: int, ahead: int, amount: float) -> None:
        self._behind, self._ahead, self._amount = behind, ahead, amount
        taps = np.arange(-behind, ahead + 1)
        reach = np.where(taps < 0, behind + 1, ahead + 1)
        self._shares = np.cos(np.pi / 2 * taps / reach) ** 2
        self._pushes = np.zeros((behind, 2, 3))

    def add(self, q: Array) -> None:
        """Note the pushes of further frames, (n, J, 4) local rotations of our humanoid."""
        self._pushes = np.concatenate([self._pushes, find_pushes(q)])

    def finish(self) -> None:
        """No frame comes after those that were noted; their last push lasts."""
        self._pushes = np.concatenate([self._pushes, np.repeat(self._pushes[-1:], self._ahead, 0)])

    def apply(self, q: Array) -> None:
        """Move the arms of the next frames (n, J, 4), which is written to."""
        out, back = np.zeros((len(q), 2, 3)), np.zeros((len(q), 2, 3))
        for k, share in enumerate(self._shares):  # one after the other: the same bits in pieces of any size
            near = share * self._pushes[k : k + len(q)]
            out, back = np.maximum(out, near), np.minimum(back, near)
        self._pushes = self._pushes[len(q) :]
        move_wrists(q, self._amount * (out + back))
