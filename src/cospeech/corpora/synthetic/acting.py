"""Synthetic acting: what the eight emotions do to a voice, by rule, applied to any speech.

Directions after the reviews of acoustic correlates: Juslin & Laukka 2003 (Psychological Bulletin 129) and Scherer 2003 (Speech
Communication 40) for happiness, anger, sadness and fear; Banse & Scherer 1996 (J. Pers. Soc. Psychol. 70) for contempt and
disgust; Murray & Arnott 1993 (J. Acoust. Soc. Am. 93) for disgust and surprise. **All sizes are ours.** It is **synthetic**:
nobody felt anything, and a network that learns from it learns these rules.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from ...audio.features.mel import FPS, RATE
from ...audio.features.prosody import Features, analyse, find_pauses
from ...audio.speech import Speech
from ...rules import EMOTIONS
from .psola import Delivery, deliver

__all__ = ["ACTING", "Acting", "Actor", "act"]

Array = NDArray[np.float64]

LEVEL = -26.0  # dB of full scale, RMS of a neutral voice while it speaks; ours: an angry one still has room above
_SHELF = 1000.0  # Hz; Juslin & Laukka: high-frequency energy is that above 500 or 1000 Hz
_TREMOR = 5.5  # Hz; ours, among the 4 to 8 of a trembling voice
_LOUDNESS = 0.15  # seconds; ours: over which loudness is smoothed before its range is changed
_SWING = 9.0  # dB; ours: the most by which the range of loudness lifts or lowers a sound
_OCTAVES = 0.8  # of pitch, from the median; ours: what lies beyond is an octave error and shall not grow
_PEAK = 0.98  # of full scale


@dataclass(frozen=True)
class Acting:
    """What is done to a neutral voice: factors (1 = unchanged) and offsets (0 = unchanged)."""

    rate: float = 1.0
    """Of speaking."""
    pauses: float = 1.0
    """Length of pauses."""
    span: float = 1.0
    """Range of pitch, about its median."""
    dynamics: float = 1.0
    """Range of loudness, in dB, about its mean."""
    pitch: float = 0.0
    """Semitones: level of pitch."""
    rise: float = 0.0
    """Semitones from the beginning of a phrase to its end."""
    gain: float = 0.0
    """dB: level of loudness."""
    tilt: float = 0.0
    """dB above 1 kHz."""
    jitter: float = 0.0
    """Standard deviation of a period, as a share of it."""
    tremor: float = 0.0
    """Semitones up and down, 5.5 times a second."""


_FACTORS = ("rate", "pauses", "span", "dynamics")

ACTING: Mapping[str, Acting] = MappingProxyType(
    {
        "neutral": Acting(),
        # fast, high, wide, rather loud and bright, few pauses, rising
        "happiness": Acting(1.14, 0.75, 1.5, 1.15, 2.5, rise=1.0, gain=3.0, tilt=3.0),
        # fast, loud, very bright, wide, hard onsets and much change of loudness, falling
        "anger": Acting(1.18, 0.6, 1.35, 1.4, 1.5, rise=-1.5, gain=6.0, tilt=7.0, jitter=0.012),
        # slow, low, narrow, soft, dull, long pauses, falling
        "sadness": Acting(0.78, 1.8, 0.5, 0.8, -1.5, rise=-1.5, gain=-6.0, tilt=-7.0, jitter=0.012),
        # slow, low, rather narrow and soft, falling
        "contempt": Acting(0.9, 1.3, 0.7, 0.9, -2.5, rise=-3.0, gain=-2.0, tilt=1.0),
        # very high and wide, strongly rising
        "surprise": Acting(1.04, 1.0, 1.8, 1.1, 4.5, rise=4.0, gain=2.0, tilt=1.0),
        # fast, high, narrow, soft, dull, uneven, trembling
        "fear": Acting(1.22, 1.0, 0.65, 1.25, 4.0, rise=1.5, gain=-3.0, tilt=-4.0, jitter=0.015, tremor=0.6),
        # very slow, very low, rather wide, grumbled
        "disgust": Acting(0.8, 1.3, 1.15, 1.0, -3.5, rise=-1.0, gain=-3.0, tilt=3.0, jitter=0.035),
    }
)
"""Emotion → what is done."""

_HABIT = Acting(0.05, 0.1, 0.08, 0.04, 0.5, 0.3, 1.0, 1.0)
"""Standard deviations from take to take, whatever the emotion (of logarithms where factors): no two takes are alike; ours."""
_STRENGTH = (0.8, 1.25)  # of a speaker's acting of an emotion; ours
_PART = (0.6, 1.4)  # of each of its parts: one speaker shows anger by loudness, another by tempo; ours
_TAKE = (0.85, 1.15)  # of a take; ours


class Actor:
    """A speaker of a synthetic corpus: each acts each emotion a little differently, and no two takes alike.

    Args:
        seed: of the corpus.
        who: number of the speaker.
    """

    def __init__(self, seed: int, who: int) -> None:
        rng = np.random.default_rng([seed, who, 11])
        strength = rng.uniform(*_STRENGTH, len(EMOTIONS))
        parts = rng.uniform(*_PART, (len(EMOTIONS), len(fields(Acting))))
        self._strengths = dict(zip(EMOTIONS, strength[:, None] * parts, strict=True))

    def acting(self, emotion: str, seed: int) -> Acting:
        """What this speaker does to show an emotion in a take."""
        rng = np.random.default_rng([seed, 12])
        strengths = self._strengths[emotion] * rng.uniform(*_TAKE)
        values = {}
        for part, strength in zip(fields(Acting), strengths.tolist(), strict=True):
            value, habit = getattr(ACTING[emotion], part.name), getattr(_HABIT, part.name) * float(rng.normal())
            values[part.name] = value**strength * np.exp(habit) if part.name in _FACTORS else value * strength + habit
        return Acting(**values)


def act(speech: Speech, acting: Acting, seed: int) -> Speech:
    """Act speech at 16 kHz; its words get their new times.

    Args:
        speech: as it is.
        acting: what is done.
        seed: draws the phase of the tremor and the jitter.
    """
    if not len(speech):
        return speech
    rng = np.random.default_rng([seed, 13])
    features = analyse(speech)
    pauses = [span for span in find_pauses(features.energy) if span[1] > span[0]]
    delivery = _delivery(features, pauses, acting, float(rng.uniform()))
    samples = _bright(deliver(speech.samples, delivery, rng), acting.tilt)
    samples = _loud(samples, delivery, features, pauses, acting)
    words = None
    if speech.words is not None:
        times = delivery.time_of(np.array([(w.start, w.end) for w in speech.words]).reshape(-1, 2) - speech.start)
        words = tuple(replace(w, start=float(a), end=float(b)) for w, (a, b) in zip(speech.words, times, strict=True))
    return replace(speech, samples=samples, words=words, seconds=None, start=0.0, duration=Fraction(len(samples), RATE))


def _silent(features: Features, pauses: list[tuple[float, float]]) -> NDArray[np.bool_]:
    """(T,) whether a hundredth lies in a pause."""
    mask = np.zeros(len(features.energy), bool)
    for start, end in pauses:
        mask[round(start * FPS) : round(end * FPS)] = True
    return mask


def _delivery(features: Features, pauses: list[tuple[float, float]], acting: Acting, phase: float) -> Delivery:
    pitch = np.where(features.voicing > 0, features.pitch, 0.0).astype(np.float64)  # type: ignore[redundant-cast]
    voiced, silent = pitch > 0, _silent(features, pauses)
    octaves = np.log2(np.where(voiced, pitch, 1.0))
    middle = float(np.median(octaves[voiced])) if voiced.any() else 0.0
    away = np.clip(octaves - middle, -_OCTAVES, _OCTAVES)
    semitones = acting.pitch + acting.rise * (_within_phrase(silent) - 0.5)
    semitones = semitones + acting.tremor * np.sin(2 * np.pi * (_TREMOR * np.arange(len(pitch)) / FPS + phase))
    target = np.where(voiced, 2 ** (middle + acting.span * away + semitones / 12), 0.0)
    longer = np.where(silent, acting.pauses, 1.0) / acting.rate
    return Delivery(pitch, target, longer, max(acting.jitter, 0.0))


def _within_phrase(silent: NDArray[np.bool_]) -> Array:
    """(T,) 0 at the beginning of a stretch between pauses, 1 at its end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], silent, [True]]).astype(np.int8)))
    along = np.zeros(len(silent))
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        along[first:last] = np.linspace(0.0, 1.0, last - first)
    return along


