"""Arms of a network that bend as arms do; ours.

A network that makes rotations joint by joint sometimes turns an upper arm about its own axis so far that the elbow bends
backwards or to a side. The places of wrist and elbow are right then, and the turn is wrong. Here the upper arm is turned
about its own axis, and the forearm back, until the elbow bends the way it can. Elbow, wrist and hand stay where they are.
A forearm that is only a little beyond its limit is brought back instead. After it, the turn of the hand about the forearm,
and the wrist, are brought within their limits.
"""

from __future__ import annotations

import math

import numpy as np

from ..motion.curves import clip, smoothstep
from ..motion.rotations import (
    Array,
    QuatStream,
    axis_angle_to_quat,
    euler_to_quat,
    quat_between,
    quat_multiply,
    quat_rotate,
    quat_to_euler,
    quat_to_rotvec,
    quat_twist,
    rotvec_to_quat,
)
from ..motion.skeleton import humanoid

__all__ = ["ArmLimits"]

_MIRROR = np.array([1.0, -1.0, -1.0, 1.0])
_X = np.array([1.0, 0.0, 0.0])
_HINGE = math.sin(
    math.radians(8.0)
)  # how far the forearm may be off the plane in which the elbow bends [ours: anatomy allows 10°]
_STRAIGHT = math.sin(
    math.radians(20.0)
)  # of an elbow that is straight enough to be brought back, whichever way it bends [ours]
_OFF, _BEHIND = (
    math.sin(math.radians(9.5)),
    -math.sin(math.radians(4.5)),
)  # of the forearm, where it is brought back [ours: inside]
_FOLD = math.tan(math.radians(30.0))  # of a forearm that is folded up as far as it goes, 150° [ours: anatomy allows 152°]
_LITTLE = np.radians([20.0, 40.0])  # radians by which a forearm is brought back wholly, and from which not at all [ours]
_QUICK, _BACK = 7.0, 0.4  # radians a second by which a turn goes where it has to, and back [ours: an upper arm turns at 14]
_SUPINATION = math.radians(
    96.0
)  # of the hand about the forearm, from the middle [ours: Kapandji has 80 to 90, and the wrist some]
_WRIST = np.radians([[-28.0, 40.0], [-80.0, 76.0]])  # deviation and flexion, radians [ours: Kapandji, and 2° inside]


class ArmLimits:
    """Brings arms within the limits of their joints, in frames that come in pieces of any size; these come back the same.

    Args:
        fps: of the frames.
    """

    look_ahead = 0.0
    """See `cospeech.runtime.motion_layers.MotionLayer`."""
    sound_ahead = 0.0
    """See there."""

    def __init__(self, fps: float) -> None:
        self._fps, self._signs = fps, QuatStream()
        self._arms = _Arm("left", fps), _Arm("right", fps)

    def push(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """See `MotionLayer.push`."""
        if not len(rotations):
            return rotations, root
        out = rotations.copy()
        for arm in self._arms:
            arm.limit(out)
        return self._signs.push(out), root

    def finish(self) -> tuple[Array, Array]:
        """See `MotionLayer.finish`: no frame waits."""
        return np.zeros((0, len(humanoid()), 4), np.float32), np.zeros((0, 3), np.float32)


class _Turn:
    """A turn about an axis that keeps an angle within its room, and is never quick.

    Args:
        fps: of the frames.
    """

    def __init__(self, fps: float) -> None:
        self._turn: float | None = None  # in the last frame, radians
        self._quick, self._back = _QUICK / fps, _BACK / fps

    def follow(self, angles: Array, room: Array) -> Array:
        """(n,) radians by which angles (n,) are to become less, so that they are within ± (n,) ``room``."""
        turns, turn = np.empty(len(angles)), self._turn
        for k, (goal, most) in enumerate(zip(angles.tolist(), room.tolist(), strict=True)):
            if turn is None:
                goal = math.remainder(goal, math.tau)
                turn = goal - min(max(goal, -most), most)
            off = math.remainder(goal - turn, math.tau)
            if abs(off) > most:
                turn += min(max(off - math.copysign(most, off), -self._quick), self._quick)
            else:
                back = min(max(-turn, -self._back), self._back)
                turn += back if abs(off - back) <= most else 0.0
            turns[k] = turn
        self._turn = turn
        return turns


class _Arm:
    """One arm, seen as a left one."""

    def __init__(self, side: str, fps: float) -> None:
        index = humanoid().index
        self._joints = [index[side + part] for part in ("UpperArm", "LowerArm", "Hand")]
        self._mirror = np.ones(4) if side == "left" else _MIRROR
        self._elbow, self._forearm = _Turn(fps), _Turn(fps)

    def limit(self, rotations: Array) -> None:
        """Write the arm of the next frames (n, J, 4)."""
        upper, fore, hand = (rotations[:, joint].astype(float) * self._mirror for joint in self._joints)
        hand = _limit_wrist(hand)
        turns = self._elbow.follow(*_find_bend(quat_rotate(fore, _X)))
        upper = quat_multiply(upper, axis_angle_to_quat(_X, turns))
        fore = _bring_back(quat_multiply(axis_angle_to_quat(_X, -turns), fore))
        supination = -_angle(quat_twist(fore, _X)) - _angle(quat_twist(hand, _X))
        fore = quat_multiply(fore, axis_angle_to_quat(_X, self._forearm.follow(supination, np.full(len(fore), _SUPINATION))))
        for joint, rotation in zip(self._joints, (upper, fore, hand), strict=True):
            rotations[:, joint] = rotation * self._mirror


def _find_bend(bones: Array) -> tuple[Array, Array]:
    """Of directions (n, 3) of the forearm, in the frame of the upper arm: how far the upper arm would have to turn so that the
    elbow bends straight towards +Z, and by how much it may turn less, radians (n,) each."""
    bend = np.hypot(bones[:, 1], bones[:, 2])
    room = np.where(bend <= _STRAIGHT, math.pi, np.arcsin(np.minimum(_HINGE / np.maximum(bend, 1e-9), 1.0)))
    return -np.arctan2(bones[:, 1], bones[:, 2]), room


def _bring_back(fore: Array) -> Array:
    """The forearm (n, 4) in the frame of the upper arm, within the limits of the elbow where little is missing."""
    bone = quat_rotate(fore, _X)
    inside = np.stack(
        [
            bone[:, 0],
            clip(bone[:, 1], -_OFF, _OFF),
            np.maximum(bone[:, 2], np.where(bone[:, 0] > 0, _BEHIND, -_FOLD * bone[:, 0])),
        ],
        -1,
    )
    if np.array_equal(inside, bone):
        return fore
    inside[:, 0] = np.copysign(np.sqrt(np.maximum(1.0 - np.square(inside[:, 1:]).sum(1), 0.0)), bone[:, 0])
    way = quat_to_rotvec(quat_between(bone, inside))
    share = 1.0 - smoothstep((np.linalg.norm(way, axis=1) - _LITTLE[0]) / (_LITTLE[1] - _LITTLE[0]))
    return quat_multiply(rotvec_to_quat(way * share[:, None]), fore)


def _angle(twist: Array) -> Array:
    return np.asarray(2.0 * np.arctan2(twist[:, 0], twist[:, 3]))


def _limit_wrist(hand: Array) -> Array:
    angles = quat_to_euler(hand, "XYZ")
    inside = angles.copy()
    for column, (low, high) in zip((1, 2), _WRIST, strict=True):
        inside[:, column] = clip(angles[:, column], low, high)
    is_outside = (inside != angles).any(1)
    return np.where(is_outside[:, None], euler_to_quat(inside, "XYZ"), hand)
