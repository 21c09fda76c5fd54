"""The mouth from the sound alone: jaw from the energy, lips from the balance of the bands, closures from its dips.

All is worked out row by row on the 100 Hz grid of `Heard`, passed through critically damped filters, and read off at the
wanted times: a finite memory, so any window that reaches half a second to both sides gives the same mouth.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..rotations import Array
from .heard import RATE, Heard
from .visemes import MOUTH

__all__ = ["Voice", "voice_to_mouth"]

# Loudness (dB between floor and loud syllables, 0 … 1) at which the jaw starts to open, and at which it is as wide as
# the vowel wants. Ours, fitted by hand to 180 clips of GRID and 8 minutes of FACEGOOD, as are all amounts below.
_QUIET, _FULL = 0.35, 0.80
_PARTED = 0.12  # jaw while there is any voice
_VOWEL = (0.055, 0.14, 0.155, 0.06)  # jaw of a vowel at full voice: neutral, open, clear, front (less)
_BREATH = 0.12
_LOUDER = 0.50  # for each unit of loudness over _FULL
_TAU = 0.026  # s; time constant of the critically damped filter (impulse response t·exp(-t/τ), mean delay 2τ)
_JAW_LAG, _LIP_LAG = 0.029, 0.010  # s after the sound; motion.md: the jaw lags by 26–32 ms. Lips: ours
_PAD = 50  # rows of silence beyond the window
_BEFORE, _AFTER = 8, 10  # rows: lips part this long before sound and stay this long after it (plus the filter's rise)
_DIP = 12  # rows to both sides among which a dip of the energy is one closure
_SPEAK = np.arange(32) * np.exp(-np.arange(32) / (_TAU * RATE))
_SPEAK /= _SPEAK.sum()
_SLOW = np.hanning(67)[1:-1] / np.hanning(67)[1:-1].sum()  # ± 0.32 s: whether somebody is talking here


class Voice(NamedTuple):
    """What the sound says about the mouth, at T times."""

    shape: Array
    """(T, len(MOUTH))."""
    closed: Array
    """(T,) lips together: a guess from dips of voiced energy."""
    active: Array
    """(T,) 0 in pauses, 1 in speech; opens ahead of the sound and outlasts it a little."""
    effort: Array
    """(T,) how loud, about 0.5 … 1.2 in speech; scales what the words ask for."""
    talking: Array
    """(T,) `active`, slowly: 0 … 1."""


def _ramp(x: Array, low: float, high: float) -> Array:
    return np.clip((x - low) / (high - low), 0.0, 1.0)


def _running_max(x: Array, before: int, after: int) -> Array:
    """Maximum of rows k - before … k + after; the ends count as 0."""
    padded = np.concatenate([np.zeros(before), x, np.zeros(after)])
    return np.lib.stride_tricks.sliding_window_view(padded, before + after + 1).max(1)


def _rows(heard: Heard) -> Array:
    """(T, 9): what the mouth aims at, row by row: MOUTH's jaw … upper up (7), closed, active."""
    loud, voiced, bands = heard.loudness, heard.voicing, heard.bands
    level = _ramp(loud, _QUIET, _FULL)
    hiss = _ramp(bands[:, 4] - bands[:, 1], -20.0, -2.0) * (1 - 0.6 * voiced) * _ramp(loud, 0.15, 0.4)
    front = _ramp(bands[:, 3] - bands[:, 2], -6.0, 14.0) * voiced * level  # F2 above 1.5 kHz: i, e
    back = _ramp(bands[:, 1] - bands[:, 3], 20.0, 34.0) * voiced * level  # little above 1.5 kHz: o, u, w, m, n
    open_ = np.tanh((bands[:, 1] - bands[:, 0] + 8.0) / 10.0)  # strong first formant against the voice bar: a
    clear = np.tanh((bands[:, 4] - bands[:, 1] + 25.0) / 15.0)  # bright: not nasal, not rounded, not murmured
    vowel = _VOWEL[0] + _VOWEL[1] * open_ + _VOWEL[2] * clear - _VOWEL[3] * front
    breath = _BREATH * (1 - clear)  # aspiration yes, hiss no
    jaw = (
        _PARTED * _ramp(loud, 0.2, 0.5)
        + level * (voiced * vowel + (1 - voiced) * breath)
        + _LOUDER * np.maximum(loud - _FULL, 0)
    )
    jaw = np.maximum(jaw, 0.0)
    around = np.minimum(_running_max(level, _DIP, 0), _running_max(level, 0, _DIP))
    burst = _running_max(hiss, 2, 6)
    closed = _ramp(around - level, 0.45, 0.75) * (1 - burst)
    active = _running_max(_ramp(loud, 0.22, 0.45), _AFTER, _BEFORE)
    round_ = back * (1 - 0.5 * np.maximum(open_, 0))
    sharp = _ramp(hiss, 0.2, 0.9)
    columns = (
        jaw,
        0.16 * round_ + 0.05 * sharp,
        0.34 * round_,
        0.20 * front + 0.16 * sharp,
        0.12 * front + 0.05 * sharp,
        (0.035 * active + 0.16 * level * (0.6 + 0.4 * open_) + 0.14 * sharp) * (1 - 0.6 * round_),
        0.012 * active + 0.07 * level * (0.5 + 0.5 * front) + 0.05 * sharp,
        closed,
        active,
    )
    return np.stack(columns, 1)


def voice_to_mouth(times: Array, heard: Heard) -> Voice:
    """The mouth at ``times`` (T,) in seconds; beyond the window there is silence."""
    rows = np.zeros((len(heard.loudness) + 2 * _PAD, 10))
    rows[_PAD:-_PAD, :9] = _rows(heard)
    rows[_PAD:-_PAD, 9] = np.maximum(heard.loudness, 0)
    reach = len(_SPEAK) - 1
    history = np.lib.stride_tricks.sliding_window_view(np.pad(rows, ((reach, 0), (0, 0))), reach + 1, axis=0)
    smooth = history @ _SPEAK[::-1]
    slow = np.convolve(rows[:, 8], _SLOW, "same")
    base = (heard.start - _PAD) / RATE - 2 * _TAU
    jaw, lips = (_read(smooth, (times - lag - base) * RATE) for lag in (_JAW_LAG, _LIP_LAG))
    shape = np.zeros((len(times), len(MOUTH)))
    shape[:, 0] = jaw[:, 0]
    shape[:, 1:7] = lips[:, 1:7]
    effort = 0.40 + 0.75 * jaw[:, 9]
    return Voice(shape, _ramp(lips[:, 7], 0.15, 0.65), lips[:, 8], effort, _read(slow, (times - base - 2 * _TAU) * RATE))


def _read(rows: Array, at: Array) -> Array:
    """Linear interpolation of rows; the ends are held."""
    at = np.clip(at, 0, len(rows) - 1)
    low = np.minimum(at.astype(int), len(rows) - 2)
    part = at - low
    if rows.ndim > 1:
        part = part[:, None]
    return rows[low] * (1 - part) + rows[low + 1] * part
