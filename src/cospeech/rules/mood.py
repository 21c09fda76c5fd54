"""The emotion of a performance: the given one; or the arousal of the voice, and its emotion category where that is clear.

`cospeech.audio.voice_emotion` hears both. It cannot hear irony, and it reads no words.
"""

from __future__ import annotations

import numpy as np

from ..audio.emotions import EMOTIONS, EmotionTrack, Moods, SteeredMoods
from ..audio.voice_emotion import LOOKS, ConfidentEmotion, VoiceEmotion
from ..motion.curves import clip
from ..motion.rotations import Array
from .arousal import Arousal, first_look

__all__ = ["SPAN", "Mood"]

SPAN = 6.0  # seconds of speech that a classifier's emotion rests on
_MEMORY = 40  # looks: 20 s, of which `SteeredMoods` asks for ten at most [ours]
_NEUTRAL = np.array([float(name == "neutral") for name in EMOTIONS])


class _HeardMoods:
    """The emotions of the voice that were played, look by look; half a second late, so that the look after a time is known."""

    def __init__(self) -> None:
        self.first = 0
        """Number of the look from which the voice is followed."""
        self._looks: list[Array] = []
        self._offset = 0

    def append(self, weights: Array) -> None:
        """(8,) of the next look."""
        self._looks.append(weights)
        if len(self._looks) > 2 * _MEMORY:
            del self._looks[:_MEMORY]
            self._offset += _MEMORY

    def at(self, times: Array) -> Array:
        """(…, 8) weights at these times in seconds; neutral before the first look."""
        times = np.asarray(times, float)
        looks = np.array([_NEUTRAL if not self._offset else self._looks[0], *self._looks])
        place = clip(times / LOOKS - 1 - self.first - self._offset + 1, 0, len(looks) - 1)
        low = np.floor(place).astype(int)
        part = (place - low)[..., None]
        weights: Array = looks[low] + part * (looks[np.minimum(low + 1, len(looks) - 1)] - looks[low])
        return weights


_NO_VOICE, _ALL_VOICE = EmotionTrack.constant("happiness"), EmotionTrack.constant("neutral")
"""Tracks of the voice's share, as weight of neutral: 0 (any other emotion), and 1."""


class Mood:
    """The emotion of a performance over a stream.

    Args:
        track: the emotions over time, or None to follow the voice: its arousal, and its emotion category where that is clear.
    """

    def __init__(self, track: Moods | None = None) -> None:
        self.track = track
        self.probabilities = (track or EmotionTrack.constant("neutral")).at(np.zeros(()))
        """(8,) weights of the emotions now."""
        self.arousal = Arousal()
        self.voice = VoiceEmotion()
        """The listener to the speech pushes its prosody here."""
        self._category, self._course = ConfidentEmotion(), _HeardMoods()
        self._guess = self.probabilities
        self._guess_sum, self._weight_sum = np.zeros(len(EMOTIONS)), np.zeros(len(EMOTIONS))
        self._ticks = 0
        self._voice: SteeredMoods | None = None  # from the first change on: neutral where the voice is followed

    def change(self, track: Moods | None, time: float) -> None:
        """Another track, or None for the voice, from ``time`` seconds on, for which nothing was decided yet.

        The old emotion fades out while the new one fades in, and so does the arousal of the voice.
        """
        if self._voice is None:
            self._voice = SteeredMoods(_ALL_VOICE if self.track is None else _NO_VOICE)
            if self.track is not None:
                self.arousal.begin(time)
                self._course.first = first_look(time)
            self.track = SteeredMoods(self.track or self._course)
        assert isinstance(self.track, SteeredMoods)
        self.track.change(track or self._course, time)
        self._voice.change(_ALL_VOICE if track is None else _NO_VOICE, time)

    @property
    def listens(self) -> bool:
        """Whether the arousal of the voice is followed: without a track, and after a change, when it may be played again."""
        return self.track is None or self._voice is not None

    @property
    def category(self) -> Array:
        """(8,) weights of the emotions that the voice gives where no track is played."""
        return self._category.played

    def voice_share(self, times: Array) -> Array:
        """(…,) how far the arousal of the voice is played at ``times`` (…) in seconds, 0 … 1."""
        if self._voice is None:
            return np.full(np.shape(times), float(self.track is None))
        return self._voice.at(times)[..., 0]  # type: ignore[no-any-return]

    def keep(self, time: float) -> None:
        """Play the emotion of the track at this time in seconds."""
        assert self.track is not None
        self._guess = self.probabilities = self.track.at(np.array(time))
        self._count()

    def follow(self, until: float) -> None:
        """Take one look at the speech before ``until`` seconds, and play its emotion."""
        self.listen(until)
        self._guess, self.probabilities = self._category.probabilities, self._category.played
        self._count()

    def listen(self, until: float) -> None:
        """Take one look, and leave what is played as it is."""
        look = self.voice.look(until)
        self.arousal.follow(None if look is None else look.arousal)
        self._course.append(self._category.follow(look))

    def _count(self) -> None:
        self._guess_sum = self._guess_sum + self._guess
        self._weight_sum = self._weight_sum + self.probabilities
        self._ticks += 1

    @property
    def guess(self) -> dict[str, float]:
        """Mean probabilities that the voice suggests, by name; of a track those of the track."""
        return self._mean(self._guess_sum, self._guess)

    @property
    def expression(self) -> dict[str, float]:
        """Mean weights of what is played, by name."""
        return self._mean(self._weight_sum, self.probabilities)

    def _mean(self, total: Array, now: Array) -> dict[str, float]:
        share = total / self._ticks if self._ticks else now
        return {name: float(p) for name, p in zip(EMOTIONS, share, strict=True)}