def _bright(samples: NDArray[np.float32], decibels: float) -> NDArray[np.float32]:
    """A shelf: so many dB above 1 kHz, none far below, half of it (in gain) at 1 kHz; without shift in time."""
    size = 1 << int(len(samples) + RATE // 10).bit_length()  # room for the filter to ring out, not round
    frequency = np.fft.rfftfreq(size, 1 / RATE)
    share = frequency**2 / (frequency**2 + _SHELF**2)
    gain = 1 + (10 ** (decibels / 20) - 1) * share
    return np.fft.irfft(np.fft.rfft(samples, size) * gain, size)[: len(samples)].astype(np.float32)


def _loud(
    samples: NDArray[np.float32], delivery: Delivery, features: Features, pauses: list[tuple[float, float]], acting: Acting
) -> NDArray[np.float32]:
    """At the level and with the range of loudness that are wanted."""
    is_speech = ~_silent(features, pauses)
    if not is_speech.any():
        return samples
    width = round(_LOUDNESS * FPS)
    smooth = np.convolve(np.pad(features.energy, width // 2, mode="edge"), np.full(width, 1 / width), "same")
    smooth = smooth[width // 2 :][: len(is_speech)]
    swing = np.clip((acting.dynamics - 1) * (smooth - smooth[is_speech].mean()), -_SWING, _SWING)
    hundredths = (np.arange(len(swing)) + 0.5) / FPS
    now = np.arange(len(samples)) / RATE
    at = delivery.time_of(hundredths.astype(np.float64))
    out = samples * 10 ** (np.interp(now, at, swing) / 20)
    voice = out[np.interp(now, at, is_speech) > 0.5]
    level = 10 * np.log10(np.mean(np.square(voice)) + 1e-12) if len(voice) else -np.inf
    if not level > LEVEL - 60:  # nothing but noise
        return samples
    out = out * 10 ** ((LEVEL + acting.gain - level) / 20)
    return (out * min(1.0, _PEAK / np.abs(out).max())).astype(np.float32)
