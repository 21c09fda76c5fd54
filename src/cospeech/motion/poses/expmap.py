"""Exponential maps of Trinity (Alexanderson et al. 2020): rotation vectors in radians; 15 upper joints ↔ 45 numbers,
20 joints and the way of the hips ↔ 69.

A rotation vector is axis × angle. With angles below π it would jump to the other side of the sphere when an arm turns further.
So encoding lets the angle grow up to 2π. The nine numbers of the hips (after PyMO's ``pos_rot_deltas``) are place in metres and
turn in radians relative to a smoothed point that walks below them, then this point's step to its left and front, and its turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..motion import Motion
from ..rotations import Array, axis_angle_to_quat, quat_conjugate, quat_continuous, quat_multiply, quat_rotate, rotvec_to_quat
from ..skeleton import Skeleton, find_skeleton
from ..skeletons.trinity import FULL_BODY, UPPER_BODY
from .joints import build_motion, pick, size

__all__ = ["FULL", "UPPER", "ExpMap", "to_rotations", "to_rotvecs", "walk"]

_SMOOTH_PLACE, _SMOOTH_TURN = 0.25, 0.5  # seconds; ours, as PyMO's 5 and 10 frames of 20 a second
_UP = np.array([0.0, 1.0, 0.0])


def to_rotvecs(rotations: Array) -> Array:
    """(…, 4) → (…, 3) rotation vectors of length 0 … 2π. q and −q give different vectors for the same rotation."""
    sine = np.linalg.norm(rotations[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, rotations[..., 3:])
    near = np.where(rotations[..., 3:] < 0, -2.0, 2.0)  # of angle / sine at no turn
    return rotations[..., :3] * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), near)


def to_rotations(rotvecs: Array) -> Array:
    """(…, 3) rotation vectors of any length → (…, 4)."""
    return rotvec_to_quat(np.asarray(rotvecs, float))


def walk(motion: Motion) -> tuple[Array, Array]:
    """The smoothed point that walks below the hips: (T, 3) metres on the floor, (T,) its turn about Y in radians; T > 0."""
    since = quat_multiply(np.asarray(motion.rotations[:, 0], float), quat_conjugate(motion.skeleton.rest[0]))
    front = quat_rotate(since, np.array([0.0, 0.0, 1.0]))
    turn = np.unwrap(np.arctan2(front[:, 0], front[:, 2]))
    floor = np.asarray(motion.root, float) * np.array([1.0, 0.0, 1.0])
    place = np.stack([_smooth(axis, _SMOOTH_PLACE * motion.fps) for axis in floor.T], -1)
    return place, _smooth(turn, _SMOOTH_TURN * motion.fps)


def _smooth(x: Array, sigma: float) -> Array:
    """Smooth ``x (T,)``, T > 0, with a Gaussian of ``sigma`` frames, cut off at 4 sigma; the ends are repeated.

    This is SciPy's ``gaussian_filter1d(x, sigma, mode="nearest")``, with the same cut-off.
    """
    radius = int(4 * sigma + 0.5)
    kernel = np.exp(-0.5 * np.square(np.arange(-radius, radius + 1) / sigma))
    return np.convolve(np.pad(x, radius, mode="edge"), kernel / kernel.sum(), mode="valid")


def _encode_hips(motion: Motion) -> Array:
    """(T, 9): place (3), turn (3), step to the left and to the front, turn of the walking point."""
    if not len(motion):
        return np.zeros((0, 9))
    place, turn = walk(motion)
    back = axis_angle_to_quat(_UP, -turn)
    hips = quat_rotate(back, np.asarray(motion.root, float) - place)
    own = quat_multiply(back, pick(motion, motion.skeleton.names[:1], motion.skeleton.kind)[:, 0])
    own = quat_continuous(own * (-1.0 if own[0, 3] < 0 else 1.0))
    step = quat_rotate(back, np.diff(place, axis=0, prepend=place[:1]))
    return np.concatenate([hips, to_rotvecs(own), step[:, [0, 2]], np.diff(turn, prepend=turn[:1])[:, None]], -1)


def _add_steps(vectors: Array, start: tuple[float, float, float]) -> tuple[Array, Array]:
    """(T, 3) places and (T,) turns of the walking point from the nine numbers; pieces give the bits of the whole."""
    turn = np.cumsum(np.concatenate([start[2:], vectors[:, 8]]))[1:]
    step = np.stack([vectors[:, 6], 0 * vectors[:, 6], vectors[:, 7]], -1)
    steps = quat_rotate(axis_angle_to_quat(_UP, turn), step)
    return np.cumsum(np.concatenate([[[start[0], 0.0, start[1]]], steps]), 0)[1:], turn


def _decode_hips(vectors: Array, start: tuple[float, float, float]) -> tuple[Array, Array]:
    """(T, 4) rotations and (T, 3) places of the hips from the nine numbers."""
    place, turn = _add_steps(vectors, start)
    heading = axis_angle_to_quat(_UP, turn)
    rotations = quat_multiply(heading, to_rotations(vectors[:, 3:6]))
    return rotations, place + quat_rotate(heading, vectors[:, :3])


@dataclass(frozen=True)
class ExpMap:
    """``encode(Motion) -> (T, D)``, ``decode((T, D), fps, skeleton) -> Motion``.

    Args:
        joints: K names.
        hips: whether the nine numbers of the hips follow (D = 3 K + 9, else 3 K and the hips stay in the T-pose).
    """

    name: str
    joints: tuple[str, ...]
    hips: bool
    source: str = "motion"
    skeleton: str = "trinity"
    fps: float = 20.0  # Alexanderson et al. 2020, section 5

    @property
    def dimensions(self) -> int:
        return 3 * len(self.joints) + 9 * self.hips

    @property
    def names(self) -> tuple[str, ...]:
        hips = ("hips.x", "hips.y", "hips.z", "hips.rx", "hips.ry", "hips.rz", "walk.left", "walk.front", "walk.turn")
        return tuple(f"{joint}.{axis}" for joint in self.joints for axis in "xyz") + (hips if self.hips else ())

    def encode(self, source: Motion) -> Array:
        joints = to_rotvecs(pick(source, self.joints, self.skeleton)).reshape(len(source), 3 * len(self.joints))
        return np.concatenate([joints, _encode_hips(source)], -1) if self.hips else joints

    def decode(
        self,
        vectors: Array,
        fps: float = fps,
        skeleton: Skeleton | None = None,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Motion:
        """Decode to a motion, by default on Trinity's skeleton; joints that the vectors lack keep the T-pose.

        Args:
            start: start of the walking point: metres to the left and to the front, radians (the first row of `walk`).
        """
        vectors = size(vectors, self.dimensions, self.name)
        skeleton = skeleton or find_skeleton(self.skeleton)
        count = 3 * len(self.joints)
        rotations = to_rotations(vectors[:, :count].reshape(len(vectors), -1, 3))
        if not self.hips:
            return build_motion(fps, skeleton, self.joints, rotations)
        hips, root = _decode_hips(vectors[:, count:], start)
        joints = (skeleton.names[0], *self.joints)
        return build_motion(fps, skeleton, joints, np.concatenate([hips[:, None], rotations], 1), root)

    def end_of_walk(self, vectors: Array, start: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[float, float, float]:
        """Where the walking point is after some vectors: what `decode` takes as ``start`` for those that follow."""
        if not (self.hips and len(vectors)):
            return start
        place, turn = _add_steps(size(vectors, self.dimensions, self.name)[:, -9:], start)
        return float(place[-1, 0]), float(place[-1, 2]), float(turn[-1])

    def at_rate(self, vectors: Array, ratio: float) -> Array:
        """Vectors for another rate: the walking point's steps from frame to frame are ``ratio`` times as long."""
        if not self.hips:
            return vectors
        return np.concatenate([vectors[:, :-3], ratio * vectors[:, -3:]], 1)


UPPER = ExpMap("expmap-upper", UPPER_BODY, hips=False)
FULL = ExpMap("expmap-full", FULL_BODY, hips=True)
