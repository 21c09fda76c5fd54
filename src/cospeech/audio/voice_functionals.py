"""Describe a stretch of speech by a hundred numbers: means, spreads and ranges of pitch, loudness, timbre and rhythm.

Such numbers are called functionals (Schuller et al. 2013, "The INTERSPEECH 2013 computational paralinguistics challenge"). The
choice is ours.
"""

from __future__ import annotations

from functools import cache, lru_cache
from itertools import pairwise

import numpy as np

from ..motion.rotations import Array
from .event_detection import quantile
from .features.prosody import Features

__all__ = ["FUNCTIONALS", "LEVELS", "measure_voice"]

_BANDS, _CEPSTRA = 20, 13  # groups of four mel bands; cepstral coefficients without the zeroth, which is loudness
_SPEECH_RANGE = 30.0  # dB below the loud syllables at which speech ends [ours: voiceless sounds count]
_LOUD_SHARE = 0.95  # of the frames that are softer than loud syllables [ours]
_LEAST_SPOKEN, _LEAST_VOICED = 30, 15  # frames: less says too little [ours]
_ONSET = 3.0  # dB of flux that make a peak an onset [ours]
_MODULATIONS = (0.8, 2.0, 4.0, 6.0, 9.0, 13.0, 20.0)  # Hz, edges of bands of the envelope; syllables come at 3 to 6 Hz
_TRANSFORM = 512  # frames: at least the longest stretch; longer ones are cut to it
_REFERENCE = 100.0  # Hz: pitch is in semitones above it
FUNCTIONALS = 2 * _CEPSTRA + _CEPSTRA + 14 + 7 + 12 + 4 + 4 + 11 + 6 + 4
"""How many numbers there are."""
LEVELS = (3 * _CEPSTRA + 14, 3 * _CEPSTRA + 14 + 4)
"""First and end of those that are levels of loudness: they rise by the gain of the microphone, in dB."""


def measure_voice(voice: Features) -> Array | None:
    """(FUNCTIONALS,) of a stretch of speech of 1 to 5 s, with its mel bands; None where nearly nothing is said."""
    assert voice.mel is not None
    energy = np.asarray(voice.energy, float)
    if len(energy) < _LEAST_SPOKEN:
        return None
    (loud,) = _quantiles(energy, _LOUD_SHARE)
    is_speech = energy > loud - _SPEECH_RANGE
    voiced = is_speech & (voice.voicing > 0.5) & (voice.pitch > 0)
    count = np.count_nonzero
    if (
        count(is_speech) < _LEAST_SPOKEN
        or count(voiced) < _LEAST_VOICED
        or count(voiced[1:] & voiced[:-1]) < _LEAST_VOICED // 3
    ):
        return None
    parts = [
        _timbre(voice.mel, is_speech, voiced),
        _loudness(energy, is_speech, loud),
        _intonation(voice, voiced),
        _phonation(np.asarray(voice.voicing, float), is_speech, voiced),
        _onsets(np.asarray(voice.onset, float), is_speech),
        _balance(np.asarray(voice.bands, float) - energy[:, None], is_speech, voiced),
        _rhythm(np.where(is_speech, energy - loud, -_SPEECH_RANGE)[:_TRANSFORM]),
        _runs(voiced),
    ]
    return np.concatenate(parts)


def _quantiles(values: Array, *shares: float) -> list[float]:
    ascending = np.sort(values)
    return [quantile(ascending, share) for share in shares]


@cache
def _cosines() -> Array:
    """(20, 13) of a discrete cosine transform, without its zeroth row."""
    basis: Array = np.cos(np.pi * np.outer(np.arange(_BANDS) + 0.5, np.arange(1, _CEPSTRA + 1)) / _BANDS) * np.sqrt(2 / _BANDS)
    return basis


def _level(values: Array) -> tuple[Array, Array]:
    """Mean and spread over the first axis: as those of NumPy, which take twice as long over so few."""
    mean = np.add.reduce(values, 0) / len(values)
    away = values - mean
    return mean, np.sqrt(np.add.reduce(away * away, 0) / len(values))


def _mean(values: Array) -> float:
    return float(np.add.reduce(values)) / len(values)


