"""Moments at which a listener may nod: where the voice of somebody who speaks has been low for a while, and pauses.

The rule of the low voice is that of Ward and Tsukahara 2000 (Journal of Pragmatics 32), measured on conversations in English
and Japanese. Pauses follow Duncan 1972 and Koiso et al. 1998: most responses of a listener come at the end of a phrase.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np

from ..motion.rotations import Array
from .event_detection import EventDetector
from .prosodic_events import RATE, Phrase

__all__ = ["BackchannelCue", "CueDetector"]

_LEAST_SPEECH = 0.7  # s of speech before a cue (Ward & Tsukahara 2000: 700 ms); for pauses the same [ours]
_LOW = 0.26  # quantile of the pitch of this voice below which it is low (there: the 26th percentile)
_LASTS = 11  # rows of 10 ms for which it is low (there: 110 ms)
_SURE = 200  # voiced rows that must have been heard before a quantile is believed [ours: 2 s]
_PAUSE = 0.295  # s after the end of a phrase after which `EventDetector` is sure of it: 29 rows
_SPEAKS = 0.40  # loudness of somebody who speaks, as for phrases in `EventDetector`
_VOICING = 0.5  # voicing from which a pitch is believed, as there
_PIECE = 16_000  # samples that the detector gets at once; it keeps some seconds [ours: 1 s]
_BINS = np.arange(-12.0, 14.01, 0.25)  # semitones about the median; `Heard.tone` has no others


class BackchannelCue(NamedTuple):
    """A moment at which a listener may respond."""

    time: float
    """Seconds: the end of the phrase; or when the voice had been low for 110 ms."""
    kind: Literal["pause", "low"]


class CueDetector:
    """Finds cues in speech that comes in pieces; they do not depend on the size of the pieces.

    Attributes:
        phrases: all that were heard, in order; the last may still be going on.
    """

    def __init__(self) -> None:
        self.phrases: list[Phrase] = []
        self._detector = EventDetector()
        self._row = 0  # the next one to look at
        self._counts = np.zeros(len(_BINS) + 1)
        self._voiced, self._run = 0, 0
        self._last_end = -1.0  # end of the last phrase that gave a cue

    def push(self, samples: Array) -> list[BackchannelCue]:
        """Take the next samples, at 16 kHz, and give the new cues."""
        cues = list[BackchannelCue]()
        for at in range(0, len(samples), _PIECE):
            self._detector.push(samples[at : at + _PIECE])
            cues += self._look()
        return cues

    def finish(self) -> list[BackchannelCue]:
        """End the sound, and give the last cues."""
        self._detector.finish()
        return self._look()

    def forget(self) -> None:
        """Drop the phrases before the last one; nobody needs them any more."""
        del self.phrases[:-1]

    def _look(self) -> list[BackchannelCue]:
        recent = list(self._detector.phrases)
        while recent and self.phrases and self.phrases[-1].start >= recent[0].start:
            self.phrases.pop()  # its end may have changed
        self.phrases += recent
        return sorted([*self._find_low(), *self._find_ends(recent)])

    def _find_low(self) -> Iterator[BackchannelCue]:
        """Find cues in the new rows: the voice has been low for long enough, in a phrase that is long enough."""
        end = round(self._detector.certain_until * RATE)
        if end <= self._row:
            return
        window = self._detector.window((self._row + 0.5) / RATE, (end - 0.5) / RATE)
        first = self._row - window.start
        tones, voicing, loudness = (
            rows[first : first + end - self._row] for rows in (window.tone, window.voicing, window.loudness)
        )
        voiced = (voicing > _VOICING) & (loudness > _SPEAKS)
        places = np.searchsorted(_BINS, tones, "right")
        for k, (is_voiced, place) in enumerate(zip(voiced.tolist(), places.tolist(), strict=True)):
            row = self._row + k
            low = is_voiced and self._voiced >= _SURE and self._counts[: place + 1].sum() < _LOW * self._voiced
            self._run = self._run + 1 if low else 0
            if self._run == _LASTS and row / RATE - self._begin(row / RATE) >= _LEAST_SPEECH:
                yield BackchannelCue(row / RATE, "low")
            if is_voiced:
                self._counts[place] += 1
                self._voiced += 1
        self._row = end

    def _begin(self, now: float) -> float:
        """When the phrase at this moment began."""
        return max((phrase.start for phrase in self._detector.phrases if phrase.start <= now), default=now)

    def _find_ends(self, recent: list[Phrase]) -> Iterator[BackchannelCue]:
        """Find cues at the ends of phrases, where the end is sure."""
        limit = np.inf if self._detector.finished else self._detector.certain_until
        for phrase in recent:
            if phrase.end > self._last_end and phrase.end + _PAUSE < limit:
                self._last_end = phrase.end
                if phrase.end - phrase.start >= _LEAST_SPEECH:
                    yield BackchannelCue(phrase.end, "pause")
