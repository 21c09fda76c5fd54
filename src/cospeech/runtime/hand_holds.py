"""Hands that hold still between strokes, as people's do; ours.

The hands of a network drift all the time. People move a hand, hold it, and move it again. Here a hand that stays near one place
is held in one pose, until it leaves. The hands are held before `BeatAlignment` moves their strokes onto the accents. So the
strokes that begin and end with a hold are the ones that are moved.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..audio.features.mel import overlapping
from ..motion.part_joints import arm_joints
from ..motion.rotations import Array, quat_slerp
from ..motion.skeleton import humanoid
from ..rules.minimum_jerk import minimum_jerk
from .hand_speeds import HandSpeeds

__all__ = ["HandHolds"]

_RADIUS = 0.16
"""Arm lengths, about 9 cm, around the slowest moment in which a hand counts as staying [ours: with .10, still spells of
Mix-StAGE last .36 s; with .20, its hands make too few strokes]."""
_SLOW = 0.4  # arm lengths per second below which a hand may begin to be held [ours]
_LEAST, _MOST = 0.8, 2.4  # seconds that a hand stays [ours: with shorter ones there are more strokes than people make]
_RAMP = 0.34  # seconds in which a hold begins and ends [ours: with .25 s they make strokes, with .4 s still spells are short]
_STILL = 0.9  # share of the hand's own motion that a hold takes away [ours: a hold breathes]


class _Hold(NamedTuple):
    """A hand stays from the first frame to the last, in the pose (joints, 4)."""

    first: int
    last: int
    pose: Array


class _Hand:
    """The holds of one hand.

    Attributes:
        joints: of its arm and fingers.
        next: the next frame that may be the slowest one of a hold.
        free: the last frame of the last hold.
        holds: those that later frames are part of.
    """

    def __init__(self, side: str) -> None:
        names = humanoid().names
        self.joints = [k for k in arm_joints() if names[k].startswith(side)]
        self.next = self.free = 0
        self.holds: list[_Hold] = []

    def add(self, hold: _Hold) -> None:
        """A hold that is known."""
        self.holds.append(hold)
        self.free, self.next = hold.last, hold.last + 1

    def still(self, rotations: Array, start: int, ramp: float) -> None:
        """Hold this hand in frames (n, J, 4) from ``start`` on, in place; ``ramp`` in frames."""
        self.holds = [hold for hold in self.holds if hold.last >= start]
        for first, last, pose in self.holds:
            frames = np.arange(max(first, start), min(last + 1, start + len(rotations)))
            if len(frames):
                near = np.minimum(frames - first, last - frames) / min(ramp, (last - first) / 2)
                share = _STILL * minimum_jerk(np.clip(near, 0, 1))
                own = rotations[frames[0] - start : frames[-1] + 1 - start]
                own[:, self.joints] = quat_slerp(own[:, self.joints].astype(float), pose.astype(float), share[:, None])


class HandHolds:
    """Holds hands still, in frames that come in pieces of any size; these come back the same.

    Args:
        fps: of the frames.
    """

    sound_ahead = 0.0
    """See `MotionLayer`."""

    def __init__(self, fps: float) -> None:
        self._fps, self._speeds = fps, HandSpeeds(fps)
        self._half = max(round(_MOST * fps / 2), 1)  # frames of a hold before its slowest one, and after it, at most
        self._reach = max(self._half, self._speeds.wide + self._speeds.delay)  # frames that decide about a frame
        self._hands = _Hand("left"), _Hand("right")
        self._rotations, self._root = np.zeros((0, len(humanoid()), 4), np.float32), np.zeros((0, 3), np.float32)
        self._wrists, self._speed = np.zeros((0, 2, 3)), np.zeros((0, 2))
        self._first = 0  # index of the first frame that is kept
        self._end, self._frames, self._over = 0, 0, False

    @property
    def look_ahead(self) -> float:
        """Seconds of motion after a frame that it waits for."""
        return (self._half + self._reach + 1) / self._fps

    def push(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """See `MotionLayer.push`."""
        if len(rotations):
            wrists, speed = self._speeds.push(rotations)
            self._rotations, self._root = np.concatenate([self._rotations, rotations]), np.concatenate([self._root, root])
            self._wrists, self._speed = np.concatenate([self._wrists, wrists]), np.concatenate([self._speed, speed])
            self._frames += len(rotations)
        return self._give()

    def finish(self) -> tuple[Array, Array]:
        """See `MotionLayer.finish`."""
        self._over = True
        self._speed = np.concatenate([self._speed, self._speeds.finish()])
        return self._give()

    def _give(self) -> tuple[Array, Array]:
        """The frames of which all holds are known."""
        for side, hand in enumerate(self._hands):
            self._find(side, hand)
        end = self._frames if self._over else min(max(hand.free, hand.next - self._half) for hand in self._hands)
        end = max(end, self._end)
        rows = slice(self._end - self._first, end - self._first)
        rotations, root = self._rotations[rows].copy(), self._root[rows]
        for hand in self._hands:
            hand.still(rotations, self._end, _RAMP * self._fps)
        self._end = end
        self._forget(min(end, *(hand.next - self._half - self._speeds.wide for hand in self._hands)))
        return rotations, root

    def _find(self, side: int, hand: _Hand) -> None:
        """The holds of a hand whose frames are all there."""
        end = self._frames if self._over else self._frames - self._reach
        for frame in self._slowest(side, hand.next, end):
            hold = self._hold_at(side, frame, hand.free) if frame >= hand.next else None
            if hold is not None:
                hand.add(hold)
        hand.next = max(hand.next, end)

    def _slowest(self, side: int, start: int, end: int) -> list[int]:
        """The frames from start to end in which a hand is slow, and slower than shortly before and after."""
        if end <= start:
            return []
        wide = self._speeds.wide
        speeds = self._speed[max(start - wide - self._first, 0) : end + wide - self._first, side]
        speeds = np.pad(speeds, (end - start + 2 * wide - len(speeds), 0), constant_values=np.inf)  # before the first frame
        here, least = speeds[wide:-wide], overlapping(speeds, 2 * wide + 1).min(1)
        return [start + int(k) for k in np.flatnonzero((here <= least) & (here < _SLOW))]

    def _hold_at(self, side: int, frame: int, free: int) -> _Hold | None:
        """The hold around a frame, if the hand stays there for long enough; it begins at ``free`` at the earliest."""
        low, high = max(frame - self._half, free), min(frame + self._half, self._frames - 1)
        wrists = self._wrists[low - self._first : high + 1 - self._first, side]
        at = frame - low
        away = np.flatnonzero(_distance(wrists, wrists[at]) >= _RADIUS)
        k = np.searchsorted(away, at)
        first, last = (int(away[k - 1]) + 1 if k else 0), (int(away[k]) - 1 if k < len(away) else len(wrists) - 1)
        if last - first < _LEAST * self._fps:
            return None
        stay = wrists[first : last + 1]
        centre = low + first + int(_distance(stay, stay.mean(0)).argmin())
        return _Hold(low + first, low + last, self._rotations[centre - self._first, self._hands[side].joints])

    def _forget(self, first: int) -> None:
        """Drop the frames before this one."""
        count = max(first - self._first, 0)
        self._first += count
        self._rotations, self._root = self._rotations[count:], self._root[count:]
        self._wrists, self._speed = self._wrists[count:], self._speed[count:]


def _distance(points: Array, place: Array) -> Array:
    """(n,) from a place to each point (n, 3)."""
    return np.sqrt(np.square(points - place).sum(-1))
