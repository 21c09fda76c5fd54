"""Choose a few typical moments of a motion of unknown length, in constant memory."""

from __future__ import annotations

import numpy as np

from ...motion.rotations import Array
from ...motion.skeleton import Skeleton
from .framing import FramedPose

__all__ = ["Keyframes"]

_BINS = 96  # least stretches of a long motion; the best frame of each is kept; ours: a dozen for each picture of a strip
_STILL = 0.10  # seconds; ours: a hand that moves at 1 m/s must be 10 cm farther out to be worth as much as one at rest
_MIDDLE = 0.6  # share of each part in which its picture may lie, so that two pictures are never near in time


class Keyframes:
    """Keeps the frames in which the hands are farthest from hanging down, and nearly at rest, from all parts of a motion.

    Time is cut into stretches of equal length, and the best frame of each is kept. When there are 192, every two become one.

    Args:
        skeleton: of the poses; ours.
        fps: frames per second.
    """

    def __init__(self, skeleton: Skeleton, fps: float) -> None:
        joint = skeleton.index
        self._hands = [joint["leftHand"], joint["rightHand"]]
        self._shoulders = [joint["leftUpperArm"], joint["rightUpperArm"]]
        tpose = skeleton.tpose
        self._arm = float(np.linalg.norm(tpose[self._hands[0]] - tpose[self._shoulders[0]]))
        self._fps, self.frames = fps, 0
        self._span = 1  # frames per stretch
        self._entries: list[tuple[float, int, FramedPose]] = []
        self._last: Array | None = None

    def push(self, poses: FramedPose) -> None:
        """Take T more frames, as `PoseStage.place` gives them."""
        for k, worth in enumerate(self._worth(poses.positions).tolist()):
            stretch = self.frames // self._span
            if stretch == 2 * _BINS:
                self._entries = [
                    max(pair, key=lambda item: item[0]) for pair in zip(self._entries[::2], self._entries[1::2], strict=True)
                ]
                self._span *= 2
                stretch = self.frames // self._span
            if stretch == len(self._entries) or worth > self._entries[stretch][0]:
                item = worth, self.frames, FramedPose(*(values[k].copy() for values in poses))
                self._entries[stretch:] = [item]
            self.frames += 1

    def _worth(self, positions: Array) -> Array:
        """(T,) metres: how far the hands are from hanging down, less a share of their speed."""
        hands = positions[:, self._hands]
        away = hands - positions[:, self._shoulders]
        away[..., 1] += self._arm
        before = np.concatenate([hands[:1] if self._last is None else self._last, hands[:-1]])
        self._last = hands[-1:]
        speed = np.linalg.norm(hands - before, axis=-1) * self._fps
        return (np.linalg.norm(away, axis=-1) - _STILL * speed).sum(1)

    def best(self, count: int) -> list[tuple[int, FramedPose]]:
        """At most ``count`` moments in order, as (frame, pose): one from each of ``count`` equal parts of the motion."""
        moments = []
        count = min(count, self.frames)
        for part in range(count):
            middle, half = (part + 0.5) * self.frames / count, 0.5 * _MIDDLE * self.frames / count
            near = [item for item in self._entries if abs(item[1] + 0.5 - middle) <= half]
            best = max(near, key=lambda item: item[0]) if near else min(self._entries, key=lambda item: abs(item[1] - middle))
            moments.append((best[1], best[2]))
        return moments
