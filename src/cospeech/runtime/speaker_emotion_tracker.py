"""Who speaks, and in which mood: what a classifier hears in a voice, followed over a speech that comes in pieces.

The mood that is heard is reported and never played: one person's neutral voice sounds like another's contempt, and the logits
do not show the difference (docs/emotion_from_speech.md). The emotion that is given is played, or neutral.

A frame's logits are averaged with those before: of the speaker over all that was heard, of the emotion over the last seconds
(`SPAN`); silence does not count. Frames are judged in blocks, and a frame has the result of some frames before it
(`SpeakerEmotionTracker.lag`): everything follows from a frame's index alone.
"""

from __future__ import annotations

import numpy as np

from ..audio.emotions import EMOTIONS, EmotionTrack, Moods, SteeredMoods
from ..motion.curves import clip
from ..motion.rotations import Array
from ..rules.mood import SPAN
from .network import Network

__all__ = ["SpeakerEmotionTracker"]

DOUBT = 1.0  # s; ours: weight of the prior, before anything is heard: any speaker in any mood
VOICE = 0.5  # ours: how far, in deviations of the training data, a row is from silence that counts as voice
BLOCK = 4  # ours: frames that are judged in one call, always the same ones; a mood over seconds can wait for them


_NEUTRAL = np.array([float(name == "neutral") for name in EMOTIONS])


class SpeakerEmotionTracker:
    """The course of speakers' and emotions' probabilities.

    Args:
        classifier: speech → logits of speakers and emotions; None: speaker and emotion are not known.
        speakers: how many there are.
        fps: of the frames.
        silence: (A,) the row of silence.
        emotions: the emotion, where it is not to be heard.
    """

    def __init__(
        self, classifier: Network | None, speakers: int, fps: float, silence: Array, emotions: Moods | None = None
    ) -> None:
        self._classifier, self._speakers, self._fps, self._emotions = classifier, speakers, fps, emotions
        self._silent_row = np.asarray(silence, np.float32)
        self._reach = 0 if classifier is None else classifier.signature.reach or 0
        self._rows = np.repeat(self._silent_row[None], self._reach, 0)
        width = speakers + len(EMOTIONS)
        self._fade = np.ones(width)
        self._fade[speakers:] = np.exp(-1 / (SPAN * fps))
        self._sum = np.zeros(width)
        self._count = np.full(width, DOUBT * fps)
        self._emotion_sum = np.zeros(len(EMOTIONS))
        before = self._judge((self._sum / self._count)[None])[0]
        self._first, self._course = 0, [before]  # of the frame before the first that is kept, then of those
        self.frames = 0
        """Of which probabilities are known."""

    def push(self, rows: Array) -> None:
        """Hear (n, A) standardised rows."""
        self._rows = np.concatenate([self._rows, rows])
        width = 2 * self._reach + BLOCK
        while len(self._rows) >= width:
            self._classify_block(self._rows[:width])
            self._rows = self._rows[BLOCK:]
        self._rows = self._rows.copy()

    def _classify_block(self, rows: Array) -> None:
        """The frames in the middle of (2 · reach + BLOCK, A) rows."""
        middle = rows[self._reach : self._reach + BLOCK]
        voiced = np.sqrt(np.square(middle - self._silent_row).mean(1)) > VOICE
        logits = None
        if self._classifier is not None and voiced.any():
            logits = self._classifier.run(rows=rows[None])["logits"][0, self._reach : self._reach + BLOCK]
        means = np.empty((BLOCK, len(self._sum)))
        for k, voice in enumerate(voiced.tolist()):
            self._sum, self._count = self._sum * self._fade, self._count * self._fade
            if logits is not None and voice:
                self._sum, self._count = self._sum + logits[k], self._count + 1
            means[k] = self._sum / self._count
        for shares in self._judge(means):
            self._course.append(shares)
            self._emotion_sum += shares[self._speakers :]
        self.frames += BLOCK

    @property
    def lag(self) -> int:
        """Frames by which a frame's result is late, so that it is known once the frame was heard, in pieces of any size."""
        return self._reach + BLOCK

    def shares(self, frames: Array) -> Array:
        """(…, S + 8) weights to play at these frames: speakers as heard, changing linearly between frames; emotions as given.

        Args:
            frames: (…,) whole or not.
        """
        places = np.asarray(frames, float)
        index = clip(places - self.lag, self._first - 1, self.frames - 1)
        low = np.floor(index).astype(int)
        first, last = int(low.min(initial=self.frames - 1)), int(low.max(initial=self._first - 1)) + 1
        course = np.array(self._course[first - self._first + 1 : last - self._first + 2])
        place = low - first
        now, after = course[place], course[np.minimum(place + 1, len(course) - 1)]
        weights: Array = now + (index - low)[..., None] * (after - now)
        moods = weights[..., self._speakers :]
        moods[...] = _NEUTRAL if self._emotions is None else self._emotions.at(places / self._fps)
        return weights

    def at(self, times: Array) -> Array:
        """(…, 8) weights of the emotions that are played at these times in seconds."""
        times = np.asarray(times, float)
        return np.broadcast_to(_NEUTRAL, (*times.shape, 8)) if self._emotions is None else self._emotions.at(times)

    def set_emotion(self, moods: Moods | None, time: float) -> None:
        """Other emotions to play from ``time`` seconds on; None: neutral."""
        neutral = EmotionTrack.constant("neutral")
        if not isinstance(self._emotions, SteeredMoods):
            self._emotions = SteeredMoods(self._emotions or neutral)
        self._emotions.change(moods or neutral, time)

    def forget(self, before: int) -> None:
        """Drop what only frames before this one need."""
        count = min(before - self.lag, self.frames - 1) - self._first
        if count > 0:
            del self._course[:count]
            self._first += count

    @property
    def judges(self) -> bool:
        """Whether there is a classifier."""
        return self._classifier is not None

    @property
    def knows(self) -> bool:
        """Whether emotions are given."""
        return self._emotions is not None

    @property
    def hears(self) -> bool:
        """Whether emotions are heard."""
        return self._emotions is None and self.judges

    @property
    def speaker(self) -> Array:
        """(S,) probabilities, after all that was heard."""
        return self._course[-1][: self._speakers]

    @property
    def emotion(self) -> Array:
        """(8,) mean probabilities over all that was heard."""
        return self._emotion_sum / self.frames if self.frames else self._course[-1][self._speakers :]

    def _judge(self, logits: Array) -> Array:
        """(n, S + 8) two distributions each."""
        return np.concatenate([_softmax(logits[:, : self._speakers]), _softmax(logits[:, self._speakers :])], 1)


def _softmax(logits: Array) -> Array:
    weights = np.exp(logits - logits.max(1, keepdims=True))
    shares: Array = weights / weights.sum(1, keepdims=True)
    return shares
