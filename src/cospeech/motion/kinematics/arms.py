"""Compute rotations of clavicle, arm, forearm, hand and fingers from the place of a wrist in gesture space.

All formulas are for a left arm. The right one is mirrored before, and mirrored back after (x → −x). The method is two-bone
inverse kinematics with the elbow's swivel as the free parameter (Tolani, Goswami & Badler 2000).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..curves import clip
from ..rotations import (
    Array,
    cross,
    matrix_to_quat,
    quat_conjugate,
    quat_identity,
    quat_multiply,
    quat_rotate,
    vector_normalize,
)
from ..skeleton import humanoid
from .hands import Channel
from .two_bones import place_middle_joint

__all__ = [
    "FINGERS", "MIRROR_Q", "MIRROR_V", "MOST_REACH", "ArmLengths", "arm_lengths", "bone_frame", "finger_angles",
    "finger_joints", "finger_rotations", "hand_turns", "mirror_arm", "reach", "solve_arm", "to_parent", "wrists_in_chest",
]  # fmt: skip

MIRROR_V, MIRROR_Q = np.array([-1.0, 1.0, 1.0]), np.array([1.0, -1.0, -1.0, 1.0])
"""Factors that mirror positions and rotations between the left and the right arm."""
MOST_REACH = 0.992  # of the arm's full length: an elbow is never quite straight (ours; motion.md: flexion 5 % = 16–54°)
FOREARM_SHARE = 0.6  # share of pronation in the forearm bone; the wrist has the rest, so that skin twists gradually
FINGERS = ("Index", "Middle", "Ring", "Little")
_SPREAD_SHARE = np.array([-1.0, -0.15, 0.65, 1.5])  # of the spread angle, index … little, about the hand's normal
POLE = np.array([0.30, -0.70, -0.65])  # natural direction of an elbow: out, down, back (ours, by eye)


class ArmLengths(NamedTuple):
    """Lengths of the bones of an arm, metres."""

    upper: float
    fore: float

    @property
    def total(self) -> float:
        """Length of a straight arm from shoulder to wrist."""
        return self.upper + self.fore


@lru_cache(1)
def arm_lengths() -> ArmLengths:
    """Arm lengths of our humanoid."""
    s = humanoid()
    return ArmLengths(*(float(np.linalg.norm(s.offsets[s.index[n]])) for n in ("leftLowerArm", "leftHand")))


def mirror_arm(left: Array, mirror: Array) -> Array:
    """(N, 2, k): values of the left arm (N, k), and their mirror images for the right one, by `MIRROR_V` or `MIRROR_Q`."""
    both = np.empty((len(left), 2, left.shape[1]))
    both[:, 0] = left
    np.multiply(left, mirror, out=both[:, 1])
    return both


def _about(axis: int, angle: Array) -> Array:
    q = np.zeros((*angle.shape, 4))
    q[..., axis] = np.sin(angle / 2)
    q[..., 3] = np.cos(angle / 2)
    return q


def reach(target: Array) -> Array:
    """Pull shoulder-relative targets ``(..., 3)`` softly inside what the arm can reach (and out of the shoulder)."""
    upper, fore = arm_lengths()
    far, near = MOST_REACH * (upper + fore), 0.34 * (upper + fore)
    d = np.sqrt(np.einsum("...i,...i->...", target, target))
    soft = 0.03 * (upper + fore)  # ours: the last stretch is spread over 3 % of the arm, so the elbow never snaps
    distance = far - np.logaddexp(0.0, (far - d) / soft) * soft
    distance = near + soft * np.logaddexp(0.0, (distance - near) / soft)
    return target * (distance / np.maximum(d, 1e-6))[..., None]


def solve_arm(target: Array, swivel: Array) -> tuple[Array, Array]:
    """Two-bone inverse kinematics.

    Args:
        target: (..., 3) wrist relative to the shoulder joint, metres, in the chest's frame, left side; within `reach`.
        swivel: (...) radians about the shoulder–wrist line, from the elbow's natural place; positive lifts it outward.

    Returns:
        (..., 4) rotations of upper arm and of forearm (without pronation), both in the chest's frame.
    """
    d = np.maximum(np.sqrt(np.einsum("...i,...i->...", target, target)), 1e-6)
    along = target / d[..., None]
    pole = POLE - np.einsum("i,...i->...", POLE, along)[..., None] * along
    pole = vector_normalize(pole)
    side = cross(along, pole)
    pole = pole * np.cos(swivel)[..., None] + side * np.sin(swivel)[..., None]
    elbow = place_middle_joint(along, d, pole, arm_lengths())
    normal = vector_normalize(cross(along, pole))  # along × pole: the hinge's axis, shared by both bones
    frames = bone_frame(np.stack([elbow, target - elbow]), np.broadcast_to(normal, (2, *normal.shape)))
    return frames[0], frames[1]


def bone_frame(direction: Array, hinge: Array) -> Array:
    """Rotation whose x-axis lies along ``direction`` and whose y-axis is ``hinge`` (at right angles to it)."""
    x = vector_normalize(direction)
    return matrix_to_quat(np.stack([x, hinge, cross(x, hinge)], -1))


def hand_turns(angles: Array) -> tuple[Array, Array]:
    """Rotations that follow that of a forearm from `solve_arm`: its share of the pronation, and the hand in that frame.

    Args:
        angles: (..., 3) pronation, flexion, deviation in radians.
    """
    pronation, flexion, deviation = angles[..., 0], angles[..., 1], angles[..., 2]
    wrist = quat_multiply(_about(0, pronation * (1 - FOREARM_SHARE)), quat_multiply(_about(1, deviation), _about(2, -flexion)))
    return _about(0, pronation * FOREARM_SHARE), wrist


def finger_rotations(channels: Array) -> Array:
    """(..., 15, 4) local rotations of thumb, index, middle, ring, little (three joints each) from hand channels in degrees."""
    a = np.radians(channels)
    out = quat_identity(*channels.shape[:-1], 15)
    knuckles, middles = a[..., Channel.KNUCKLES], a[..., Channel.MIDDLES]
    spread = a[..., Channel.SPREAD, None] * _parting(knuckles)
    out[..., 3::3, :] = quat_multiply(_about(1, spread), _about(2, -knuckles))
    out[..., 4::3, :] = _about(2, -middles)
    out[..., 5::3, :] = _about(2, -middles * _COUPLING)
    opposition, base, outer = np.moveaxis(a[..., Channel.THUMB], -1, 0)
    out[..., 0, :] = quat_multiply(_about(0, opposition), _about(1, base))
    bend = _THUMB_HINGE * np.sin(outer / 2)[..., None]
    out[..., 1, :3], out[..., 1, 3] = bend, np.cos(outer / 2)
    out[..., 2, :3], out[..., 2, 3] = bend, np.cos(outer / 2)
    return out


def finger_angles(rotations: Array) -> tuple[Array, Array]:
    """The channels of a hand: the inverse of `finger_rotations`; for any other hand, the nearest channels.

    Args:
        rotations: (..., 15, 4) of a left hand, joints in that function's order.

    Returns:
        (..., 12) radians: knuckles, middles, spread, thumb as in `Channel`; and (...) how visible the spread is: 1 if all
        fingers are straight, 0 if all are bent, as the spread is unknown then.
    """
    bend = _turn_about(rotations, 2)
    knuckles, middle, last = -bend[..., 3::3], -bend[..., 4::3], -bend[..., 5::3]
    middles = (middle + _COUPLING * last) / (1 + _COUPLING**2)  # least squares of both joints
    swing = quat_multiply(rotations[..., 3::3, :], _about(2, knuckles))
    share = _parting(knuckles)
    visibility = np.einsum("...i,...i->...", share, share)
    spread = np.einsum("...i,...i->...", share, _turn_about(swing, 1)) / np.maximum(visibility, 1e-9)
    thumb = rotations[..., 0, :]
    base = _turn_about(thumb, 1)
    opposition = _turn_about(quat_multiply(thumb, _about(1, -base)), 0)
    outer = rotations[..., 1:3, :] * np.where(rotations[..., 1:3, 3:] < 0, -1.0, 1.0)
    outer = 2 * np.arctan2(outer[..., :3] @ _THUMB_HINGE, outer[..., 3]).mean(-1)
    angles = np.concatenate([knuckles, middles, np.stack([spread, opposition, base, outer], -1)], -1)
    return angles, visibility / (_SPREAD_SHARE**2).sum()


def _parting(knuckles: Array) -> Array:
    """The share of each finger in the spread: bent fingers cannot spread (collateral ligaments tighten)."""
    return _SPREAD_SHARE * clip(1 - knuckles / 1.2, 0.0, 1.0)


def _turn_about(q: Array, axis: int) -> Array:
    """Angle of the twist about a coordinate axis, −π … π."""
    sign = np.where(q[..., 3] < 0, -1.0, 1.0)
    return 2 * np.arctan2(sign * q[..., axis], sign * q[..., 3])


@lru_cache(1)
def finger_joints() -> tuple[list[int], list[int]]:
    """Joints of the left and of the right hand in the order of `finger_rotations`."""
    s = humanoid()
    rows = [[side + f + j for f in FINGERS for j in ("Proximal", "Intermediate", "Distal")] for side in ("left", "right")]
    thumbs = [[side + "Thumb" + j for j in ("Metacarpal", "Proximal", "Distal")] for side in ("left", "right")]
    left, right = ([s.index[n] for n in t + r] for t, r in zip(thumbs, rows, strict=True))
    return left, right


_COUPLING = 2 / 3  # the last joint follows the middle one (Rijpkema & Girard 1991)
_THUMB_HINGE = vector_normalize(np.array([-0.35, 0.87, 0.35]))  # at right angles to the thumb, mostly normal to the palm


def to_parent(parent: Array, child: Array) -> Array:
    """Local rotation of ``child`` under ``parent``, both given in one frame."""
    return quat_multiply(quat_conjugate(parent), child)


def wrists_in_chest(q: Array) -> Array:
    """Positions of the wrists, from local rotations (n, J, 4).

    Returns:
        (n, 2, 3) of left and right wrist, each from its shoulder, in the frame of the upper chest, in arm lengths.
    """
    s = humanoid()
    wrists = []
    for side in ("left", "right"):
        turn, at = q[:, s.index[side + "Shoulder"]], np.zeros((len(q), 3))
        turn = quat_multiply(turn, q[:, s.index[side + "UpperArm"]])
        for name in ("LowerArm", "Hand"):
            at = at + quat_rotate(turn, s.offsets[s.index[side + name]])
            turn = quat_multiply(turn, q[:, s.index[side + name]])
        wrists.append(at)
    return np.stack(wrists, 1) / arm_lengths().total
