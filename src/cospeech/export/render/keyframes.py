"""Choosing a few telling moments of a motion of unknown length, in constant memory."""

from __future__ import annotations

import numpy as np

from ...motion.rotations import Array
from ...motion.skeleton import Skeleton
from .framing import FramedPose

__all__ = ["Keyframes"]

_BINS = 96  # stretches of time of which the best frame is kept; ours: a dozen for each picture of a strip
_STILL = 0.10  # seconds; ours: a hand moving at 1 m/s must be 10 cm farther out to be worth as much as one at rest
_MIDDLE = 0.6  # share of each stretch in which its picture may lie, so that two never show nearly the same moment


class Keyframes:
    """Keeps the frames in which the hands are farthest from hanging down, and nearly at rest, from all parts of a motion.

    Time is cut into at most 96 stretches of equal length, of which the best frame is kept; when there are more, every two
    become one.

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
        self._kept: list[tuple[float, int, FramedPose]] = []
        self._last: Array | None = None

    def push(self, poses: FramedPose) -> None:
        """Take T more frames, as `stage.Stage.place` gives them."""
        for k, worth in enumerate(self._worth(poses.positions).tolist()):
            stretch = self.frames // self._span
            if stretch == 2 * _BINS:
                self._kept = [
                    max(pair, key=lambda kept: kept[0]) for pair in zip(self._kept[::2], self._kept[1::2], strict=True)
                ]
                self._span *= 2
                stretch = self.frames // self._span
            if stretch == len(self._kept) or worth > self._kept[stretch][0]:
                kept = worth, self.frames, FramedPose(*(values[k].copy() for values in poses))
                self._kept[stretch:] = [kept]
            self.frames += 1

    def _worth(self, positions: Array) -> Array:
        """(T,) metres: how far the hands are from hanging, less what they move."""
        hands = positions[:, self._hands]
        away = hands - positions[:, self._shoulders]
        away[..., 1] += self._arm
        before = np.concatenate([hands[:1] if self._last is None else self._last, hands[:-1]])
        self._last = hands[-1:]
        speed = np.linalg.norm(hands - before, axis=-1) * self._fps
        return (np.linalg.norm(away, axis=-1) - _STILL * speed).sum(1)

    def best(self, count: int) -> list[tuple[int, FramedPose]]:
        """At most ``count`` moments in order, as (frame, pose), one from each of as many equal parts of the motion."""
        chosen = []
        count = min(count, self.frames)
        for part in range(count):
            middle, half = (part + 0.5) * self.frames / count, 0.5 * _MIDDLE * self.frames / count
            near = [kept for kept in self._kept if abs(kept[1] + 0.5 - middle) <= half]
            best = max(near, key=lambda kept: kept[0]) if near else min(self._kept, key=lambda kept: abs(kept[1] - middle))
            chosen.append((best[1], best[2]))
        return chosen
