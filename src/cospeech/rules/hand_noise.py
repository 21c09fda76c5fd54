"""Small movement of hands that are never still."""

from __future__ import annotations

import numpy as np

from ..motion.curves import soft_clip
from ..motion.kinematics.hands import Channel
from ..motion.noise import smooth_noise
from ..motion.rotations import Array

__all__ = ["add_hand_noise"]

_WANDER_HZ, _WANDER = 1.0, np.array([0.055, 0.065, 0.055])
"""How often, and how far in arm lengths, a raised hand wanders about its place. [ours: held up, the hands of a recorded speaker
are seldom slower than .13 m/s; without this, ours were at .05]"""
_TOGETHER, _ALONE = 0.75, 0.65  # shares of it that both hands have in common, and that each has alone [ours]
_HANGS, _RISE = -0.60, 0.22  # arm lengths above the shoulder of a hand that hangs; and from there to one that is raised [ours]
_FINGERS_HZ = 1.2  # of fingers that are never still: half of what recorded fingers move, in the median (ours)
_KNUCKLE_LIMITS, _MIDDLE_LIMITS = (-18.0, 94.0), (-2.0, 106.0)  # degrees; active ranges of adult fingers (Hume et al. 1990)
_SPREAD_LIMITS = (-5.0, 17.0)  # degrees between neighbours: the little finger shows half as much again (ours)


def add_hand_noise(h: Array, times: Array, seed: int, size: float, tremor: Array) -> None:
    """Add noise to the channels of both hands, ``h (N, 2, CHANNELS)``, so that they are never still; fingers stay in range.

    Args:
        h: written to.
        times: (N,) seconds.
        seed: of the noise.
        size: factor on it (intensity).
        tremor: (N,) 0 … 1, added fine shaking (fear).
    """
    n = smooth_noise(seed + 2, 14, times, 0.40, octaves=3, gain=0.45)
    bends = smooth_noise(seed + 4, 8, times, _FINGERS_HZ, octaves=2, gain=0.5)
    wander = smooth_noise(seed + 5, 9, times, _WANDER_HZ, octaves=1)
    still = 0.55 + 0.45 * min(size, 1.0)
    for side in (0, 1):
        k = n[:, side * 7 : side * 7 + 7] * still
        lift = np.minimum(np.maximum((h[:, side, 1:2] - _HANGS) / _RISE, 0.0), 1.0) * still
        h[:, side, :3] += k[:, :3] * (0.011, 0.010, 0.011)
        h[:, side, :3] += lift * (_TOGETHER * wander[:, :3] + _ALONE * wander[:, 3 + 3 * side : 6 + 3 * side]) * _WANDER
        h[:, side, 3:7] += k[:, 3:7] * (4.0, 5.0, 5.0, 3.0)
        fingers = bends[:, side * 4 : side * 4 + 4] * still * (8.6, 9.2, 9.2, 9.8)
        h[:, side, Channel.KNUCKLES] += fingers
        h[:, side, Channel.MIDDLES] += fingers * 1.3
    h[:, :, Channel.KNUCKLES] = soft_clip(h[:, :, Channel.KNUCKLES], *_KNUCKLE_LIMITS)
    h[:, :, Channel.MIDDLES] = soft_clip(h[:, :, Channel.MIDDLES], *_MIDDLE_LIMITS)
    h[:, :, Channel.SPREAD] = soft_clip(h[:, :, Channel.SPREAD], *_SPREAD_LIMITS)
    if tremor.any():
        shake = smooth_noise(seed + 3, 6, times, 7.0, octaves=1) * (0.003 * tremor[:, None])
        h[:, :, :3] += shake.reshape(-1, 2, 3)
