"""Onsets of sound, as the published beat metrics take them from librosa with its default settings; numpy only.

Strength: the mean over 128 mel bands (Slaney) of the rise in dB from frame to frame; windows of 2048 samples, 512 apart.
Onsets: its local maxima that exceed the mean of their surroundings.
`tests/audio/test_librosa.py` compares with librosa itself.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array

__all__ = ["HOP", "backtrack", "onset_frames", "onset_strength", "onset_times", "rms"]

WINDOW, HOP, BANDS = 2048, 512, 128  # samples, samples, mel bands: librosa.onset.onset_strength
RANGE_DB, FLOOR = 80.0, 1e-10  # librosa.power_to_db
BEFORE, AROUND, APART, ABOVE = 0.03, 0.10, 0.03, 0.07  # s, s, s, of the largest: librosa.onset.onset_detect


def _triangles(rate: float) -> Array:
    """(BANDS, WINDOW // 2 + 1) area-normalised mel triangles, 0 … rate / 2 (Slaney 1998)."""
    top = rate / 2
    highest = top * 3 / 200 if top < 1000 else 15 + np.log(top / 1000) * 27 / np.log(6.4)
    mel = np.linspace(0, highest, BANDS + 2)
    edges = np.where(mel < 15, mel * 200 / 3, 1000 * np.exp((mel - 15) * np.log(6.4) / 27))
    bins = np.arange(WINDOW // 2 + 1) * (rate / WINDOW)
    rise = (bins - edges[:-2, None]) / np.diff(edges)[:-1, None]
    fall = (edges[2:, None] - bins) / np.diff(edges)[1:, None]
    return np.maximum(0, np.minimum(rise, fall)) * (2 / (edges[2:] - edges[:-2]))[:, None]


def _frames(samples: Array) -> Array:
    signal = np.pad(np.asarray(samples, np.float64), WINDOW // 2)
    return np.lib.stride_tricks.sliding_window_view(signal, WINDOW)[::HOP]


def _hann() -> Array:
    """(WINDOW,) weights of a periodic Hann window."""
    return np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * np.arange(WINDOW) / WINDOW))


def onset_strength(samples: Array, rate: float) -> Array:
    """(1 + N // 512,) strength of each frame of (N,) mono samples."""
    if np.ndim(samples) != 1 or not len(samples) or not rate > 0:
        raise InputError(f"samples of shape {np.shape(samples)} at {rate} per second", "one channel of sound")
    mel = np.square(np.abs(np.fft.rfft(_frames(samples) * _hann()))) @ _triangles(rate).T
    level = 10 * np.log10(np.maximum(mel, FLOOR))
    level = np.maximum(level, level.max() - RANGE_DB)
    rise = np.maximum(0, np.diff(level, axis=0)).mean(1)
    lead = 1 + WINDOW // (2 * HOP)  # librosa's centring: the rise belongs to the window's start
    return np.pad(rise, (lead, 0))[: len(level)]


def onset_frames(strength: Array, rate: float) -> Array:
    """Indices of the onsets in a strength curve."""
    low, high = strength.min(initial=np.inf), strength.max(initial=-np.inf)
    if not high > low:
        return np.zeros(0, int)
    x = (strength - low) / (high - low)
    before, around, apart = (int(seconds * rate // HOP) for seconds in (BEFORE, AROUND, APART))
    onsets, last = [], -np.inf
    for k in range(len(x)):
        if x[k] <= 0 or k - last <= apart:
            continue
        surroundings = x[max(0, k - around) : k + around + 1]
        if x[k] >= x[max(0, k - before) : k + 1].max() and x[k] >= surroundings.mean() + ABOVE:
            onsets.append(k)
            last = k
    return np.array(onsets, int)


def rms(samples: Array, *, hann: bool = False) -> Array:
    """(1 + N // 512,) root mean square of each frame of (N,) mono samples.

    Args:
        samples: of one channel.
        hann: weight each frame by a Hann window, as ``librosa.feature.rms`` of the magnitudes of an STFT does.
    """
    frames = _frames(samples)
    return np.sqrt(np.square(frames * _hann() if hann else frames).mean(1))


def backtrack(onsets: Array, energy: Array) -> Array:
    """Each onset moved back to the nearest earlier local minimum of ``energy`` (librosa.onset.onset_backtrack)."""
    minima = np.flatnonzero((energy[1:-1] <= energy[:-2]) & (energy[1:-1] < energy[2:])) + 1
    minima = np.concatenate([[0], minima])
    return minima[np.searchsorted(minima, onsets, side="right") - 1]


def onset_times(samples: Array, rate: float) -> Array:
    """Seconds of the onsets."""
    return onset_frames(onset_strength(samples, rate), rate) * (HOP / rate)
