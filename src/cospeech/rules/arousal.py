"""Arousal in the voice, followed over a stream, and what it changes in movement.

Arousal is heard reliably, also of new actors and in new languages (docs/emotion_from_speech.md). It makes movement larger and
quicker, and names no emotion. `cospeech.audio.voice_emotion` measures it.
"""

from __future__ import annotations

from array import array
from dataclasses import replace
from math import ceil

import numpy as np

from ..audio.voice_emotion import LOOKS
from ..motion.rotations import Array
from .emotion_modifiers import EmotionModifier

__all__ = ["Arousal", "amplitude", "arouse", "first_look"]

_TRUST = 12  # looks after which a measured arousal counts half [ours: 6 s of speech]
_INERTIA = 0.75  # per look: arousal changes over some two seconds [ours]
_USUALLY, _EXTENT = 0.25, 0.4  # [ours] arousal up to which poses stay; share by which full arousal enlarges learned poses
_AMPLITUDE, _RATE, _TEMPO, _BODY = 0.22, 0.15, 0.15, 0.2  # [ours] share by which full arousal changes an `EmotionModifier`


def first_look(time: float) -> int:
    """The number of the first look at the voice at ``time`` seconds or after; look k is at k · `LOOKS`."""
    return ceil(time / LOOKS - 1e-9)


class Arousal:
    """Follows a voice; `level` is the arousal that is played."""

    def __init__(self) -> None:
        self.level = 0.0
        """−1 … 1; 0: as this voice usually speaks."""
        self._looks = 0
        self._total, self._ticks = 0.0, 0
        self._levels = array("d")  # of the looks, from the first one that may still be asked for
        self._first = 0

    def follow(self, arousal: float | None) -> None:
        """Take the arousal of one more look, twice a second; None: nobody speaks, and arousal fades."""
        goal = 0.0
        if arousal is not None:
            goal = min(max(arousal, -1.0), 1.0) * self._looks / (self._looks + _TRUST)
            self._looks += 1
        self.level = _INERTIA * self.level + (1 - _INERTIA) * goal
        self._levels.append(self.level)
        self._total += self.level
        self._ticks += 1

    def begin(self, time: float) -> None:
        """The first look is at ``time`` seconds or soon after; before anything is followed."""
        self._first = first_look(time)

    @property
    def mean(self) -> float:
        """Over the speech so far."""
        return self._total / self._ticks if self._ticks else 0.0

    def at(self, times: Array) -> Array:
        """(n,) levels at ``times (n,)`` seconds, linear between looks; 0 before the first.

        Times go on from call to call: what was before them is forgotten.
        """
        if not len(times) or not self._levels:
            return np.zeros(len(times))
        self.forget(times[0])
        looks = np.array(self._levels)
        return np.interp(times / LOOKS, self._first + np.arange(len(looks)), looks, left=0.0)

    def forget(self, before: float) -> None:
        """Drop what only times before this one need."""
        over = min(int(before / LOOKS) - self._first, len(self._levels) - 1)
        if over > 0:
            del self._levels[:over]
            self._first += over


def amplitude(level: Array) -> Array:
    """Factor (n,) on the distance of poses from the mean one, at arousal ``level (n,)``; 1 for a voice as it usually is."""
    beyond = np.maximum(np.abs(level) - _USUALLY, 0.0) / (1 - _USUALLY)
    return 1.0 + _EXTENT * np.sign(level) * beyond


def arouse(manner: EmotionModifier, level: float) -> EmotionModifier:
    """A modifier at arousal −1 … 1: movement is larger and quicker above 0, smaller and slower below."""
    return replace(
        manner,
        amplitude=manner.amplitude * (1 + _AMPLITUDE * level),
        rate=manner.rate * (1 + _RATE * level),
        tempo=manner.tempo * (1 + _TEMPO * level),
        torso=manner.torso * (1 + _BODY * level),
        head=manner.head * (1 + _BODY * level),
    )
