"""Key points out of joint rotations, and the spectra that the key-point corpora store beside them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..features.mel import _hertz, _mel, hann
from ..motion import Motion
from ..rotations import Array, quat_rotate

__all__ = ["joint_points", "mel_filters", "resample_points", "spectra"]

Source = tuple[str, tuple[float, float, float]]  # a joint of our humanoid, and an offset in its axes, metres


def joint_points(motion: Motion, sources: Sequence[Source]) -> Array:
    """(T, K, 3) positions in metres of points fixed to joints of our humanoid; other skeletons are retargeted first."""
    body = motion if motion.skeleton.kind == "humanoid" else motion.retarget("humanoid")
    positions, world = body.skeleton.forward(body.rotations, body.root)
    joints = [body.skeleton.index[name] for name, _ in sources]
    offsets = np.array([offset for _, offset in sources])
    return positions[:, joints] + quat_rotate(world[:, joints], offsets)


def resample_points(values: Array, fps: float, target: float) -> Array:
    """(T, …) at another rate, linearly between frames; ceil(T × target / fps) frames."""
    if fps == target or not len(values):
        return values
    count = max(1, int(np.ceil(len(values) * target / fps - 1e-9)))
    at = np.minimum(np.arange(count) * (fps / target), len(values) - 1)
    low = at.astype(int)
    high = np.minimum(low + 1, len(values) - 1)
    part = (at - low).reshape(-1, *[1] * (values.ndim - 1))
    return values[low] + (values[high] - values[low]) * part


def spectra(samples: Array, length: int, hop: int, window: int, centred: bool) -> Array:
    """(T, 1 + length // 2) magnitudes |X| of Hann-windowed frames, in float64.

    Args:
        samples: (N,).
        length: of the transform; the window stands in its middle.
        hop: samples from frame to frame.
        window: length of the window.
        centred: frame k is centred on sample k × hop, the signal mirrored at its ends; else it starts there.
    """
    samples = np.asarray(samples, float)
    if centred:
        samples = np.pad(samples, length // 2, "reflect" if len(samples) > length // 2 else "constant")
    samples = np.pad(samples, (0, max(length - len(samples), 0)))
    before = (length - window) // 2
    shape = np.pad(hann(window), (before, length - window - before))
    frames = np.lib.stride_tricks.sliding_window_view(samples, length)[::hop]
    return np.abs(np.fft.rfft(frames * shape))


@cache
def mel_filters(rate: int, length: int, count: int, low: float, high: float, even: bool) -> NDArray[np.float64]:
    """(count, 1 + length // 2) triangles on Slaney's mel scale; ``even``: of equal area, else of height 1."""
    edges = _hertz(np.linspace(_mel(np.array(low)), _mel(np.array(high)), count + 2))
    bins = np.arange(length // 2 + 1) * (rate / length)
    rise = (bins - edges[:-2, None]) / (edges[1:-1] - edges[:-2])[:, None]
    fall = (edges[2:, None] - bins) / (edges[2:] - edges[1:-1])[:, None]
    height = 2 / (edges[2:] - edges[:-2]) if even else np.ones(count)
    return np.maximum(0, np.minimum(rise, fall)) * height[:, None]
