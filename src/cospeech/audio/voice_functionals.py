"""What a stretch of speech sounds like in a hundred numbers: means, spreads and ranges of pitch, loudness, timbre and rhythm.

Such numbers are called functionals (Schuller et al. 2013, "The INTERSPEECH 2013 computational paralinguistics challenge"). The
choice is ours.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from ..motion.rotations import Array
from .event_detection import quantile
from .features.prosody import Features

__all__ = ["FUNCTIONALS", "LEVELS", "measure_voice"]

_BANDS, _CEPSTRA = 20, 13  # groups of four mel bands; cepstral coefficients without the zeroth, which is loudness
_SPOKEN = 30.0  # dB below the loud syllables at which speech ends [ours: voiceless sounds count]
_LOUD_SHARE = 0.95  # of the frames that are softer than loud syllables [ours]
_LEAST_SPOKEN, _LEAST_VOICED = 30, 15  # frames: less says too little [ours]
_ONSET = 3.0  # dB of flux that make a peak an onset [ours]
_MODULATIONS = (0.8, 2.0, 4.0, 6.0, 9.0, 13.0, 20.0)  # Hz, edges of bands of the envelope; syllables come at 3 to 6 Hz
_TRANSFORM = 512  # frames: at least the longest stretch; longer ones are cut to it
_REFERENCE = 100.0  # Hz: pitch is in semitones above it
FUNCTIONALS = 2 * _CEPSTRA + _CEPSTRA + 14 + 7 + 12 + 4 + 4 + 11 + 6 + 4
"""How many numbers."""
LEVELS = (3 * _CEPSTRA + 14, 3 * _CEPSTRA + 14 + 4)
"""Which of them are levels of loudness, and move by so many dB with the gain of the microphone."""


def measure_voice(voice: Features) -> Array | None:
    """(FUNCTIONALS,) of a stretch of speech of 1 to 5 s, with its mel bands; None where nearly nothing is said."""
    assert voice.mel is not None
    energy = np.asarray(voice.energy, float)
    if len(energy) < _LEAST_SPOKEN:
        return None
    (loud,) = _quantiles(energy, _LOUD_SHARE)
    spoken = energy > loud - _SPOKEN
    voiced = spoken & (voice.voicing > 0.5) & (voice.pitch > 0)
    if spoken.sum() < _LEAST_SPOKEN or voiced.sum() < _LEAST_VOICED or (voiced[1:] & voiced[:-1]).sum() < _LEAST_VOICED // 3:
        return None
    parts = [
        _timbre(np.asarray(voice.mel, float), spoken, voiced),
        _loudness(energy, spoken, loud),
        _intonation(voice, voiced),
        _phonation(np.asarray(voice.voicing, float), spoken, voiced),
        _onsets(np.asarray(voice.onset, float), spoken),
        _balance(np.asarray(voice.bands, float) - energy[:, None], spoken, voiced),
        _rhythm(np.where(spoken, energy - loud, -_SPOKEN)[:_TRANSFORM]),
        _runs(voiced),
    ]
    return np.concatenate(parts)


def _quantiles(values: Array, *shares: float) -> list[float]:
    ordered = np.sort(values)
    return [quantile(ordered, share) for share in shares]


@cache
def _cosines() -> Array:
    """(20, 13) of a discrete cosine transform, without its zeroth row."""
    found: Array = np.cos(np.pi * np.outer(np.arange(_BANDS) + 0.5, np.arange(1, _CEPSTRA + 1)) / _BANDS) * np.sqrt(2 / _BANDS)
    return found


def _timbre(mel: Array, spoken: Array, voiced: Array) -> Array:
    """Cepstra: mean and spread, spread of their change, and those of voiced frames."""
    decibels = mel.reshape(len(mel), _BANDS, -1).mean(2) * (10 / np.log(10))
    cepstra = decibels @ _cosines()
    steps = np.diff(cepstra, axis=0)[spoken[1:] & spoken[:-1]]
    own, sung = cepstra[spoken], cepstra[voiced]
    return np.concatenate([own.mean(0), own.std(0), steps.std(0), sung.mean(0)[:8], sung.std(0)[:6]])


def _loudness(energy: Array, spoken: Array, loud: float) -> Array:
    """Level and range in dB, and how steeply it rises and falls."""
    steps, own = np.diff(energy)[spoken[1:] & spoken[:-1]], energy[spoken]
    low, high = _quantiles(steps, 0.05, 0.95)
    middle, upper = _quantiles(own, 0.5, 0.9)
    return np.array([own.mean(), own.std(), upper - middle, np.abs(steps).mean(), loud, high, low])


def _intonation(voice: Features, voiced: Array) -> Array:
    """Level, range, slope and steps of pitch in semitones."""
    pitch = np.asarray(voice.pitch, float)
    tones = 12 * np.log2(np.where(pitch > 0, pitch, _REFERENCE) / _REFERENCE)
    own, steps = tones[voiced], np.diff(tones)[voiced[1:] & voiced[:-1]]
    times = np.flatnonzero(voiced) / voice.fps
    times = times - times.mean()
    slope = float(times @ (own - own.mean())) / max(float(times @ times), 1e-9)
    low, tenth, middle, ninth, high = _quantiles(own, 0.05, 0.1, 0.5, 0.9, 0.95)
    down, up = _quantiles(steps, 0.1, 0.9)
    size = np.abs(steps)
    level = [own.mean(), own.std(), low, middle, high, ninth - tenth, slope]
    return np.array([*level, size.mean(), steps.std(), up, down, *_quantiles(size, 0.5)])


def _phonation(voicing: Array, spoken: Array, voiced: Array) -> Array:
    """How much of the speech is voiced, and how clear the voice is."""
    return np.array([voiced.sum() / spoken.sum(), voicing[spoken].mean(), voicing[voiced].mean(), voicing[voiced].std()])


def _onsets(onset: Array, spoken: Array) -> Array:
    """Spectral flux, and its peaks per second of speech."""
    own, middle = onset[spoken], onset[1:-1]
    peaks = (middle > onset[:-2]) & (middle >= onset[2:]) & (middle > _ONSET)
    return np.array([own.mean(), own.std(), *_quantiles(own, 0.9), 100.0 * peaks.sum() / spoken.sum()])


def _balance(bands: Array, spoken: Array, voiced: Array) -> Array:
    """Five bands against the whole, in dB: mean where voiced, spread where spoken, and high against low: vocal effort."""
    mean = bands[voiced].mean(0)
    return np.concatenate([mean, bands[spoken].std(0), [mean[3:].mean() - mean[1]]])


def _rhythm(envelope: Array) -> Array:
    """Logarithms of the shares of six bands of modulation of the loudness."""
    spectrum = np.square(np.abs(np.fft.rfft((envelope - envelope.mean()) * np.hanning(len(envelope)), _TRANSFORM)))
    hertz = np.arange(len(spectrum)) * (100.0 / _TRANSFORM)
    powers = [spectrum[(hertz >= low) & (hertz < high)].sum() for low, high in pairwise(_MODULATIONS)]
    return np.log(np.array(powers) / (sum(powers) + 1e-9) + 1e-6)


def _runs(voiced: Array) -> Array:
    """Lengths of voiced stretches in seconds: mean, spread, longest; and how many there are per second."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], voiced.astype(int), [0]])))
    lengths = (edges[1::2] - edges[::2]) / 100.0
    return np.array([lengths.mean(), lengths.std(), lengths.max(), 100.0 * len(lengths) / len(voiced)])
