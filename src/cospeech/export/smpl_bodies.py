"""The bodies of the SMPL family in ``.npz`` files: convert SMPL's and SMPL-H's poses to SMPL-X's, and Z-up worlds to ours.

AMASS (Mahmood et al. 2019) stores SMPL-H: 22 joints of the body, then 15 of each hand. SMPL has 24 joints: the same 22, and a
hand without fingers on each side. AMASS' world has Z up, BEAT2's has Y up, and no file states it.
"""

from __future__ import annotations

import numpy as np

from ..motion.rotations import Array, quat_multiply, quat_rotate
from .up_axis import Z_TO_Y, has_z_up

__all__ = ["JOINTS", "WIDTHS", "find_pelvis", "stand_upright", "to_smplx"]

JOINTS = 55
"""How many joints SMPL-X has."""
_BODY, _HANDS = 22, 30  # joints that all bodies share; of two hands
WIDTHS = (3 * JOINTS, 3 * (_BODY + _HANDS), 3 * 24)
"""Numbers in a frame of ``poses``: of SMPL-X, of SMPL-H, of SMPL."""
_PELVIS_X = np.array([0.003124, -0.351401, 0.012037])  # SMPL-X neutral template, joint 0 at zero betas, metres
_PELVIS = np.array([-0.001795, -0.223334, 0.028219])  # SMPL's neutral template, the same; SMPL-H's is alike


def find_pelvis(width: int) -> Array:
    """(3,) metres: the place of the pelvis at ``trans`` 0 of the body that has ``width`` numbers in a frame of ``poses``."""
    return _PELVIS_X if width == WIDTHS[0] else _PELVIS


def to_smplx(poses: Array) -> Array:
    """(T, 55, 3) axis-angles of SMPL-X from (T, width) of any of these bodies; joints that it lacks rest."""
    if poses.shape[1] == WIDTHS[0]:
        return poses.astype(np.float64).reshape(-1, JOINTS, 3)
    vectors = np.zeros((len(poses), JOINTS, 3))
    own = poses.astype(np.float64).reshape(len(poses), -1, 3)
    vectors[:, :_BODY] = own[:, :_BODY]
    if poses.shape[1] == WIDTHS[1]:
        vectors[:, JOINTS - _HANDS :] = own[:, _BODY:]
    return vectors


def stand_upright(pelvis: Array, place: Array) -> tuple[Array, Array]:
    """Put a motion into a world with Y up: it is turned if most of the time the pelvis points along Z.

    Args:
        pelvis: (T, 4) rotations in the world of the file.
        place: (T, 3) metres.
    """
    if not has_z_up(quat_rotate(pelvis, np.array([0.0, 1.0, 0.0]))):
        return pelvis, place
    return quat_multiply(Z_TO_Y, pelvis), quat_rotate(Z_TO_Y, place)
