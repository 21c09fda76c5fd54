"""The torso as both arms see it, and the lap of a seated body, on which hands lie."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..motion.curves import smoothstep
from ..motion.kinematics.arm_clearance import TrunkFrames
from ..motion.kinematics.arms import MIRROR_Q, MIRROR_V, mirror_arm
from ..motion.kinematics.body import Body
from ..motion.kinematics.body_volume import HEAD_CENTRE, THIGH_TOP
from ..motion.rotations import Array, euler_to_quat, quat_conjugate, quat_multiply, quat_rotate
from ..motion.skeleton import humanoid
from .styles import Style

__all__ = ["ArmFrames", "arm_frames", "lay_on_lap", "offsets"]

_STAYING = 0.7  # share of a seated trunk's lean that raised hands do not take part in (ours)
_KNEE_RAISE = 0.09  # metres by which a leg over the other's knee raises the lap
_LEANS = 0.6  # share of the style's lean that a seated trunk has in the middle (ours)
_OFF_LAP, _LIFTS_OVER = -0.40, 0.32
"""Arm lengths above the shoulder of a hand that has left the lap; and below it, of one that lies there and does not sway with
the trunk. [ours]"""


@lru_cache(1)
def offsets() -> dict[str, Array]:
    """(3,) metres of our humanoid's joints from their parents by name; with ``t:`` before it, where they are in the T-pose."""
    s = humanoid()
    names = ("hips", "spine", "chest", "upperChest", "neck", "head", "leftShoulder", "leftUpperArm")
    return {n: s.offsets[s.index[n]] for n in names} | {"t:" + n: s.tpose[s.index[n]] for n in names}


class ArmFrames(NamedTuple):
    """The torso as both arms see it: (N, 2, …), the right side mirrored; positions relative to the upper chest's joint."""

    trunk: TrunkFrames
    gesture: Array
    to_seat: Array
    from_seat: Array
    seat_at: Array
    lap: Array
    """(N, 1) height of the lap where the hips of the T-pose are: it stays level when the pelvis tilts."""
    stay: Array
    """Offset with which the hands of a seated body stay in place when the trunk leans."""


def _lean(style: Style, share: float) -> Array:
    """(4,) how a share of the usual lean turns the trunk of a seated body."""
    return euler_to_quat(np.array([0.0, np.radians(_LEANS * share * style.lean), 0.0]), "YXZ")


def _over_hips() -> Array:
    """(3,) from the hips to the upper chest of the T-pose, metres."""
    return offsets()["t:upperChest"] - offsets()["t:hips"]


def arm_frames(places: dict[str, tuple[Array, Array]], neck: Array, b: Array, rotations: Array, style: Style) -> ArmFrames:
    """How both arms see torso, head and lap.

    Args:
        places: position (N, 3) and rotation (N, 4) of hips and upper chest, relative to the feet.
        neck: (N, 3) where the neck begins.
        b: (N, channels) of the body's track.
        rotations: (N, joints, 4), of which neck and head are read.
        style: of the speaker.
    """
    chest_at, chest = places["upperChest"]
    hips_at, hips = places["hips"]
    back = quat_conjugate(chest)
    upright = b.copy()
    upright[:, [Body.PITCH, Body.ROLL]] *= 0.5  # ours: gesture space follows the chest's turn, but only half its bend
    gesture = quat_multiply(back, euler_to_quat(np.radians(upright[:, [Body.YAW, Body.PITCH, Body.ROLL]]), "YXZ"))
    joint = humanoid().index
    neck_world = quat_multiply(chest, rotations[:, joint["neck"]])
    head_joint = neck + quat_rotate(neck_world, offsets()["head"])
    head_world = quat_multiply(neck_world, rotations[:, joint["head"]])
    head = quat_rotate(back, head_joint + quat_rotate(head_world, HEAD_CENTRE) - chest_at)
    to_hips = quat_multiply(quat_conjugate(hips), chest)
    hips_from = quat_rotate(quat_conjugate(hips), chest_at - hips_at)
    o, stay = offsets(), np.zeros((len(b), 3))
    if style.seated:
        usual = quat_rotate(_lean(style, 1.0), _over_hips())
        stay = quat_rotate(back, _STAYING * (usual - (chest_at - hips_at)))
    crossing = smoothstep(b[:, [Body.LEFT_LIFT, Body.RIGHT_LIFT]].max(1, keepdims=True) / 0.18)
    lap = float(o["t:hips"][1]) - 0.04 + THIGH_TOP + _KNEE_RAISE * crossing
    both_to_hips, to_seat = mirror_arm(to_hips, MIRROR_Q), mirror_arm(chest, MIRROR_Q)
    return ArmFrames(
        TrunkFrames(both_to_hips, quat_conjugate(both_to_hips), mirror_arm(hips_from, MIRROR_V), mirror_arm(head, MIRROR_V)),
        mirror_arm(gesture, MIRROR_Q),
        to_seat,
        quat_conjugate(to_seat),
        mirror_arm(chest_at - hips_at, MIRROR_V),
        lap,
        mirror_arm(stay, MIRROR_V),
    )


def lay_on_lap(target: Array, place: Array, height: Array, frames: ArmFrames, style: Style) -> Array:
    """Wrists of a seated body: one near the lap lies there, however the trunk sways.

    Args:
        target: (N, 2, 3) metres, where wrists are if they sway with the trunk.
        place: (N, 2, 3) metres from the shoulder in the gesture space.
        raised: (N, 2) arm lengths above the shoulder.
        frames: of the same moments.
        style: of the speaker.
    """
    shoulder = offsets()["leftShoulder"] + offsets()["leftUpperArm"]
    usual = quat_rotate(_lean(style, 0.5), place) + quat_rotate(_lean(style, 1.0), shoulder + _over_hips())
    lies = smoothstep((_OFF_LAP - height) / _LIFTS_OVER)[..., None]
    result: Array = target + lies * (quat_rotate(frames.from_seat, usual - frames.seat_at) - target)
    return result
