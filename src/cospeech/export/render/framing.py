"""From motion to what stands before the camera: world poses near the origin, and the space that they take up."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from math import hypot
from typing import NamedTuple

import numpy as np

from ...motion.motion import Motion
from ...motion.rotations import Array, axis_angle_to_quat, quat_multiply, quat_rotate
from ...motion.skeleton import Skeleton
from ...motion.skeletons.arkit import ARKIT
from .camera import View

__all__ = ["FramedPose", "Framing", "PoseStage", "box_of"]

_SLACK = 0.12  # metres that the hips may wander before the camera follows; ours: swaying is seen, walking is followed
_HURRY = 0.16  # share of the remaining way that the camera goes in 1/30 s; ours
_ASTRAY = 0.30  # metres between feet and floor in the first frame above which the file has another floor than ours


class FramedPose(NamedTuple):
    """One frame, ready to draw: world rotations (J, 4), positions (J, 3) in metres, ARKit weights (52,).

    With one more dimension in front, a row of frames.
    """

    rotations: Array
    positions: Array
    face: Array


class PoseStage:
    """Turns the character to the camera as it stands in the first frame, puts it on the floor, and follows where it walks.

    What it gives for a frame depends on that frame and those before it, not on the pieces in which motion comes.
    """

    def __init__(self, skeleton: Skeleton, fps: float) -> None:
        self._skeleton = skeleton
        self._pace = 1 - (1 - _HURRY) ** (30 / fps)
        self._facing: Array | None = None
        self._centre, self._floor = (0.0, 0.0), 0.0

    def place(self, motion: Motion) -> FramedPose:
        """The T frames of ``motion``, which is on the skeleton announced: (T, J, 4), (T, J, 3) and (T, 52)."""
        positions, rotations = self._skeleton.forward(motion.rotations, motion.root)
        face = np.zeros((len(motion), len(ARKIT))) if motion.face is None else motion.face
        if self._facing is None and len(motion):
            ahead = quat_rotate(rotations[0, 0], np.array([0.0, 0.0, 1.0]))
            self._facing = axis_angle_to_quat((0, 1, 0), -np.arctan2(ahead[0], ahead[2]))
            self._centre = (float(positions[0, 0, 0]), float(positions[0, 0, 2]))
            low, soles = float(positions[0, :, 1].min()), float(self._skeleton.tpose[:, 1].min())
            self._floor = low - soles if abs(low - soles) > _ASTRAY else 0.0
        if self._facing is None or not len(motion):
            return FramedPose(rotations, positions, face)
        centres = np.full((len(motion), 1, 3), self._floor)
        centres[:, 0, [0, 2]] = [self._follow(x, z) for x, z in positions[:, 0, [0, 2]].tolist()]
        return FramedPose(quat_multiply(self._facing, rotations), quat_rotate(self._facing, positions - centres), face)

    def _follow(self, x: float, z: float) -> tuple[float, float]:
        """Where the camera's point of rest on the floor is when the hips are above (x, z)."""
        away = (x - self._centre[0], z - self._centre[1])
        far = hypot(*away)
        if far > _SLACK:
            share = (far - _SLACK) / far * self._pace
            self._centre = (self._centre[0] + away[0] * share, self._centre[1] + away[1] * share)
        return self._centre


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
        self._view, self._skeleton = view, skeleton
        self._settle, self._ahead = max(1, round(self.SETTLE * fps)), max(1, round(self.AHEAD * fps))
        self._box: Array | None = None
        self._waiting: deque[FramedPose] = deque()
        self._boxes: deque[Array] = deque()
        self._sum = np.zeros(6)
        self._settled = False

    def push(self, pose: FramedPose) -> Iterator[tuple[FramedPose, Array]]:
        """Take a pose; give those whose box (6,) — low corner, high corner — is now known."""
        box = box_of(self._view, self._skeleton, pose.positions[None])
        old = box if self._box is None else self._box
        self._box = np.concatenate([np.minimum(old[:3], box[:3]), np.maximum(old[3:], box[3:])])
        self._waiting.append(pose)
        if self._settled:
            self._see()
            yield self._next()
        elif len(self._waiting) == self._settle:
            yield from self._start()

    def flush(self) -> Iterator[tuple[FramedPose, Array]]:
        """The rest, at the end of the motion."""
        if self._box is None:
            return
        if not self._settled:
            yield from self._start()
        while self._waiting:
            self._see()
            yield self._next()

    def _start(self) -> Iterator[tuple[FramedPose, Array]]:
        self._settled = True
        for _ in range(self._ahead):
            self._see()
        while len(self._waiting) > self._ahead:
            yield self._next()

    def _see(self) -> None:
        assert self._box is not None
        self._boxes.append(self._box)
        self._sum = self._sum + self._box
        if len(self._boxes) > self._ahead:
            self._sum = self._sum - self._boxes.popleft()

    def _next(self) -> tuple[FramedPose, Array]:
        return self._waiting.popleft(), self._sum / len(self._boxes)


def box_of(view: View, skeleton: Skeleton, positions: Array) -> Array:
    """Low and high corner (6,) of the box that the camera must show: the view's own and what its joints need.

    Args:
        positions: (T, J, 3) metres.
    """
    at = positions[:, view.joints_of(skeleton)]
    low = np.minimum(view.low, at.min((0, 1)) - view.reach)
    return np.concatenate([low, np.maximum(view.high, at.max((0, 1)) + view.reach)])
