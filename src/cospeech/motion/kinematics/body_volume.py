"""The volume of torso, thighs and head, so that hands can stay out of it.

The torso is a stack of ellipses around the spine of the T-pose, and the head is an ellipsoid. Both are measured on our
mannequin with its clothes (`cospeech.export.mannequin`), and rounded up. Points are pushed out softly, a little before they
touch, so that a path bends around the body and does not jump.
"""

from __future__ import annotations

import numpy as np

from ..curves import clip, soft_positive
from ..rotations import Array

__all__ = ["HEAD_CENTRE", "HEAD_RADII", "SECTIONS", "THIGH_TOP", "push_from_head", "push_from_thighs", "push_from_torso"]

SECTIONS = np.array(
    [  # height, half width, half depth, centre z: metres in the T-pose
        (0.45, 0.150, 0.085, -0.010),
        (0.75, 0.178, 0.100, -0.008),
        (0.95, 0.180, 0.128, -0.008),
        (1.06, 0.153, 0.110, -0.005),
        (1.22, 0.165, 0.120, -0.008),
        (1.33, 0.180, 0.115, -0.010),
        (1.41, 0.120, 0.080, -0.012),
        (1.50, 0.065, 0.065, -0.004),
    ]
)
_HEIGHTS, _SIZES = SECTIONS[:, 0].copy(), np.ascontiguousarray(SECTIONS[:, 1:].T)
_SLOPES = np.concatenate([np.diff(_SIZES) / np.diff(_HEIGHTS), np.zeros((3, 1))], 1)
HEAD_CENTRE = np.array([0.0, 0.090, 0.006])  # from the head joint
HEAD_RADII = np.array([0.088, 0.131, 0.119])
THIGH_TOP = 0.085  # above the line hip joint – knee, metres; ours: the mannequin's thigh plus cloth
_SOFT = 0.012  # metres over which a push fades in (ours)


def push_from_torso(points: Array, radius: Array | float) -> Array:
    """Displacement (..., 3) that moves balls at ``points (..., 3)`` (T-pose frame of the torso) out of the torso.

    The push is horizontal, along the ellipse's normal, and never towards the back: a hand in front leaves to the front.
    """
    h = points[..., 1]
    a, b, centre = _measure_section(h)
    a, b = a + radius, b + radius
    x, z = points[..., 0], points[..., 2] - centre
    norm = np.sqrt((x / a) ** 2 + (z / b) ** 2) + 1e-6
    gx, gz = x / a**2, z / b**2
    gradient = np.sqrt(gx**2 + gz**2) + 1e-6
    depth = (1 - norm) * norm / gradient  # first-order distance to the ellipse, positive inside
    depth = np.minimum(depth, np.minimum(a, b))
    fade = np.minimum(np.maximum((1.52 - h) / 0.06, 0.0), 1.0) * np.minimum(np.maximum((h - 0.40) / 0.08, 0.0), 1.0)
    push = soft_positive(depth, _SOFT) * fade
    gz = np.abs(gz) * 0.35 + gz * 0.65  # ours: bias to the front
    length = np.sqrt(gx**2 + gz**2) + 1e-6
    out = np.zeros_like(points)
    out[..., 0], out[..., 2] = push * gx / length, push * gz / length
    return out


def _measure_section(height: Array) -> Array:
    """(3, …) half width, half depth and centre of the torso at heights (…): the result of three calls of `numpy.interp`."""
    height = clip(height, _HEIGHTS[0], _HEIGHTS[-1])
    below = np.searchsorted(_HEIGHTS, height, "right") - 1
    return _SLOPES.take(below, 1) * (height - _HEIGHTS.take(below)) + _SIZES.take(below, 1)


def push_from_head(points: Array, centre: Array, radius: Array | float) -> Array:
    """Displacement (..., 3) that moves balls out of the head's ellipsoid around ``centre (..., 3)``."""
    radii = HEAD_RADII + np.asarray(radius)[..., None]
    rel = points - centre
    norm = np.sqrt(np.einsum("...i,...i->...", rel / radii, rel / radii)) + 1e-6
    gradient = rel / radii**2
    length = np.sqrt(np.einsum("...i,...i->...", gradient, gradient)) + 1e-6
    depth = (1 - norm) * norm / length
    return (soft_positive(np.minimum(depth, 0.12), _SOFT) / length)[..., None] * gradient


def push_from_thighs(points: Array, top: Array | float, front: float, radius: Array | float) -> Array:
    """Displacement upward that keeps balls above the lap of a seated body (thighs at height ``top`` as far as ``front``)."""
    inside = top + radius - points[..., 1]
    fade = clip((points[..., 2] + 0.15) / 0.15, 0.0, 1.0) * clip((front - points[..., 2]) / 0.15, 0.0, 1.0)
    fade = fade * clip((0.58 - np.abs(points[..., 0])) / 0.20, 0.0, 1.0)  # beside the chair's seat too: a wide, soft edge
    out = np.zeros_like(points)
    out[..., 1] = soft_positive(clip(inside, -0.2, 0.18), _SOFT) * fade
    return out
