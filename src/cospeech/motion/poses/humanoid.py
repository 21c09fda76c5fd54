"""Our humanoid in 57 numbers, for networks that generate animated characters.

The numbers are those of the hips (place from the rest place in metres, rotation vector), rotation vectors of spine, neck, head
and arms in radians, and six numbers per hand: the twelve angles of a hand (`cospeech.motion.kinematics.hands`) lie close to a
space of six dimensions, spanned by the principal directions of its table of hand shapes. Legs are not generated: decoding
plants the feet (`cospeech.motion.kinematics.legs.plant`). Eyes, jaw and toes rest.

Every frame is decoded from its own row, so a motion may be decoded in pieces of any size.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..kinematics import arms
from ..kinematics.hands import CHANNELS, HAND_SHAPES, Channel
from ..kinematics.legs import plant
from ..motion import Motion
from ..rotations import Array, rotvec_to_quat
from ..skeleton import Skeleton, humanoid
from .expmap import to_rotvecs
from .joints import check_humanoid, humanoid_vectors, pick

__all__ = ["HUMANOID", "JOINTS", "Humanoid", "hand_basis"]

_TORSO = ("hips", "spine", "chest", "upperChest", "neck", "head")
_ARM = ("Shoulder", "UpperArm", "LowerArm", "Hand")
JOINTS = (*_TORSO, *(side + part for side in ("left", "right") for part in _ARM))
"""The joints whose rotation vectors are in a row, in this order."""
_GRIPS = 6  # numbers per hand; ours: leaves 2° of the table's angles, see tests
_TURNS = slice(3, 3 + 3 * len(JOINTS))
_HANDS = slice(_TURNS.stop, _TURNS.stop + 2 * _GRIPS)
_ANGLES = slice(Channel.KNUCKLES.start, Channel.THUMB.stop)  # columns of a hand's track
_LEAST = np.array([-20.0] * 4 + [-10.0] * 4 + [-4.0, -20.0, -30.0, -10.0])
_MOST = np.array([95.0] * 4 + [110.0] * 4 + [16.0, 60.0, 40.0, 60.0])
"""Limits of decoded angles of a hand, degrees: active ranges of adult fingers (Hume et al. 1990), widened so that the rules'
motion fits after the projection; spread and thumb ours."""
_FLIP = np.array([1.0, -1.0, -1.0, 1.0])  # a rotation in the mirror, x → −x


@lru_cache(1)
def hand_basis() -> tuple[Array, Array]:
    """Mean (12,) of the table of hand shapes in radians, and its six principal directions (6, 12), orthonormal.

    The largest component of each direction is positive, so that the numbers mean the same everywhere.
    """
    table = np.radians([shape.values() for shape in HAND_SHAPES.values()])
    mean = table.mean(0)
    basis = np.linalg.svd(table - mean, full_matrices=False)[2][:_GRIPS]
    signs = np.sign(basis[np.arange(_GRIPS), np.abs(basis).argmax(1)])
    return mean, basis * signs[:, None]


def _encode_hands(motion: Motion) -> Array:
    """(T, 12): six numbers of the left hand, six of the right."""
    rotations = np.asarray(motion.rotations, float)
    left, right = arms.finger_joints()
    angles, visibility = arms.finger_angles(np.stack([rotations[:, left], rotations[:, right] * _FLIP], 1))
    mean, basis = hand_basis()
    weights = np.ones_like(angles)
    weights[..., 8] = visibility  # bent fingers hide the spread, which then does not count
    weighted_basis = basis * weights[..., None, :]
    # least squares: (basis W basisᵀ) grips = basis W (angles − mean)
    grips = np.linalg.solve(weighted_basis @ basis.T, (weighted_basis @ (angles - mean)[..., None]))
    return grips.reshape(len(motion), 2 * _GRIPS)


@lru_cache(1)
def _gesture_space() -> tuple[Array, Array]:
    """Indices of the joints of the rotation vectors, and of the joints of both hands, left first."""
    index = humanoid().index
    return np.array([index[name] for name in JOINTS]), np.concatenate(arms.finger_joints())


@dataclass(frozen=True)
class Humanoid:
    """``encode(Motion) -> (T, 57)``, ``decode((T, 57), fps) -> Motion``, both on our humanoid."""

    name: str = "expmap-humanoid"
    source: str = "motion"
    skeleton: str = "humanoid"
    fps: float = 20.0  # ours: as Trinity's (Alexanderson et al. 2020, section 5)
    dimensions: int = _HANDS.stop

    @property
    def names(self) -> tuple[str, ...]:
        turns = tuple(f"{joint}.r{axis}" for joint in JOINTS for axis in "xyz")
        grips = tuple(f"{side}Grip.{k}" for side in ("left", "right") for k in range(_GRIPS))
        return ("hips.x", "hips.y", "hips.z", *turns, *grips)

    def encode(self, source: Motion) -> Array:
        """Raises:
        InputError: a motion of another skeleton.
        """
        check_humanoid(source)
        place = np.asarray(source.root, float) - source.skeleton.offsets[0]
        turns = to_rotvecs(pick(source, JOINTS, self.skeleton)).reshape(len(source), -1)
        return np.concatenate([place, turns, _encode_hands(source)], -1)

    def decode(self, vectors: Array, fps: float = fps, skeleton: Skeleton | None = None, start: float = 0.0) -> Motion:
        """Decode to a motion in float32. Hips that the legs cannot reach are lowered; angles of fingers are limited.

        Args:
            vectors: (T, 57).
            skeleton: ours, or None.
            start: time of the first frame in seconds, if the rows are a piece of something longer.

        Raises:
            InputError: wrong shape or skeleton, or numbers that are not finite or far too large.
        """
        vectors, body = humanoid_vectors(vectors, self.dimensions, self.name, skeleton), humanoid()
        frames = len(vectors)
        joints, fingers = _gesture_space()
        rotations = np.zeros((frames, len(body), 4), np.float32)
        rotations[..., 3] = 1.0
        turns = rotvec_to_quat(vectors[:, _TURNS].reshape(frames, len(JOINTS), 3))
        rotations[:, joints] = turns
        mean, basis = hand_basis()
        channels = np.zeros((frames, 2, CHANNELS))
        angles = np.degrees(vectors[:, _HANDS].reshape(frames, 2, _GRIPS) @ basis + mean)
        channels[..., _ANGLES] = np.minimum(np.maximum(angles, _LEAST), _MOST)
        hands = arms.finger_rotations(channels)
        hands[:, 1] *= _FLIP
        rotations[:, fingers] = hands.reshape(frames, 30, 4)
        legs, steps, place = plant(turns[:, 0], vectors[:, :3] + body.offsets[0])
        rotations[:, legs] = steps
        return Motion(fps, rotations, place.astype(np.float32), start=start)


HUMANOID = Humanoid()
