"""Compute the joint angles of a robot's arms, head and trunk from the rotations of a body.

The frame is that of ROS (REP 103): x forward, y to the left, z up. Angles are those of NAO's documentation, which most social
robots share. At 0, the arms point forward, and the elbows bend about the vertical:

* shoulder: pitch about y (90° hangs down), then roll about z (left: outward is positive), then yaw about the upper arm;
* elbow: a bend about the axis that the yaw has turned (left: negative, right: positive);
* forearm: yaw about itself; hand: 0 closed … 1 open;
* head and trunk: yaw, pitch (positive: forward), roll.

If an arm points straight to the side, pitch and yaw of its shoulder turn about the same line. Then pitch keeps its value, and
yaw takes the rest (swing and twist), so that no joint spins.
"""

from __future__ import annotations

import numpy as np

from ..curves import smoothstep
from ..motion import Motion
from ..rotations import Array, axis_angle_to_quat, quat_multiply, quat_to_euler, quat_to_matrix

__all__ = ["CHANNELS", "BodyAngles"]

_ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "forearm_yaw", "hand")
CHANNELS = (
    *(f"left_{name}" for name in _ARM), *(f"right_{name}" for name in _ARM),
    "head_yaw", "head_pitch", "head_roll", "torso_yaw", "torso_pitch", "torso_roll",
)  # fmt: skip
"""Angles in radians, hands 0 … 1."""

_ROS = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # ours (x left, y up, z forward) → ROS
_AXES = {
    "left": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "right": np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]),
}
"""Columns: directions along the bone, across it, and along the elbow's hinge in the T-pose, in our axes."""
_FIST = np.radians(70.0)  # mean bend of the knuckles of a closed hand [ours]
_FASTEST = 12.0  # highest speed of pitch, radians per second: it could jump at the side; the fastest gestures have 10 [ours]
_FREE = (0.10, 0.35)  # cosine of roll below which pitch stays, and above which it is free [ours: 84° and 70°]


class BodyAngles:
    """Computes angles of motion that comes in pieces; the pieces together give those of the whole."""

    def __init__(self) -> None:
        self._pitch: dict[str, tuple[float | None, bool]] = {}
        self._yaw: dict[str, float] = {}

    def push(self, motion: Motion) -> dict[str, Array]:
        """Channel → (T,) angles of the next frames, on our humanoid or on any recognised skeleton."""
        motion = motion if motion.skeleton.kind == "humanoid" else motion.retarget("humanoid")
        joint = motion.skeleton.index

        def together(*names: str) -> Array:
            product = motion.rotations[:, joint[names[0]]].astype(float)
            for name in names[1:]:
                product = quat_multiply(product, motion.rotations[:, joint[name]].astype(float))
            return product

        angles: dict[str, Array] = {}
        for side in ("left", "right"):
            arm = together(f"{side}Shoulder", f"{side}UpperArm")
            arm_angles = self._arm(side, arm, together(f"{side}LowerArm"), together(f"{side}Hand"), motion.fps)
            arm_angles["hand"] = self._openness(motion, side)
            angles |= {f"{side}_{name}": value for name, value in arm_angles.items()}
        for name, joints in (("head", ("neck", "head")), ("torso", ("spine", "chest", "upperChest"))):
            euler = quat_to_euler(together(*joints), "YXZ")  # our y, x and z are ROS' z, y and x
            angles |= {f"{name}_{angle}": euler[:, k] for k, angle in enumerate(("yaw", "pitch", "roll"))}
        return angles

    def _arm(self, side: str, upper: Array, lower: Array, hand: Array, fps: float) -> dict[str, Array]:
        axes = _AXES[side]
        m = _ROS @ quat_to_matrix(upper) @ axes
        roll = np.arcsin(np.clip(m[:, 1, 0], -1, 1))
        pitch = self._hold(side, np.arctan2(-m[:, 2, 0], m[:, 0, 0]), np.cos(roll), _FASTEST / fps)
        rest = np.swapaxes(_turn(1, pitch) @ _turn(2, roll), 1, 2) @ m
        sign = -1.0 if side == "left" else 1.0
        f = axes.T @ quat_to_matrix(lower) @ axes  # the forearm's frame in that of the upper arm
        bend = np.arctan2(np.hypot(f[:, 1, 0], f[:, 2, 0]), f[:, 0, 0])
        off = np.arctan2(sign * f[:, 2, 0], sign * f[:, 1, 0]) * smoothstep(np.sin(bend) / 0.3)  # a bend beside the hinge
        yaw = _twist(rest) + off
        elbow = sign * bend
        forearm = np.swapaxes(_turn(0, off) @ _turn(2, elbow), 1, 2) @ f @ (axes.T @ quat_to_matrix(hand) @ axes)
        twist = _twist(forearm)
        return {
            "shoulder_pitch": pitch, "shoulder_roll": roll, "shoulder_yaw": self._unwrap(f"{side} arm", yaw), "elbow": elbow,
            "forearm_yaw": self._unwrap(f"{side} forearm", twist),
        }  # fmt: skip

    def _hold(self, side: str, pitch: Array, cosine: Array, most: float) -> Array:
        """Let pitch follow as far as the arm's direction defines it, by the short way."""
        free = smoothstep((cosine - _FREE[0]) / (_FREE[1] - _FREE[0]))
        result, (last, behind) = np.empty_like(pitch), self._pitch.get(side, (None, False))
        for k, (target, share) in enumerate(zip(pitch.tolist(), free.tolist(), strict=True)):
            way = 0.0 if last is None else _short(target - last)
            behind = last is not None and (share < 1 or (behind and abs(way) > most))
            last = target if last is None else last + (min(max(share * way, -most), most) if behind else way)
            result[k] = last
        self._pitch[side] = last, behind
        return result

    def _unwrap(self, name: str, angle: Array) -> Array:
        """Remove jumps of a whole turn, also between pieces."""
        if not len(angle):
            return angle
        first = self._yaw.get(name, float(angle[0]))
        whole = np.unwrap(np.concatenate([[first], angle]))[1:]
        self._yaw[name] = float(whole[-1])
        return whole

    @staticmethod
    def _openness(motion: Motion, side: str) -> Array:
        joint = motion.skeleton.index
        knuckles = [joint[f"{side}{finger}Proximal"] for finger in ("Index", "Middle", "Ring", "Little")]
        bend = 2 * np.arccos(np.clip(np.abs(motion.rotations[:, knuckles, 3].astype(float)), 0, 1)).mean(1)
        return np.clip(1 - bend / _FIST, 0, 1)


def _turn(axis: int, angle: Array) -> Array:
    """(T, 3, 3) rotations about x, y or z."""
    return quat_to_matrix(axis_angle_to_quat(np.eye(3)[axis], angle))


def _twist(m: Array) -> Array:
    """(T,) twist of rotations (T, 3, 3) about x, without their swing."""
    return np.arctan2(m[:, 2, 1] - m[:, 1, 2], m[:, 1, 1] + m[:, 2, 2])


def _short(angle: float) -> float:
    """The same angle in −π … π."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
