"""Direction vectors of TED (Yoon et al. 2020): 10 joints in 3-D ↔ 9 unit vectors, 27 numbers.

The vectors have the axes of the published data, x to the person's *right*, y *down*, z to the front, so that the published
mean and feature networks fit; our axes (left, up, front) are turned by 180° about z. Encoding drops bone lengths, and decoding
uses the published ones: the round trip is exact for bodies of these proportions, and keeps all directions for others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ..keypoints import joint_points
from ..motion import Motion
from ..points import Points
from ..rotations import Array
from ..skeletons.ted import AXES, JOINTS, SOURCES

__all__ = ["BONES", "DIRECTION_VECTORS", "JOINTS", "MEAN", "DirectionVectors", "points_of", "to_points", "to_vectors"]

BONES = (
    (0, 1, 0.26), (1, 2, 0.18), (2, 3, 0.14), (1, 4, 0.22), (4, 5, 0.36), (5, 6, 0.33),
    (1, 7, 0.22), (7, 8, 0.36), (8, 9, 0.33),
)  # fmt: skip
"""(from, to, length in metres): ``dir_vec_pairs`` of the authors' code."""

MEAN = np.array([
    0.0154009, -0.9690125, -0.0884354, -0.0022264, -0.8655276, 0.4342174, -0.0035145, -0.8755367, -0.4121039,
    -0.9236511, 0.3061306, -0.0012415, -0.5155854, 0.8129665, 0.0871897, 0.2348464, 0.1846561, 0.8091402,
    0.9271948, 0.2960011, -0.013189, 0.5233978, 0.8092403, 0.0725451, -0.2037076, 0.1924306, 0.8196916,
])  # fmt: skip
"""(27,) ``mean_dir_vec`` of the authors' configuration, which the published networks subtract."""

_TURN = np.array(AXES)  # our axes to those of the data
_FROM, _TO = (np.array(end) for end in list(zip(*BONES, strict=True))[:2])


def points_of(motion: Motion) -> Points:
    """The 10 key points of a motion in metres from the spine, at the motion's rate.

    Raises:
        InputError: its skeleton is not recognised.
    """
    values = joint_points(motion, SOURCES)
    return Points(motion.fps, values - values[:, :1], "ted")


def to_vectors(points: Array) -> Array:
    """(…, 10, 3) positions, y up → (…, 27) unit vectors, y down; a bone of length 0 gives zeros, as in the authors' code."""
    points = np.asarray(points)
    if points.shape[-2:] != (len(JOINTS), 3):
        raise InputError(f"key points of shape {points.shape}", f"the direction vectors of TED take (…, {len(JOINTS)}, 3)")
    bones = (points[..., _TO, :] - points[..., _FROM, :]) * _TURN.astype(points.dtype)
    length = np.linalg.norm(bones, axis=-1, keepdims=True)
    return (bones / np.where(length > 1e-9, length, 1)).reshape(*points.shape[:-2], 27)


def to_points(vectors: Array) -> Array:
    """(…, 27) vectors → (…, 10, 3) positions in metres from the spine's foot, y up; vectors need not be of unit length."""
    vectors = np.asarray(vectors)
    if vectors.shape[-1:] != (27,):
        raise InputError(f"direction vectors of shape {vectors.shape}", "(…, 27)")
    bones = vectors.reshape(*vectors.shape[:-1], 9, 3)
    bones = bones / np.maximum(np.linalg.norm(bones, axis=-1, keepdims=True), 1e-9) * _TURN
    points = np.zeros((*vectors.shape[:-1], len(JOINTS), 3), bones.dtype)
    for k, (start, end, length) in enumerate(BONES):
        points[..., end, :] = points[..., start, :] + length * bones[..., k, :]
    return points


@dataclass(frozen=True)
class DirectionVectors:
    """TED's representation: ``encode(Points or Motion) -> (T, 27)``, ``decode((T, 27), fps) -> Points``."""

    name: str = "direction-vectors"
    source: str = "points"
    fps: float = 15.0  # Yoon et al. 2020, section 5.1
    dimensions: int = 27

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"{JOINTS[a]}-{JOINTS[b]}.{axis}" for a, b, _ in BONES for axis in "xyz")

    def encode(self, source: Points | Motion) -> Array:
        """Encode key points, or those of a motion (`points_of`).

        Raises:
            InputError: key points of another shape, or motion on a skeleton that is not recognised.
        """
        return to_vectors((points_of(source) if isinstance(source, Motion) else source).values)

    def decode(self, vectors: Array, fps: float = fps) -> Points:
        return Points(fps, to_points(vectors), "ted")


DIRECTION_VECTORS = DirectionVectors()
