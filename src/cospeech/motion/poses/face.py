"""A talking face in 55 numbers: the 52 ARKit weights, and the turn of neck and head together, a rotation vector in radians.

The body rests. Decoded weights are in 0 … 1. Neck and head share the turn, half each, and it is limited to what heads can do.
Every frame is decoded from its own row, so a motion may be decoded in pieces of any size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ..motion import Motion
from ..rotations import Array, quat_multiply, quat_to_rotvec, rotvec_to_quat
from ..skeleton import Skeleton, humanoid
from ..skeletons.arkit import ARKIT, ARKIT_MIRROR
from .joints import build_motion, check_humanoid, humanoid_vectors, pick

__all__ = ["FACE", "MIRROR", "FacePose"]

_CHAIN = ("neck", "head")
_WEIGHTS = len(ARKIT)
_MOST = 0.6  # radians [ours: a talker's head turns less; no output of a network breaks a neck]

MIRROR = (*ARKIT_MIRROR, *range(_WEIGHTS, _WEIGHTS + 3))
"""For each number, the index of its mirror image (y and z of the turn also change their sign)."""


@dataclass(frozen=True)
class FacePose:
    """``encode(Motion) -> (T, 55)``, ``decode((T, 55), fps) -> Motion``, both on our humanoid."""

    name: str = "face"
    source: str = "motion"
    skeleton: str = "humanoid"
    fps: float = 60.0  # as BEAT's faces (Liu et al. 2022)
    dimensions: int = _WEIGHTS + 3

    @property
    def names(self) -> tuple[str, ...]:
        return (*ARKIT, "head.rx", "head.ry", "head.rz")

    def encode(self, source: Motion) -> Array:
        """Raises:
        InputError: a motion of another skeleton, or without a face.
        """
        check_humanoid(source)
        if source.face is None:
            raise InputError("a motion without a face", "this representation is of faces")
        turns = pick(source, _CHAIN, self.skeleton)
        return np.concatenate([np.asarray(source.face, float), quat_to_rotvec(quat_multiply(turns[:, 0], turns[:, 1]))], -1)

    def decode(self, vectors: Array, fps: float = fps, skeleton: Skeleton | None = None, start: float = 0.0) -> Motion:
        """Decode to a motion in float32.

        Args:
            vectors: (T, 55).
            skeleton: ours, or None.
            start: time of the first frame in seconds, if the rows are a piece of something longer.

        Raises:
            InputError: wrong shape or skeleton, or numbers that are not finite or far too large.
        """
        vectors, body = humanoid_vectors(vectors, self.dimensions, self.name, skeleton), humanoid()
        turn = vectors[:, _WEIGHTS:]
        angle = np.linalg.norm(turn, axis=-1, keepdims=True)
        half = rotvec_to_quat(turn * (0.5 * np.minimum(1.0, _MOST / np.maximum(angle, _MOST))))
        motion = build_motion(fps, body, _CHAIN, np.stack([half, half], 1))
        face = np.clip(vectors[:, :_WEIGHTS], 0, 1).astype(np.float32)
        return Motion(fps, motion.rotations.astype(np.float32), motion.root.astype(np.float32), face, body, start)


FACE = FacePose()
