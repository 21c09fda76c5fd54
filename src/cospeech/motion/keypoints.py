"""Key points from joint rotations, and resampling of key points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .motion import Motion
from .rotations import Array, quat_rotate

__all__ = ["joint_points", "resample_points"]

Source = tuple[str, tuple[float, float, float]]  # a joint of our humanoid, and an offset in its axes, metres


def joint_points(motion: Motion, sources: Sequence[Source]) -> Array:
    """(T, K, 3) positions in metres of points fixed to joints of our humanoid; other skeletons are retargeted first."""
    body = motion if motion.skeleton.kind == "humanoid" else motion.retarget("humanoid")
    positions, world = body.skeleton.forward(body.rotations, body.root)
    joints = [body.skeleton.index[name] for name, _ in sources]
    offsets = np.array([offset for _, offset in sources])
    return positions[:, joints] + quat_rotate(world[:, joints], offsets)


def resample_points(values: Array, fps: float, target: float) -> Array:
    """Resample (T, …) to another rate, linearly between frames; ceil(T × target / fps) frames."""
    if fps == target or not len(values):
        return values
    count = max(1, int(np.ceil(len(values) * target / fps - 1e-9)))
    at = np.minimum(np.arange(count) * (fps / target), len(values) - 1)
    low = at.astype(int)
    high = np.minimum(low + 1, len(values) - 1)
    part = (at - low).reshape(-1, *[1] * (values.ndim - 1))
    return values[low] + (values[high] - values[low]) * part
