"""Arousal in the voice: how much louder, faster and higher than usual this voice speaks, against its own running baseline.

Arousal is what loudness, pitch and rate tell about a voice; which emotion it is they do not tell (docs/emotion_from_speech.md).
So arousal makes movement larger and quicker, and names nothing.
"""

from __future__ import annotations

from array import array
from dataclasses import replace

import numpy as np

from ..audio.prosodic_events import RATE, Accent, Heard
from ..motion.rotations import Array
from .emotion_modifiers import EmotionModifier

__all__ = ["LOOKS", "WINDOW", "Arousal", "amplitude", "arouse", "loudness_rate_pitch"]

LOOKS = 0.5  # seconds between two looks

WINDOW = 3.0  # seconds of speech that a look rests on [ours: a phrase or two]
_LOUD = 0.4  # `Heard.loudness` that counts as speech, as for phrases
_USUAL = np.array([3.0, 0.8, 1.6])  # SD within one voice of dB, accents per second, semitones [ours: over 24 LJSpeech clips]
_SHARES = np.array([0.45, 0.2, 0.35])  # of the three cues [ours: loudness and pitch are the surest, Banse & Scherer 1996]
_MEMORY = 80  # looks, two a second, over which the baseline runs [ours: 40 s of speech]
_TRUST = 12  # looks until half of what is heard is believed [ours: 6 s of speech]
_INERTIA = 0.75  # per look: arousal changes over some two seconds [ours]
_USUALLY, _EXTENT = 0.25, 0.4  # [ours] arousal that is none yet; share by which full arousal enlarges learned poses
_AMPLITUDE, _RATE, _TEMPO, _BODY = 0.22, 0.15, 0.15, 0.2  # [ours] share by which full arousal changes an `EmotionModifier`


def loudness_rate_pitch(heard: Heard, accents: list[Accent]) -> Array | None:
    """(3,) of a stretch of speech: dB of the voice, accents per second, semitones; None where nearly nothing is said."""
    voiced, spoken = heard.voicing > 0.5, heard.loudness > _LOUD
    if voiced.sum() < 0.3 * RATE or spoken.sum() < 0.5 * RATE:
        return None
    first, last = heard.start / RATE, (heard.start + len(heard.loudness)) / RATE
    rate = sum(first <= a.time < last for a in accents) / (spoken.sum() / RATE)
    return np.array([heard.bands[spoken][:, 1:4].mean(), rate, heard.tone[voiced].mean()])


class Arousal:
    """Follows a voice; `level` is what is played."""

    def __init__(self) -> None:
        self.level = 0.0
        """−1 … 1; 0: as this voice usually speaks."""
        self._mean = np.zeros(3)
        self._looks = 0
        self._total, self._ticks = 0.0, 0
        self._levels = array("d")  # of the looks from the first on that somebody may still ask for
        self._first = 0

    def follow(self, heard: Heard, accents: list[Accent]) -> None:
        """Take one look at the last seconds of speech, twice a second; where nothing is said, arousal fades."""
        cues = loudness_rate_pitch(heard, accents)
        goal = 0.0
        if cues is not None:
            away = np.clip((cues - self._mean) / _USUAL, -3.0, 3.0) @ _SHARES if self._looks else 0.0
            goal = float(np.tanh(0.8 * away)) * self._looks / (self._looks + _TRUST)
            self._looks += 1
            self._mean += (cues - self._mean) / min(self._looks, _MEMORY)
        self.level = _INERTIA * self.level + (1 - _INERTIA) * goal
        self._levels.append(self.level)
        self._total += self.level
        self._ticks += 1

    def begin(self, time: float) -> None:
        """The first look is at ``time`` seconds; before anything is followed."""
        self._first = round(time / LOOKS)

    @property
    def mean(self) -> float:
        """Over all that was heard."""
        return self._total / self._ticks if self._ticks else 0.0

    def at(self, times: Array) -> Array:
        """(n,) levels at ``times (n,)`` seconds of the looks, straight from one look to the next; 0 before the first.

        Times go on from call to call: what was before them is forgotten.
        """
        if not len(times) or not self._levels:
            return np.zeros(len(times))
        self.forget(times[0])
        looks = np.array(self._levels)
        return np.interp(times / LOOKS, self._first + np.arange(len(looks)), looks, left=0.0)

    def forget(self, before: float) -> None:
        """Nobody will ask for a time before this one."""
        over = min(int(before / LOOKS) - self._first, len(self._levels) - 1)
        if over > 0:
            del self._levels[:over]
            self._first += over


def amplitude(level: Array) -> Array:
    """Factor (n,) on the way of poses from the mean one, at arousal ``level (n,)``; 1 for a voice as it usually is."""
    beyond = np.maximum(np.abs(level) - _USUALLY, 0.0) / (1 - _USUALLY)
    return 1.0 + _EXTENT * np.sign(level) * beyond


def arouse(manner: EmotionModifier, level: float) -> EmotionModifier:
    """A way to move, larger and quicker with arousal −1 … 1, smaller and slower without."""
    return replace(
        manner,
        amplitude=manner.amplitude * (1 + _AMPLITUDE * level),
        rate=manner.rate * (1 + _RATE * level),
        tempo=manner.tempo * (1 + _TEMPO * level),
        torso=manner.torso * (1 + _BODY * level),
        head=manner.head * (1 + _BODY * level),
    )
