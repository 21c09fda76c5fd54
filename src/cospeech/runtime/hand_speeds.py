"""Speeds of the two hands, smoothed, of frames that come in pieces of any size."""

from __future__ import annotations

import numpy as np

from ..motion.kinematics.arms import wrists_in_chest
from ..motion.rotations import Array

__all__ = ["HandSpeeds"]

_WIDTH = 0.1  # seconds to either side over which a speed is smoothed [ours]


class HandSpeeds:
    """Follows the wrists in the frame of the chest. Pieces of any size give the bits of the whole.

    Args:
        fps: of the frames.
    """

    def __init__(self, fps: float) -> None:
        self._fps = fps
        self.wide = max(round(_WIDTH * fps), 1)
        """Frames to either side over which a speed is smoothed."""
        kernel = np.hanning(2 * self.wide + 3)[1:-1]
        self._kernel = kernel / kernel.sum()
        self._wrists = np.zeros((0, 2, 3))  # the last two that came
        self._raw = np.zeros((0, 2))

    @property
    def delay(self) -> int:
        """Frames after a frame that must have come until its speed is known."""
        return self.wide + 1

    def push(self, rotations: Array) -> tuple[Array, Array]:
        """The next frames.

        Args:
            rotations: (n, J, 4) of our humanoid, local; n is at least 1.

        Returns:
            (n, 2, 3) their left and right wrists from the own shoulders, arm lengths; (m, 2) the speeds that become known, arm
            lengths per second.
        """
        wrists = wrists_in_chest(np.asarray(rotations, float))
        before = self._wrists if len(self._wrists) else np.repeat(wrists[:1], self.wide + 1, 0)
        return wrists, self._follow(np.concatenate([before, wrists]))

    def finish(self) -> Array:
        """(m, 2) the speeds of the last frames, and of some after them in which the hands stand still."""
        if not len(self._wrists):
            return np.zeros((0, 2))
        return self._follow(np.concatenate([self._wrists, np.repeat(self._wrists[-1:], 2 * self.wide + 2, 0)]))

    def _follow(self, wrists: Array) -> Array:
        """One tap after the other, so that the bits are the same in pieces of any size."""
        self._wrists = wrists[-2:]
        ways = wrists[2:] - wrists[:-2]
        raw = np.concatenate([self._raw, np.sqrt(np.einsum("nsi,nsi->ns", ways, ways)) * (self._fps / 2)])
        count = max(len(raw) - 2 * self.wide, 0)
        smooth = np.zeros((count, 2))
        for k, weight in enumerate(self._kernel):
            smooth += weight * raw[k : k + count]
        self._raw = raw[count:]
        return smooth
