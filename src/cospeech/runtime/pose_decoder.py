"""Vectors of poses, piece by piece → rotations and root of our humanoid."""

from __future__ import annotations

import numpy as np

from ..motion.points import Points
from ..motion.poses import Pose
from ..motion.poses.expmap import ExpMap
from ..motion.poses.lift import lift
from ..motion.rotations import Array
from ..motion.skeleton import humanoid

__all__ = ["PoseDecoder"]


class PoseDecoder:
    """Motion of one take. For a body that walks it keeps the place of the walk: its vectors hold steps, which add up.

    Args:
        pose: the representation.
        fps: of the motion.
        step: frames of the model in one of the motion; a step of the walk is as much longer.
    """

    def __init__(self, pose: Pose, fps: float, step: float) -> None:
        self._pose, self._fps, self._step = pose, fps, step
        self._walk = (0.0, 0.0, 0.0)

    def push(self, vectors: Array) -> tuple[Array, Array]:
        """(n, D) that come next → (n, J, 4) rotations and (n, 3) root, in float32; pieces make what the whole makes."""
        if isinstance(self._pose, ExpMap):
            vectors = self._pose.at_rate(np.asarray(vectors, float), self._step)
            motion = self._pose.decode(vectors, self._fps, start=self._walk)
            self._walk = self._pose.end_of_walk(vectors, self._walk)
        else:
            motion = self._pose.decode(vectors, self._fps)
        if isinstance(motion, Points):
            motion = lift(motion)
        if motion.skeleton != humanoid():
            motion = motion.retarget("humanoid")
        return motion.rotations.astype(np.float32, copy=False), motion.root.astype(np.float32, copy=False)
