"""Who speaks, and in which mood: what a chain's classifier hears in a voice, followed over a speech that comes in pieces.

A frame's logits are averaged with those before: of the speaker over all that was heard, of the emotion over the last seconds
(`SPAN`); silence says nothing. Everything follows from a frame's index alone.
"""

from __future__ import annotations

import numpy as np

from ..emotions import EMOTIONS, EmotionTrack
from ..rotations import Array
from ..rules.mood import SPAN
from .chain_engine import ChainEngine

__all__ = ["Ear"]

DOUBT = 1.0  # s; ours: of evidence that the mood is neutral and the speaker may be anybody, before anything is heard
LEANING = 2.0  # ours: logit of that neutral mood
VOICE = 0.5  # ours: how far, in deviations of the training data, a row is from silence that counts as voice


class Ear:
    """The course of speakers' and emotions' probabilities.

    Args:
        engine: of the bundle.
        fps: of its frames.
        quiet: (A,) what silence sounds like.
        given: the emotion, where it is not to be heard.
    """

    def __init__(self, engine: ChainEngine, fps: float, quiet: Array, given: Moods | None = None) -> None:
        self._engine, self._fps, self._quiet, self._given = engine, fps, np.asarray(quiet, np.float32), given
        speakers, reach = engine.sizes.speakers, engine.sizes.reach
        self._rows = np.repeat(self._quiet[None], reach, 0)
        self._fade = np.ones(engine.sizes.style)
        self._fade[speakers:] = np.exp(-1 / (SPAN * fps))
        self._sum = np.zeros(engine.sizes.style)
        self._sum[speakers + EMOTIONS.index("neutral")] = LEANING * DOUBT * fps
        self._count = np.full(engine.sizes.style, DOUBT * fps)
        self._first, self._course = 0, [self._now()]  # probabilities before the first frame stand for it, too
        self._total, self._heard = np.zeros(engine.sizes.style), 0
        self.frames = 0
        """Of which probabilities are known."""

    def push(self, rows: Array) -> None:
        """Hear (n, A) standardised rows; each makes the frame ``reach`` before it known."""
        self._rows = np.concatenate([self._rows, rows])
        width = 2 * self._engine.sizes.reach + 1
        while len(self._rows) >= width:
            middle = self._rows[width // 2]
            voiced = np.sqrt(np.square(middle - self._quiet).mean()) > VOICE
            self._sum *= self._fade
            self._count *= self._fade
            if voiced and self._engine.judges:
                self._sum += self._engine.classify(self._rows[:width])
                self._count += 1
            self._course.append(self._now())
            self._total += self._course[-1]
            self.frames += 1
            self._rows = self._rows[1:]

    def shares(self, frames: Array) -> Array:
        """(…, S + 8) weights at these frames, between which they change linearly; beyond what is known they stay."""
        wanted = np.asarray(frames, float)
        known = np.clip(wanted, self._first, max(self._first, self.frames - 1))
        low = np.floor(known).astype(int)
        course, place = np.stack(self._course), low - self._first + 1
        now, after = (course[np.minimum(k, len(course) - 1)] for k in (place, place + 1))
        heard = now + (known - low)[..., None] * (after - now)
        if self._given is not None:
            heard[..., self._engine.sizes.speakers :] = self._given.at(wanted / self._fps)
        return heard

    def at(self, times: Array) -> Array:
        """(…, 8) weights of the emotions at these times in seconds."""
        return self.shares(np.asarray(times, float) * self._fps)[..., self._engine.sizes.speakers :]

    def forget(self, before: int) -> None:
        """Frames before this one are asked for no more."""
        gone = min(before, self.frames - 1) - self._first
        if gone > 0:
            del self._course[:gone]
            self._first += gone

    @property
    def knows(self) -> bool:
        """Whether emotions are given, or heard."""
        return self._given is not None or self._engine.judges

    @property
    def speaker(self) -> Array:
        """(S,) probabilities, after all that was heard."""
        return self._course[-1][: self._engine.sizes.speakers]

    def _now(self) -> Array:
        """(S + 8,) two distributions, of what was heard so far."""
        logits, speakers = self._sum / self._count, self._engine.sizes.speakers
        return np.concatenate([_softmax(logits[:speakers]), _softmax(logits[speakers:])])


def _softmax(logits: Array) -> Array:
    weights = np.exp(logits - logits.max())
    scaled: Array = weights / weights.sum()
    return scaled
