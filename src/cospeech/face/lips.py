"""The mouth from the sound alone: jaw from the energy, lips from the balance of the bands, closures from its dips.

All is worked out row by row on the 100 Hz grid of `Heard`, passed through critically damped filters, and read off at the
wanted times: a finite memory, so any window that reaches half a second to both sides gives the same mouth.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..audio.prosodic_events import RATE, Heard
from ..motion.rotations import Array
from .visemes import MOUTH

__all__ = ["MouthEstimate", "voice_to_mouth"]

# Loudness (dB between floor and loud syllables, 0 … 1) at which the jaw starts to open, and at which it is as wide as
# the vowel wants. Ours, fitted by hand to 180 clips of GRID and 8 minutes of FACEGOOD, as are all amounts below.
_QUIET, _FULL = 0.35, 0.80
_LEAST_JAW = 0.12  # jaw while there is any voice
_VOWEL = (0.055, 0.14, 0.155, 0.06)  # jaw of a vowel at full voice: neutral, open, clear, front (less)
_BREATH = 0.12
_LOUDER = 0.50  # for each unit of loudness over _FULL
_TAU = 0.030  # s; time constant of the critically damped filter (impulse response t·exp(-t/τ), mean delay 2τ)
_LAG = 0.009  # s of lips after the sound; ours
_JAW_LATER = 2  # rows; so the jaw lags by 29 ms (motion.md: 26–32 ms after log energy)
_BEFORE, _AFTER = 8, 10  # rows: lips part this long before sound and stay this long after it (plus the filter's rise)
_DIP = 12  # rows to both sides among which a dip of the energy is one closure
_PAD = 50  # rows of silence beyond the window
_ROWS = np.arange(32.0)
_SPEAK = _ROWS * np.exp(-_ROWS / (_TAU * RATE))
_SPEAK = _SPEAK[::-1] / _SPEAK.sum()
TALKING_HALF = 0.34
"""Seconds to either side that tell whether somebody is talking."""
_SLOW = np.hanning(67)[1:-1] / np.hanning(67)[1:-1].sum()  # ± 0.32 s: whether somebody is talking here


class MouthEstimate(NamedTuple):
    """The mouth as estimated from the sound, at T times."""

    shape: Array
    """(T, len(MOUTH))."""
    closed: Array
    """(T,) lips together: a guess from dips of voiced energy."""
    active: Array
    """(T,) 0 in pauses, 1 in speech; it rises before the sound and falls a little after it."""
    effort: Array
    """(T,) how loud, about 0.5 … 1.2 in speech; scales the mouth shapes of words."""
    talking: Array
    """(T,) `active`, slowly: 0 … 1."""


def _ramp(x: Array, low: float, high: float) -> Array:
    return np.minimum(np.maximum((x - low) / (high - low), 0.0), 1.0)


def _rows(speech: Heard) -> Array:
    """(T, 10) targets of the mouth, row by row: MOUTH's jaw … upper up (7), closed, active, loudness."""
    loud, voiced, bands = speech.loudness, speech.voicing, speech.bands
    level = _ramp(loud, _QUIET, _FULL)
    full = voiced * level
    tilt = bands[:, 4] - bands[:, 1]
    hiss = _ramp(tilt, -20.0, -2.0) * (1 - voiced * _ramp(-tilt, -2.0, 10.0)) * _ramp(loud, 0.15, 0.4)
    front = _ramp(bands[:, 3] - bands[:, 2], -6.0, 14.0) * full  # F2 above 1.5 kHz: i, e
    back = _ramp(bands[:, 1] - bands[:, 3], 18.0, 32.0) * full  # little above 1.5 kHz: o, u, w, m, n
    open_ = np.tanh((bands[:, 1] - bands[:, 0] + 8.0) / 10.0)  # strong first formant against the voice bar: a
    clear = np.tanh((tilt + 25.0) / 15.0)  # bright: not nasal, not rounded, not murmured
    vowel = _VOWEL[0] + _VOWEL[1] * open_ + _VOWEL[2] * clear - _VOWEL[3] * front
    jaw = full * vowel + (level - full) * (_BREATH * (1 - clear))  # aspiration opens, hiss does not
    jaw = np.maximum(jaw + _LEAST_JAW * _ramp(loud, 0.2, 0.5) + _LOUDER * np.maximum(loud - _FULL, 0), 0.0)
    jaw *= 1 - 0.6 * hiss
    closed, active = _closures(level, hiss, _ramp(loud, 0.22, 0.45))
    round_ = back * (1 - 0.5 * np.maximum(open_, 0))
    sharp = _ramp(hiss, 0.2, 0.9)
    out = np.empty((len(loud), 10))
    out[:, 0] = jaw
    out[:, 1] = 0.24 * round_ + 0.05 * sharp
    out[:, 2] = 0.50 * round_
    out[:, 3] = 0.20 * front + 0.16 * sharp
    out[:, 4] = 0.12 * front + 0.05 * sharp
    out[:, 5] = (0.035 * active + level * (0.10 + 0.06 * open_) + 0.14 * sharp) * (1 - 0.6 * round_)
    out[:, 6] = 0.012 * active + 0.035 * (level + front) + 0.05 * sharp
    out[:, 7], out[:, 8], out[:, 9] = closed, active, loud
    return out


