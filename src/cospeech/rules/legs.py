"""Hips over planted feet: two-bone inverse kinematics for the legs, standing or seated."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..rotations import Array, euler_to_quat, matrix_to_quat, quat_conjugate, quat_multiply, quat_rotate
from ..skeleton import humanoid
from .bodytrack import Body

__all__ = ["SEAT", "stand"]

SEAT = 0.515  # metres from the floor to the hips' joint of a seated body (ours: a chair of 0.43 m)
_STRAIGHT = 0.9994  # most of the leg's length that is used: knees never lock (ours; ≈ 4° of flexion)
_TILT = 32.0  # degrees of pelvic roll per metre of sideways shift: the free side sinks (ours)
_SOFT = 0.004  # metres: how the lower of both legs' limits is rounded


@lru_cache(1)
def _leg() -> tuple[Array, Array, Array, Array]:
    """Offsets of hip joint, knee, ankle (left leg), and the ankle's place in the T-pose."""
    s = humanoid()
    hip, knee, ankle = (s.offsets[s.index["left" + n]] for n in ("UpperLeg", "LowerLeg", "Foot"))
    return hip, knee, ankle, s.tpose[s.index["leftFoot"]]


def _lengths() -> tuple[float, float]:
    _, knee, ankle, _ = _leg()
    return float(np.linalg.norm(knee)), float(np.linalg.norm(ankle))


def stand(b: Array, seated: bool, rotations: Array) -> tuple[Array, Array]:
    """Write the legs into ``rotations`` (N, J, 4).

    Args:
        b: (N, channels) of the body's track, noise included.

    Returns:
        hips' rotation (N, 4) and position (N, 3).
    """
    feet = np.stack([b[:, Body.LEFT_FOOT], b[:, Body.RIGHT_FOOT]], 1)
    lift = np.stack([b[:, Body.LEFT_LIFT], b[:, Body.RIGHT_LIFT]], 1)
    middle = feet[..., 0].mean(1)
    roll = np.zeros(len(b)) if seated else -_TILT * (b[:, Body.HIPS_X] - middle)
    pitch = b[:, Body.PITCH] * (0.35 if seated else 0.12)
    yaw = b[:, Body.HIPS_YAW] * (0.3 if seated else 1.0) + (0 if seated else 0.5 * feet[..., 2].mean(1))
    hips = euler_to_quat(np.radians(np.stack([yaw, pitch, roll], -1)), "YXZ")
    ankles = np.stack([feet[..., 0], _leg()[3][1] + lift, feet[..., 1] + _leg()[3][2]], -1)
    if seated:
        ankles = ankles + np.array([0.0, 0.0, 0.42])
        root = np.stack([0.2 * b[:, Body.HIPS_X], np.full(len(b), SEAT), 0.2 * b[:, Body.HIPS_Z]], -1)
    else:
        root = np.stack([b[:, Body.HIPS_X], np.zeros(len(b)), b[:, Body.HIPS_Z]], -1)
        root[:, 1] = _height(root, hips, ankles, lift)
    _write_legs(rotations, hips, root, ankles, feet[..., 2], lift)
    return hips, root


def _height(root: Array, hips: Array, ankles: Array, lift: Array) -> Array:
    """The highest that both legs allow, rounded off; a lifted foot does not pull the hips down."""
    limit = _STRAIGHT * sum(_lengths())
    heights = []
    for side in (0, 1):
        joint = quat_rotate(hips, _leg()[0] * ((1, 1, 1) if side == 0 else (-1, 1, 1)))
        flat = (root + joint - ankles[:, side])[:, [0, 2]]
        reach = np.sqrt(np.maximum(limit**2 - (flat**2).sum(-1), 0.04))
        heights.append(ankles[:, side, 1] + reach - joint[:, 1])
    a, c = heights
    return -_SOFT * np.logaddexp(-a / _SOFT, -c / _SOFT)


def _write_legs(rotations: Array, hips: Array, root: Array, ankles: Array, yaw: Array, lift: Array) -> None:
    joint = humanoid().index
    upper, lower = _lengths()
    for side, name in enumerate(("left", "right")):
        hip = root + quat_rotate(hips, _leg()[0] * ((1, 1, 1) if side == 0 else (-1, 1, 1)))
        rel = ankles[:, side] - hip
        d = np.sqrt(np.einsum("ni,ni->n", rel, rel))
        along = rel / d[:, None]
        turn = np.radians(yaw[:, side])
        pole = np.stack([np.sin(turn), np.zeros_like(turn), np.cos(turn)], -1)
        pole = pole - np.einsum("ni,ni->n", pole, along)[:, None] * along
        pole /= np.sqrt(np.einsum("ni,ni->n", pole, pole))[:, None]
        cosine = np.clip((upper**2 + d**2 - lower**2) / (2 * upper * d), -1, 1)
        knee = along * (upper * cosine)[:, None] + pole * (upper * np.sqrt(1 - cosine**2))[:, None]
        hinge = np.cross(-along, pole)  # to the left
        thigh, shin = _bone(knee, hinge, _leg()[1]), _bone(rel - knee, hinge, _leg()[2])
        tip = np.radians(9.0) * np.clip((lift[:, side] - 0.012) / 0.03, 0, 1)  # the toes hang a little
        foot = euler_to_quat(np.stack([turn, tip], -1), "YX")
        rotations[:, joint[name + "UpperLeg"]] = quat_multiply(quat_conjugate(hips), thigh)
        rotations[:, joint[name + "LowerLeg"]] = quat_multiply(quat_conjugate(thigh), shin)
        rotations[:, joint[name + "Foot"]] = quat_multiply(quat_conjugate(shin), foot)


def _bone(direction: Array, hinge: Array, rest: Array) -> Array:
    """World rotation that lays the bone's rest offset along ``direction`` with its x-axis on ``hinge``."""
    down = -direction / np.sqrt(np.einsum("ni,ni->n", direction, direction))[:, None]
    q = matrix_to_quat(np.stack([hinge, down, np.cross(hinge, down)], -1))
    tilt = np.arctan2(rest[2], -rest[1])  # the rest offset is not quite straight down
    return quat_multiply(q, np.array([np.sin(tilt / 2), 0.0, 0.0, np.cos(tilt / 2)]))
