"""The level of speech at a fixed rate, for metrics that compare lips with speech."""

from __future__ import annotations

import numpy as np

from ..audio.speech import Speech
from ..errors import InputError
from ..motion.rotations import Array

__all__ = ["RATE", "at_rate", "level", "silent"]

RATE = 100.0  # values per second; ours: far above what jaws do
_WINDOW = 0.04  # s; ours: some periods of a low voice
_RANGE = 60.0  # dB below the loudest; ours: what is quieter counts as this
_QUIET, _LOUD = 30.0, 95.0  # silence is so many dB below this percentile of the level; ours: breath and room
_PAUSE = 0.15  # s at least; ours: closures of plosives are shorter (50 to 120 ms)


def level(speech: Speech) -> Array:
    """(n,) dB of the speech at `RATE`; value k is of ``_WINDOW`` around k / RATE seconds, 0 dB the loudest.

    Raises:
        InputError: no sound at all.
    """
    samples, rate = np.asarray(speech.samples, np.float64), float(speech.rate)
    count = int(len(samples) / rate * RATE)
    sums = np.concatenate([[0.0], np.cumsum(np.square(samples))])
    middle = np.arange(count) * rate / RATE
    ends = [np.clip(np.round(middle + side * _WINDOW * rate / 2), 0, len(samples)).astype(int) for side in (-1, 1)]
    power = np.maximum(sums[ends[1]] - sums[ends[0]], 0) / np.maximum(ends[1] - ends[0], 1)
    loudest = power.max(initial=0)
    if not loudest > 0:
        raise InputError(f"{speech.name!r} is silence", "metrics of lips need speech")
    return np.maximum(10 * np.log10(np.maximum(power / loudest, 1e-300)), -_RANGE)


def silent(levels: Array) -> Array:
    """(n,) whether nobody speaks: quieter than speech by 30 dB, for 0.15 s at least."""
    quiet = levels < np.percentile(levels, _LOUD) - _QUIET
    edges = np.flatnonzero(np.diff(np.concatenate([[0], quiet.astype(int), [0]])))
    pauses = np.zeros(len(levels), bool)
    for first, end in edges.reshape(-1, 2):
        pauses[first:end] = end - first >= _PAUSE * RATE
    return pauses


def at_rate(values: Array, fps: float, count: int) -> Array:
    """(count,) values of frames (T,) at `RATE`, linear between frames; the last one stays."""
    return np.interp(np.arange(count) / RATE, np.arange(len(values)) / fps, values)
