"""Key points of PATS (Ahuja et al. 2020): 52 joints in 2-D ↔ 48 joints of constant shoulder length, 96 numbers.

Positions are relative to the neck, and scaled in each frame so that neck to right shoulder measures 167 pixels
(``pose/normalize`` of the data). The neck, the nose and the eyes are left out. The order is ``x0 … x47, y0 … y47``. As in the
data, x is to the picture's right (the person's left) and y is *down*. Decoding puts the points that were left out at constant
places: the neck at the origin, nose and eyes at their mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import InputError
from ..keypoints import joint_points
from ..motion import Motion
from ..points import Points
from ..rotations import Array
from ..skeleton import humanoid
from ..skeletons.pats import JOINTS, SOURCES

__all__ = ["FACE", "JOINTS", "KEPT", "KEYPOINTS2D", "SHOULDER", "KeyPoints2D", "points_of", "to_points", "to_vectors"]

MASKED = (0, 7, 8, 9)  # neck, nose, eyes: all models of the paper leave them out
KEPT = tuple(k for k in range(len(JOINTS)) if k not in MASKED)
SHOULDER = 167.0  # pixels from neck to right shoulder after normalisation
FACE = np.array([[-4.9, 173.0], [-35.8, 204.4], [26.0, 205.0]])
"""(3, 2) nose and eyes from the neck, y up: mean over the eight speakers whose statistics are published."""

_SCALE = 950.0  # pixels per metre; ours: our humanoid's shoulder measures 167 pixels, as the mean of the data
_NECK = (640.0, -300.0)  # pixels, y up; ours: place of the T-pose's neck in a picture of 1280 × 720
_RIGHT_SHOULDER = JOINTS.index("RShoulder")


def points_of(motion: Motion) -> Points:
    """The 52 key points of a motion, seen from the front without perspective, in pixels, at the motion's rate.

    Raises:
        InputError: its skeleton is not recognised.
    """
    body, (name, offset) = humanoid(), SOURCES[0]
    rest = (body.tpose[body.index[name]] + np.array(offset))[:2]
    return Points(motion.fps, (joint_points(motion, SOURCES)[..., :2] - rest) * _SCALE + np.array(_NECK), "pats")


def to_vectors(points: Array) -> Array:
    """(…, 52, 2) positions, y up, of any scale and place → (…, 96).

    Raises:
        InputError: another shape, or the right shoulder lies on the neck.
    """
    points = np.asarray(points)
    if points.shape[-2:] != (len(JOINTS), 2):
        raise InputError(f"key points of shape {points.shape}", f"the key points of PATS are (…, {len(JOINTS)}, 2)")
    points = points - points[..., :1, :]
    length = np.linalg.norm(points[..., _RIGHT_SHOULDER, :], axis=-1)[..., None, None]
    if not (length > 1e-6).all():
        frame = int(np.argmax(~(length.reshape(-1) > 1e-6)))
        raise InputError(f"the right shoulder lies on the neck in frame {frame}", "a failed detection: leave the frame out")
    body_points = points[..., list(KEPT), :] * (SHOULDER / length) * np.array([1, -1], points.dtype)
    return np.concatenate([body_points[..., 0], body_points[..., 1]], -1).astype(points.dtype, copy=False)


def to_points(vectors: Array) -> Array:
    """(…, 96) → (…, 52, 2) positions from the neck, y up, in pixels of a shoulder of 167."""
    vectors = np.asarray(vectors)
    if vectors.shape[-1:] != (96,):
        raise InputError(f"key-point vectors of shape {vectors.shape}", "(…, 96)")
    points = np.zeros((*vectors.shape[:-1], len(JOINTS), 2), vectors.dtype)
    points[..., list(KEPT), :] = np.stack([vectors[..., :48], -vectors[..., 48:]], -1)
    points[..., 7:10, :] = FACE
    return points


@dataclass(frozen=True)
class KeyPoints2D:
    """PATS's representation: ``encode(Points or Motion) -> (T, 96)``, ``decode((T, 96), fps) -> Points``."""

    name: str = "keypoints2d"
    source: str = "points"
    fps: float = 15.0  # Ahuja et al. 2020, section 5
    dimensions: int = 96

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"{JOINTS[k]}.{axis}" for axis in "xy" for k in KEPT)

    def encode(self, source: Points | Motion) -> Array:
        """Encode key points, or those of a motion (`points_of`).

        Raises:
            InputError: key points that cannot be encoded (`to_vectors`), or motion on a skeleton that is not recognised.
        """
        return to_vectors((points_of(source) if isinstance(source, Motion) else source).values)

    def decode(self, vectors: Array, fps: float = fps) -> Points:
        return Points(fps, to_points(vectors), "pats")


KEYPOINTS2D = KeyPoints2D()
