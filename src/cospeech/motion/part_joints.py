"""Joints that belong to each part of a character, and a pose in which only some parts move."""

from __future__ import annotations

from functools import cache

import numpy as np

from .parts import PARTS
from .rotations import Array, quat_identity
from .skeleton import humanoid

__all__ = ["arm_joints", "eye_joints", "resting_joints", "select_parts"]


_ARMS = ("Shoulder", "UpperArm", "LowerArm", "Hand")


@cache
def arm_joints(parts: tuple[str, ...] = PARTS) -> list[int]:
    """Indices of the joints that move the hands: clavicles and arms for the body, fingers for the hands."""
    s = humanoid()
    fingers = {*s.left_hand, *s.right_hand}
    arms = [k for k, name in enumerate(s.names) if name.endswith(_ARMS) and k not in fingers]
    return (arms if "body" in parts else []) + (sorted(fingers) if "hands" in parts else [])


@cache
def eye_joints() -> list[int]:
    """Indices of both eyes."""
    return [humanoid().index[name] for name in ("leftEye", "rightEye")]


@cache
def resting_joints(parts: tuple[str, ...]) -> list[int]:
    """Indices of the joints that belong to none of ``parts``; eyes belong to the body."""
    s = humanoid()
    fingers = {*s.left_hand, *s.right_hand}
    resting = [] if "hands" in parts else sorted(fingers)
    return resting if "body" in parts else resting + [k for k in range(len(s)) if k not in fingers]


def select_parts(rotations: Array, root: Array, parts: tuple[str, ...]) -> tuple[Array, Array]:
    """Set neutral rotations, and the hips at rest, for all other parts; the same arrays are returned if there are none."""
    resting = resting_joints(parts)
    if not resting:
        return rotations, root
    rotations = rotations.copy()
    rotations[:, resting] = quat_identity(1)
    if "body" not in parts:
        root = np.broadcast_to(humanoid().offsets[0].astype(np.float32), root.shape).copy()
    return rotations, root
