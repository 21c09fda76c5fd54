"""From motion to what stands before the camera: world poses near the origin, and the space that they take up."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..motion import Motion
from ..rotations import Array, axis_angle_to_quat, quat_multiply, quat_rotate
from ..skeleton import Skeleton
from ..skeletons.arkit import ARKIT
from .camera import View

__all__ = ["Framing", "Pose", "Stage"]

_SLACK = 0.12  # metres that the hips may wander before the camera follows; ours: swaying is seen, walking is followed
_HURRY = 0.08  # share of the remaining way that the camera goes in 1/30 s; ours


class Pose(NamedTuple):
    """One frame, ready to draw: world rotations (J, 4), positions (J, 3) in metres, ARKit weights (52,)."""

    rotations: Array
    positions: Array
    face: Array


class Stage:
    """Turns the character to the camera as it stands in the first frame, and follows where it walks.

    What it gives for a frame depends on that frame and those before it, not on the pieces in which motion comes.
    """

    def __init__(self, skeleton: Skeleton, fps: float) -> None:
        self._skeleton = skeleton
        self._pace = 1 - (1 - _HURRY) ** (30 / fps)
        self._facing: Array | None = None
        self._centre = np.zeros(2)

    def poses(self, motion: Motion) -> Iterator[Pose]:
        """The frames of ``motion``, which is on the skeleton announced."""
        positions, rotations = self._skeleton.forward(motion.rotations, motion.root)
        for k in range(len(motion)):
            face = np.zeros(len(ARKIT)) if motion.face is None else motion.face[k]
            if self._facing is None:
                ahead = quat_rotate(rotations[k, 0], np.array([0.0, 0.0, 1.0]))
                self._facing = axis_angle_to_quat((0, 1, 0), -np.arctan2(ahead[0], ahead[2]))
                self._centre = positions[k, 0, [0, 2]]
            away = positions[k, 0, [0, 2]] - self._centre
            far = np.linalg.norm(away)
            if far > _SLACK:
                self._centre = self._centre + away * ((far - _SLACK) / far * self._pace)
            moved = positions[k] - [self._centre[0], 0, self._centre[1]]
            yield Pose(quat_multiply(self._facing, rotations[k]), quat_rotate(self._facing, moved), face)


class Framing:
    """Decides frame by frame what box the camera must show, so that nothing the view cares for leaves the picture.

    The box covers the first ten seconds from the start, and widens, smoothly and in time, for what needs more room later.

    Args:
        view: what to look at.
        skeleton: of the poses.
        fps: of the poses.
    """

    SETTLE, AHEAD = 10.0, 1.5  # seconds: ours. The first is as long as a short clip: most never see the camera move

    def __init__(self, view: View, skeleton: Skeleton, fps: float) -> None:
        self._reach = view.reach
        names = enumerate(skeleton.names)
        self._joints = np.array([k for k, name in names if not view.joints or name.startswith(view.joints)])
        self._settle, self._ahead = max(1, round(self.SETTLE * fps)), max(1, round(self.AHEAD * fps))
        self._box = np.array([*view.low, *(-x for x in view.high)])  # (6,) low corner, minus the high corner: both shrink
        self._waiting: deque[Pose] = deque()
        self._boxes: deque[Array] = deque()
        self._sum = np.zeros(6)
        self._settled = False

    def push(self, pose: Pose) -> Iterator[tuple[Pose, Array]]:
        """Take a pose; give those whose box (6,) — low corner, high corner — is now known."""
        at = pose.positions[self._joints]
        self._box = np.minimum(self._box, np.concatenate([at.min(0) - self._reach, -at.max(0) - self._reach]))
        self._waiting.append(pose)
        if self._settled:
            self._see(self._box)
            yield self._next()
        elif len(self._waiting) == self._settle:
            yield from self._start()

    def flush(self) -> Iterator[tuple[Pose, Array]]:
        """The rest, at the end of the motion."""
        if not self._settled:
            yield from self._start()
        while self._waiting:
            self._see(self._box)
            yield self._next()

    def _start(self) -> Iterator[tuple[Pose, Array]]:
        self._settled = True
        for _ in range(self._ahead):
            self._see(self._box)
        while len(self._waiting) > self._ahead:
            yield self._next()

    def _see(self, box: Array) -> None:
        self._boxes.append(box)
        self._sum = self._sum + box
        if len(self._boxes) > self._ahead:
            self._sum = self._sum - self._boxes.popleft()

    def _next(self) -> tuple[Pose, Array]:
        mean = self._sum / len(self._boxes)
        return self._waiting.popleft(), np.concatenate([mean[:3], -mean[3:]])
