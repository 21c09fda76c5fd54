"""The emotion of a performance: the one that is given; or, of the voice, its arousal, and a guess that is only reported.

The guess at the eight emotions follows pitch, effort, rate and dynamics by rule. It does not name acted emotions reliably (on
one actress's anger, joy and sadness, neutral stays the likeliest), it cannot hear irony, and it reads no words. So it is never
played: what a voice alone tells surely is arousal (`Arousal`). Numbers are ours, set on that actress and on neutral readers.
"""

from __future__ import annotations

import numpy as np

from ..audio.emotions import EMOTIONS, EmotionTrack, Moods, SteeredMoods
from ..audio.event_detection import quantile
from ..audio.prosodic_events import RATE, Accent, Heard
from ..motion.rotations import Array
from .arousal import WINDOW, Arousal

__all__ = ["SPAN", "Mood", "voice_cues"]

SPAN = 6.0  # seconds of speech that a guess rests on
_DOUBT = 0.08  # a guess below this is none (ours)
_INERTIA = 0.85  # per look, twice a second: moods change over some three seconds


def voice_cues(heard: Heard, accents: list[Accent]) -> Array | None:
    """(4,) cues of a stretch of speech, each roughly unit normal over neutral readers; None when nearly nothing is said.

    Pitch movement (SD of semitones), effort (high against low bands), accents per second of speech, dynamics.
    """
    voiced = heard.voicing > 0.5
    spoken = heard.loudness > 0.4
    if voiced.sum() < 0.6 * RATE or spoken.sum() < RATE:
        return None
    tone = heard.tone[voiced]
    low, high = heard.bands[spoken][:, 1].mean(), heard.bands[spoken][:, 3].mean()
    duration = spoken.sum() / RATE
    first, last = heard.start / RATE, (heard.start + len(heard.loudness)) / RATE
    rate = sum(first <= a.time < last for a in accents) / duration
    ordered = np.sort(tone)
    spread = quantile(ordered, 0.9) - quantile(ordered, 0.1)
    cues = np.array([spread, high - low, rate, heard.loudness[spoken].std()])
    return (cues - _USUAL) / _VARIES


_USUAL = np.array([10.0, -14.5, 3.6, 0.155])  # semitones, dB, per second, loudness: means over neutral readers (ours)
_VARIES = np.array([3.0, 4.0, 0.7, 0.025])
_WEIGHTS = np.array(  # rows: emotions; columns: bias, pitch movement, effort, accent rate, dynamics
    [
        [1.6, 0.0, 0.0, 0.0, 0.0],  # neutral
        [-0.3, 1.1, 0.2, 0.3, 0.1],  # happiness
        [-0.4, 0.1, 0.6, 0.5, 0.4],  # anger
        [-1.8, -0.6, -0.4, -0.9, -0.4],  # sadness: flat *and* slow *and* soft; synthetic voices are flat without being sad
        [-2.0, -0.6, 0.0, -0.3, 0.0],  # contempt
        [-1.6, 1.0, 0.3, 0.1, 0.2],  # surprise
        [-1.8, 0.2, 0.3, 0.6, 0.2],  # fear
        [-2.2, -0.3, 0.2, -0.2, 0.2],  # disgust
    ]
)


_FOLLOWED, _IGNORED = EmotionTrack.constant("neutral"), EmotionTrack.constant("happiness")
"""What `Mood` plays while it follows the voice; and any other, for the share of the voice."""


class Mood:
    """What is felt, followed over a stream.

    Args:
        track: the course to keep to, or None to follow the voice: then *neutral* is felt, with the voice's arousal.
    """

    def __init__(self, track: Moods | None = None) -> None:
        self.track = track
        self.probabilities = (track or EmotionTrack.constant("neutral")).at(np.zeros(()))
        """(8,) what is felt now."""
        self.arousal = Arousal()
        self._guess = self.probabilities
        self._heard, self._felt = np.zeros(len(EMOTIONS)), np.zeros(len(EMOTIONS))
        self._ticks = 0
        self._voice: SteeredMoods | None = None  # once the mood was changed: neutral where the voice is followed

    def change(self, track: Moods | None, time: float) -> None:
        """Another track, or None for the voice, from ``time`` seconds on, for which nothing was decided yet.

        The old emotion fades out while the new one fades in, and so does the arousal of the voice.
        """
        if self._voice is None:
            self._voice = SteeredMoods(_FOLLOWED if self.track is None else _IGNORED)
            if self.track is not None:
                self.arousal.begin(time)
            self.track = SteeredMoods(self.track or _FOLLOWED)
        assert isinstance(self.track, SteeredMoods)
        self.track.change(track or _FOLLOWED, time)
        self._voice.change(_FOLLOWED if track is None else _IGNORED, time)

    @property
    def listens(self) -> bool:
        """Whether the arousal of the voice is followed: always, where it may be played again after a change."""
        return self.track is None or self._voice is not None

    def voice_share(self, times: Array) -> Array:
        """(…,) how far the arousal of the voice is played at ``times`` (…) in seconds, 0 … 1."""
        if self._voice is None:
            return np.full(np.shape(times), float(self.track is None))
        return self._voice.at(times)[..., 0]  # type: ignore[no-any-return]

    def keep(self, time: float) -> None:
        """What the track says of this time in seconds."""
        assert self.track is not None
        self._guess = self.probabilities = self.track.at(np.array(time))
        self._count()

    def follow(self, heard: Heard, accents: list[Accent]) -> None:
        """Take one look at the last `SPAN` seconds of speech."""
        cues = voice_cues(heard, accents)
        if cues is not None:
            logits = _WEIGHTS @ np.concatenate([[1.0], np.clip(cues, -2.5, 2.5)])
            guess = np.exp(logits - logits.max())
            guess = np.maximum(guess / guess.sum() - _DOUBT, 0.0)
            guess[0] += 1.0 - guess.sum()
            self._guess = _INERTIA * self._guess + (1 - _INERTIA) * guess
        self.listen(heard, accents)
        self._count()

    def listen(self, heard: Heard, accents: list[Accent]) -> None:
        """The part of `follow` that is arousal."""
        self.arousal.follow(heard.last(WINDOW), accents)

    def _count(self) -> None:
        self._heard = self._heard + self._guess
        self._felt = self._felt + self.probabilities
        self._ticks += 1

    @property
    def guess(self) -> dict[str, float]:
        """Mean probabilities that the voice suggests, by name; of a track those of the track."""
        return self._mean(self._heard, self._guess)

    @property
    def expression(self) -> dict[str, float]:
        """Mean weights of what is played, by name."""
        return self._mean(self._felt, self.probabilities)

    def _mean(self, total: Array, now: Array) -> dict[str, float]:
        share = total / self._ticks if self._ticks else now
        return {name: float(p) for name, p in zip(EMOTIONS, share, strict=True)}
