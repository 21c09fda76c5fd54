"""Euler angles of BEAT (Liu et al. 2022): 47 joints of spine, neck, arms and fingers ↔ 141 degrees.

The order is intrinsic X, Y, Z, as in the channels of BEAT's BVH files. Many triples mean the same rotation. Encoding chooses
those without jumps from frame to frame, starting in −180 … 180 (middle −90 … 90); decoding accepts any.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..motion import Motion
from ..rotations import Array, continuous_euler, euler_to_quat, quat_to_euler
from ..skeleton import Skeleton, find_skeleton
from .joints import build_motion, pick, size

__all__ = ["EULER", "JOINTS", "Euler", "to_angles", "to_rotations"]

_FINGERS = (
    *(f"Middle{k}" for k in (1, 2, 3)), "Ring", *(f"Ring{k}" for k in (1, 2, 3)), "Pinky", *(f"Pinky{k}" for k in (1, 2, 3)),
    "Index", *(f"Index{k}" for k in (1, 2, 3)), *(f"Thumb{k}" for k in (1, 2, 3)),
)  # fmt: skip
JOINTS = (
    "Spine", "Neck", "Neck1",
    *(side + part for side in ("Right", "Left")
      for part in ("Shoulder", "Arm", "ForeArm", "Hand", *(f"Hand{finger}" for finger in _FINGERS))),
)  # fmt: skip
"""The 47 joints in the order of BEAT's own preparation (``beat_joints`` → ``spine_neck_141``)."""


def to_angles(rotations: Array) -> Array:
    """(T, …, 4) rotations → (T, …, 3) degrees without jumps along T."""
    return np.degrees(continuous_euler(quat_to_euler(rotations, "XYZ")))


def to_rotations(angles: Array) -> Array:
    """(…, 3) degrees → (…, 4) rotations."""
    return euler_to_quat(np.radians(angles), "XYZ")


@dataclass(frozen=True)
class Euler:
    """BEAT's representation: ``encode(Motion) -> (T, 141)``, ``decode((T, 141), fps, skeleton) -> Motion``."""

    joints: tuple[str, ...] = JOINTS
    name: str = "euler"
    source: str = "motion"
    skeleton: str = "beat"
    fps: float = 15.0  # Liu et al. 2022, section 5

    @property
    def dimensions(self) -> int:
        return 3 * len(self.joints)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"{joint}.{axis}" for joint in self.joints for axis in "XYZ")

    def encode(self, source: Motion) -> Array:
        return to_angles(pick(source, self.joints, self.skeleton)).reshape(len(source), self.dimensions)

    def decode(self, vectors: Array, fps: float = fps, skeleton: Skeleton | None = None) -> Motion:
        """Decode to a motion, by default on BEAT's skeleton; joints that the vectors lack keep the T-pose."""
        angles = size(vectors, self.dimensions, self.name).reshape(len(vectors), -1, 3)
        return build_motion(fps, skeleton or find_skeleton(self.skeleton), self.joints, to_rotations(angles))


EULER = Euler()
