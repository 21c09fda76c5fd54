"""PATS' poses as numbers: the files' (T, 104) and our key points, the authors' transforms."""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...motion.rotations import Array
from ...motion.skeletons.pats import JOINTS, LEFT, RIGHT

__all__ = ["FPS", "from_points", "hold_arm", "mirror", "normalise_points", "to_points"]

FPS = 15.0  # frames per second of all poses
_SHOULDER = 167.0  # pixels from the neck to the right shoulder in pose/normalize


def to_points(flat: Array) -> Array:
    """(T, 104) of ``pose/data`` → (T, 52, 2), absolute, y up."""
    values = np.stack([flat[:, : len(JOINTS)], -flat[:, len(JOINTS) :]], -1)
    values[:, 1:] += values[:, :1]
    return values + 0.0  # no -0


def mirror(values: Array) -> Array:
    """(T, 52, 2) → the authors' *mirror*: x of every joint turned at the neck; joints keep their names, so sides change."""
    points = np.array(values)
    points[..., 1:, 0] = 2 * values[..., :1, 0] - values[..., 1:, 0]
    return points


def hold_arm(values: Array, side: str, mean: Array) -> Array:
    """(T, 52, 2) → the authors' *leftarm* or *rightarm*: the joints of that side stand still at their mean.

    Args:
        side: ``"left"`` or ``"right"``.
        mean: (52, 2) mean of the speaker from the neck, y up: ``to_points`` of ``pose/data/mean`` less its neck.
    """
    if side not in ("left", "right") or np.shape(mean) != (len(JOINTS), 2):
        raise InputError(f"the arm {side!r} and a mean of shape {np.shape(mean)}", "'left' or 'right', and (52, 2)")
    points, joints = np.array(values), list(LEFT if side == "left" else RIGHT)
    points[..., joints, :] = values[..., :1, :] + np.asarray(mean)[joints]
    return points


def from_points(values: Array) -> Array:
    """(T, 52, 2), absolute, y up → (T, 104) of ``pose/data``; the inverse of `to_points`."""
    flat = np.array(values, float)
    flat[:, 1:] -= flat[:, :1]
    return np.concatenate([flat[..., 0], -flat[..., 1]], -1) + 0.0


def normalise_points(flat: Array) -> Array:
    """(T, 104) of ``pose/data`` → ``pose/normalize``: scaled in each frame to a shoulder of 167 pixels; the neck stays.

    Raises:
        InputError: a right shoulder that lies on the neck.
    """
    length = np.hypot(flat[:, 1], flat[:, 53])
    if not (length > 1e-6).all():
        frame = int(np.argmax(~(length > 1e-6)))
        raise InputError(
            f"the right shoulder lies on the neck in frame {frame}", "a detection that failed: leave the frame out"
        )
    scale = np.repeat((_SHOULDER / length)[:, None], flat.shape[1], 1)
    scale[:, [0, len(JOINTS)]] = 1.0
    return flat * scale
