"""Prosody of the speech so far on a 100 Hz grid, normalised to the speaker's own running level, and its events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..motion.curves import clip
from ..motion.rotations import Array

__all__ = ["RATE", "Accent", "Heard", "Phrase"]

RATE = 100.0  # frames per second of every array in `Heard`; the hop of `cospeech.audio.features.prosody`


class Accent(NamedTuple):
    """A prosodic accent: a peak of the energy envelope, weighted by loudness and pitch."""

    time: float
    """Seconds, of the energy peak."""
    strength: float
    """0 (just noticeable) … 1 (the strongest that this speaker makes)."""


class Phrase(NamedTuple):
    """A stretch of speech between two pauses, in seconds."""

    start: float
    end: float


@dataclass(frozen=True)
class Heard:
    """A window of heard speech.

    Args:
        start: index of the first row: row k is at ``(start + k) / RATE`` seconds.
        loudness: (T,) 0 in pauses … 1 at this speaker's loud syllables (may pass 1 a little).
        tone: (T,) semitones above this speaker's running median pitch; 0 where unvoiced.
        voicing: (T,) 0 … 1.
        onset: (T,) onset strength as `features.prosody` gives it.
        bands: (T, 5) log energies of the five bands of `features.prosody`.
    """

    start: int
    loudness: Array
    tone: Array
    voicing: Array
    onset: Array
    bands: Array

    def last(self, seconds: float) -> Heard:
        """The end of the window."""
        skip = max(len(self.loudness) - round(seconds * RATE), 0)
        rows = (self.loudness, self.tone, self.voicing, self.onset, self.bands)
        return Heard(self.start + skip, *(array[skip:] for array in rows))

    def at(self, times: Array, values: Array) -> Array:
        """Linear interpolation of one of the arrays, (T,) or (T, C), at ``times`` in seconds; the ends are held."""
        x = clip(np.asarray(times) * RATE - self.start, 0, len(values) - 1)
        low = np.minimum(x.astype(int), len(values) - 1)
        high = np.minimum(low + 1, len(values) - 1)
        part = x - low
        if values.ndim > 1:
            part = part[:, None]
        return values[low] + (values[high] - values[low]) * part