def _timbre(mel: Array, is_speech: Array, voiced: Array) -> Array:
    """Cepstra: mean and spread, spread of their change, and those of voiced frames."""
    bands = mel.astype(float).reshape(len(mel), _BANDS, -1)
    total = bands[..., 0]
    for k in range(1, bands.shape[2]):
        total = total + bands[..., k]
    cepstra = (total / bands.shape[2] * (10 / np.log(10))) @ _cosines()
    steps = np.diff(cepstra, axis=0)[is_speech[1:] & is_speech[:-1]]
    (mean, spread), (voiced_mean, voiced_spread) = _level(cepstra[is_speech]), _level(cepstra[voiced])
    return np.concatenate([mean, spread, _level(steps)[1], voiced_mean[:8], voiced_spread[:6]])


def _loudness(energy: Array, is_speech: Array, loud: float) -> Array:
    """Level and range in dB, and how steeply it rises and falls."""
    steps, own = np.diff(energy)[is_speech[1:] & is_speech[:-1]], energy[is_speech]
    low, high = _quantiles(steps, 0.05, 0.95)
    middle, upper = _quantiles(own, 0.5, 0.9)
    return np.array([*_level(own), upper - middle, _mean(np.abs(steps)), loud, high, low])


def _intonation(voice: Features, voiced: Array) -> Array:
    """Level, range, slope and steps of pitch in semitones."""
    pitch = np.asarray(voice.pitch, float)
    tones = 12 * np.log2(np.where(pitch > 0, pitch, _REFERENCE) / _REFERENCE)
    own, steps = tones[voiced], np.diff(tones)[voiced[1:] & voiced[:-1]]
    times = np.flatnonzero(voiced) / voice.fps
    times = times - _mean(times)
    mean, spread = _level(own)
    slope = float(times @ (own - mean)) / max(float(times @ times), 1e-9)
    low, tenth, middle, ninth, high = _quantiles(own, 0.05, 0.1, 0.5, 0.9, 0.95)
    down, up = _quantiles(steps, 0.1, 0.9)
    size = np.abs(steps)
    level = [mean, spread, low, middle, high, ninth - tenth, slope]
    return np.array([*level, _mean(size), _level(steps)[1], up, down, *_quantiles(size, 0.5)])


def _phonation(voicing: Array, is_speech: Array, voiced: Array) -> Array:
    """How much of the speech is voiced, and how clear the voice is."""
    share = np.count_nonzero(voiced) / np.count_nonzero(is_speech)
    return np.array([share, _mean(voicing[is_speech]), *_level(voicing[voiced])])


def _onsets(onset: Array, is_speech: Array) -> Array:
    """Spectral flux, and its peaks per second of speech."""
    own, middle = onset[is_speech], onset[1:-1]
    peaks = (middle > onset[:-2]) & (middle >= onset[2:]) & (middle > _ONSET)
    return np.array([*_level(own), *_quantiles(own, 0.9), 100.0 * np.count_nonzero(peaks) / np.count_nonzero(is_speech)])


def _balance(bands: Array, is_speech: Array, voiced: Array) -> Array:
    """Five bands against the whole, in dB: mean where voiced, spread where spoken, and high against low: vocal effort."""
    mean = _level(bands[voiced])[0]
    return np.concatenate([mean, _level(bands[is_speech])[1], [_mean(mean[3:]) - mean[1]]])


@cache
def _modulation_bins() -> list[slice]:
    """Bins of the transform, by band."""
    hertz = np.arange(_TRANSFORM // 2 + 1) * (100.0 / _TRANSFORM)
    return [slice(*np.searchsorted(hertz, edges).tolist()) for edges in pairwise(_MODULATIONS)]


@lru_cache(8)
def _taper(length: int) -> Array:
    window = np.hanning(length)
    window.setflags(write=False)
    return window


def _rhythm(envelope: Array) -> Array:
    """Logarithms of the shares of six bands of modulation of the loudness."""
    spectrum = np.square(np.abs(np.fft.rfft((envelope - _mean(envelope)) * _taper(len(envelope)), _TRANSFORM)))
    powers = [float(np.add.reduce(spectrum[bins])) for bins in _modulation_bins()]
    return np.log(np.array(powers) / (sum(powers) + 1e-9) + 1e-6)


def _runs(voiced: Array) -> Array:
    """Lengths of voiced stretches in seconds: mean, spread, longest; and how many there are per second."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], voiced.astype(int), [0]])))
    lengths = (edges[1::2] - edges[::2]) / 100.0
    return np.array([*_level(lengths), lengths.max(), 100.0 * len(lengths) / len(voiced)])
