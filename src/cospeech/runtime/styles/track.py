"""The style of every frame of a session: what the network is given for it, and how its poses become the speaker's.

`StyleTrack` fades from the first style to later ones. `SpokenStyleTrack` is for a network whose style is two distributions:
over the speakers, by the style that the user chose and, for the share that it leaves open, by the voice; and over the
emotions, as given, else neutral.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...audio.emotions import EMOTIONS, Moods
from ...motion.rotations import Array
from ...motion.weighted_sum import add_weighted_rows
from ..crossfade import Crossfade
from ..pose_resampler import MOST_LAG
from ..speaker_emotion_tracker import SpeakerEmotionTracker
from ..system import System
from .embedding import StyleEmbedding, StyleMixture
from .space import StyleSpace

__all__ = ["SpokenStyleTrack", "StyleTrack"]

MEMORY = 10.0  # s; ours: of the voice's course, more than the face lags behind


class StyleTrack:
    """A style that may change, faded in.

    Takes of a network that is given no noise, and whose style is a code of its own, differ by a constant offset of the code, of
    some standard deviations of the speakers' codes.

    Args:
        system: the bundle, opened.
        space: its styles.
        mixture: the style to begin with.
        seeds: of the takes.
        live: whether the network of frames plays.
        temperature: scale of this offset.
    """

    moods: Moods | None = None
    speaker: dict[str, float] | None = None
    emotion: dict[str, float] | None = None
    """It hears none of them."""

    def __init__(
        self, system: System, space: StyleSpace, mixture: StyleMixture, seeds: Sequence[int], *, live: bool = False,
        temperature: float = 1.0,
    ) -> None:  # fmt: skip
        self._space, self._live = space, live
        self._beside = (np.float32(temperature) * _beside(system, seeds))[:, None]
        self._styles = Crossfade(space.mix(mixture), system.fps)
        self.by_frame = system.style_space != "code"
        """Whether the style may be another at every frame of a window; a code is one for a window."""

    def hear(self, rows: Array) -> None:
        """Take the next rows of speech (n, A); this style does not depend on them."""

    def codes(self, frames: Array) -> Array:
        """(N or 1, n or 1, C) what the network is given at these frames."""
        return self._styles.mix(lambda style: style.code + self._beside, frames)

    def scales(self, at: Array) -> tuple[Array, Array, Array]:
        """Mean pose of the style, that of what the network makes in it, and the factor on the difference: (n or 1, D) each, at
        these frames, which may be fractions."""
        return (
            self._styles.mix(lambda style: style.speaker_mean[None, None], at),
            self._styles.mix(lambda style: _calibration(style, self._live)[0][None, None], at),
            self._styles.mix(lambda style: _calibration(style, self._live)[1][None, None], at),
        )

    def restyle(self, mixture: StyleMixture, frame: int) -> None:
        """Another style from this frame on."""
        self._styles.change(self._space.mix(mixture), frame)

    def set_emotion(self, moods: Moods | None, time: float) -> None:
        """Such a network knows no emotions."""

    def forget(self, before: int) -> None:
        """Drop what only frames before this one need."""
        self._styles.forget(before - MOST_LAG)


class SpokenStyleTrack:
    """Weights of speakers and emotions that follow the voice; see `StyleTrack`.

    Args:
        system: the bundle, opened.
        space: its styles.
        mixture: the style to begin with; shares of no speaker are the voice's.
        tracker: hears who speaks and how.
        live: whether the network of frames plays.
    """

    by_frame = True

    def __init__(
        self, system: System, space: StyleSpace, mixture: StyleMixture, tracker: SpeakerEmotionTracker, *, live: bool = False
    ) -> None:
        self._system, self._space, self._tracker = system, space, tracker
        s = system.statistics
        calibration = (s.live_model_mean, s.live_style_gain) if live else (s.model_mean, s.style_gain)
        self._tables = np.concatenate([s.speaker_mean, *calibration], 1)
        self._mixture = Crossfade(space.mix(mixture).code[None, None], system.fps)
        self._strength = np.array([system.emotion_strength.get(name, 1.0) for name in EMOTIONS])

    @property
    def moods(self) -> Moods | None:
        """The emotions that are played; None without a classifier and without given emotions."""
        return self._tracker if self._tracker.knows else None

    @property
    def emotion(self) -> dict[str, float] | None:
        """Probability of each emotion over all that was heard."""
        if not self._tracker.hears:
            return None
        return {name: float(p) for name, p in zip(EMOTIONS, self._tracker.emotion, strict=True)}

    @property
    def speaker(self) -> dict[str, float] | None:
        """Probability of each speaker over all that was heard."""
        if not self._tracker.judges:
            return None
        return {name: float(p) for name, p in zip(self._system.speakers, self._tracker.speaker, strict=True)}

    def hear(self, rows: Array) -> None:
        """Take the next rows of speech (n, A)."""
        self._tracker.push(rows)

    def codes(self, frames: Array) -> Array:
        """See `StyleTrack`."""
        weights, first = self._weights(np.maximum(frames, 0)), len(self._system.speakers)
        emotions = weights[:, first:] * self._strength
        emotions[:, EMOTIONS.index("neutral")] += weights[:, first:].sum(1) - emotions.sum(1)
        return np.concatenate([weights[:, :first], emotions], 1)[None]

    def scales(self, at: Array) -> tuple[Array, Array, Array]:
        """See `StyleTrack`."""
        shares = self._weights(at)[:, : len(self._system.speakers)]
        mean, model_mean, gain = np.split(add_weighted_rows(shares, self._tables).astype(np.float32), 3, axis=1)
        return mean, model_mean, gain

    def restyle(self, mixture: StyleMixture, frame: int) -> None:
        """See `StyleTrack`."""
        self._mixture.change(self._space.mix(mixture).code[None, None], frame)

    def set_emotion(self, moods: Moods | None, time: float) -> None:
        """Other emotions from ``time`` seconds on."""
        self._tracker.set_emotion(moods, time)

    def forget(self, before: int) -> None:
        """See `StyleTrack`."""
        self._mixture.forget(before - MOST_LAG)
        self._tracker.forget(before - round(MEMORY * self._system.fps))

    def _weights(self, frames: Array) -> Array:
        """(n, S + 8) of these frames."""
        speakers, voice = len(self._system.speakers), self._tracker.shares(frames)
        mixture = np.broadcast_to(self._mixture.mix(lambda shares: shares, frames)[0], (len(frames), speakers))
        rest = np.maximum(1 - mixture.sum(1, keepdims=True), 0)
        return np.concatenate([mixture + rest * voice[:, :speakers], voice[:, speakers:]], 1)


def _calibration(style: StyleEmbedding, live: bool) -> tuple[Array, Array]:
    """Mean of what a network makes in a style, and by what it is multiplied."""
    mean, gain = (style.live_model_mean, style.live_style_gain) if live else (style.model_mean, style.style_gain)
    assert mean is not None
    assert gain is not None
    return mean, gain


def _beside(system: System, seeds: Sequence[int]) -> Array:
    """(N, C) offsets of the takes' codes from that of a style."""
    codes = system.statistics.style_codes
    if system.style_space != "code" or system.draws or system.main_network.signature.width("noise"):
        return np.zeros((len(seeds), codes.shape[1]), np.float32)
    offsets = [np.random.default_rng([seed, 4]).standard_normal(codes.shape[1]) * codes.std(0) for seed in seeds]
    return np.array(offsets, np.float32).reshape(len(seeds), codes.shape[1])