def _closures(level: Array, hiss: Array, present: Array) -> tuple[Array, Array]:
    """Dips between louder moments, unless they hiss or end in hiss; and presence, spread to _BEFORE and _AFTER."""
    count, wide = len(level), _DIP + 1
    rows = np.zeros((3, count + 2 * _DIP))
    rows[:, _DIP:-_DIP] = level, hiss, present
    most, span = rows, 1  # of column k: rows k - _DIP … k - _DIP + span - 1
    while span < wide:
        step = min(span, wide - span)
        most, span = np.maximum(most[:, :-step], most[:, step:]), span + step
    around = np.minimum(most[0, :count], most[0, _DIP:])
    burst = most[1, 8 : 8 + count]  # 4 rows before … 8 after
    active = np.maximum(most[2, _DIP - _AFTER : count + _DIP - _AFTER], most[2, _BEFORE : count + _BEFORE])
    return _ramp(around - level, 0.45, 0.75) * (1 - burst), active


def voice_to_mouth(times: Array, speech: Heard, *, late: float = 0.0) -> MouthEstimate:
    """The mouth at ``times`` (T,) in seconds; beyond the window there is silence. `MouthEstimate.talking` is ``late`` seconds
    behind."""
    rows = np.zeros((len(speech.loudness) + 2 * _PAD, 10))
    rows[_PAD:-_PAD] = _rows(speech)
    rows[_JAW_LATER:, [0, 9]] = rows[:-_JAW_LATER, [0, 9]]
    at, start = np.asarray(times, float) * RATE, speech.start - _PAD
    now = _filter(rows, at + (2 * _TAU - _LAG) * RATE, _SPEAK, start + len(_SPEAK) - 1)
    talking = _filter(rows[:, 8:9], at - late * RATE, _SLOW, start + len(_SLOW) // 2)[:, 0]
    shape = np.zeros((len(times), len(MOUTH)))
    shape[:, :7] = now[:, :7]
    return MouthEstimate(shape, _ramp(now[:, 7], 0.15, 0.65), now[:, 8], 0.40 + 0.75 * now[:, 9], talking)


def _filter(rows: Array, at: Array, kernel: Array, back: int) -> Array:
    """``kernel`` laid over rows ``at - back`` onwards (fractions interpolate linearly); rows beyond the ends are held.

    Fractions are those of ``at``, counted from the beginning of the speech: no bit of them depends on where the window begins.
    """
    first = np.floor(at)
    part = (at - first)[:, None]
    weights = np.zeros((len(at), len(kernel) + 1))
    weights[:, :-1] = kernel * (1 - part)
    weights[:, 1:] += kernel * part
    index = (first.astype(int) - back)[:, None] + np.arange(len(kernel) + 1)
    index = np.minimum(np.maximum(index, 0), len(rows) - 1)
    return (weights[:, None, :] @ rows[index])[:, 0]
