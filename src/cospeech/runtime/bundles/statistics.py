"""Statistics of a network's training data that its bundle needs, as one record of arrays."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np

from ...errors import InputError
from ...motion.rotations import Array

__all__ = ["Statistics"]

MARGIN = 0.25  # ours: of the range of a number in the training data, beyond either end, that a pose may reach
FARTHEST = 1e6  # ours: no pose, no feature comes near


def _none() -> Array:
    return np.zeros(0, np.float32)


@dataclass(frozen=True)
class Statistics:
    """Numbers that turn vectors of poses and speech into a network's units and back, and numbers of each speaker.

    D are the numbers of a pose, A those of a frame of speech, S the speakers. Poses are standardised, but for ``pose_mean`` and
    ``pose_std``. An array after ``speaker_mean`` may be empty: there is none, or `complete` fills it in. float32.
    """

    pose_mean: Array
    """(D,)"""
    pose_std: Array
    audio_mean: Array
    """(A,)"""
    audio_std: Array
    pose_low: Array
    """(D,) least standardised value in the training data."""
    pose_high: Array
    audio_low: Array
    audio_high: Array
    speaker_mean: Array
    """(S, D) mean pose of each speaker."""
    style_codes: Array = field(default_factory=_none)
    """(S, C) what the network is given for each speaker."""
    model_mean: Array = field(default_factory=_none)
    """(S, D) mean of what the network of windows makes in each speaker's style; the speaker's own takes its place."""
    style_gain: Array = field(default_factory=_none)
    """(S, D) factors on its poses, so that they deviate from their mean as the speaker's do; positive."""
    live_model_mean: Array = field(default_factory=_none)
    """(S, D) and (S, D): the same of the network of frames."""
    live_style_gain: Array = field(default_factory=_none)
    noise_gain: Array = field(default_factory=_none)
    """(2,) factors on the noise when the network of windows plays, and that of frames, so that takes differ."""
    words: Array = field(default_factory=_none)
    """(n, W) rows that stand for subwords (`cospeech.audio.features.words`), or for the words of the vocabulary; the first:
    none."""
    histories: Array = field(default_factory=_none)
    """(S · M, τ, D) stretches of the training data, with which an autoregressive network begins: M of each speaker."""
    speaker_std: Array = field(default_factory=_none)
    """(S, D) standard deviation of each speaker's poses, for a network that knows poses by their recording's own mean and
    standard deviation. With it, ranges and histories are of such poses."""
    free_mean: Array = field(default_factory=_none)
    """(D,) mean of what an autoregressive network makes when nobody corrects it, taken off before ``speaker_std``."""
    free_std: Array = field(default_factory=_none)
    """(D,) its standard deviation."""
    control_quantiles: Array = field(default_factory=_none)
    """(101, K) standardised quantiles 0, 0.01 … 1 of each style control, over the training data."""

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(D,) least and greatest numbers of a pose that is made: those of the training data and some more."""
        margin = MARGIN * (self.pose_high - self.pose_low) + 1e-3
        return self.pose_low - margin, self.pose_high + margin

    def complete(self, one_hot: bool) -> Statistics:
        """The record with defaults for what is not given: a network's poses are taken as they are, and so is noise.

        Args:
            one_hot: whether speakers' weights are the codes.
        """
        mean = self.model_mean if self.model_mean.size else self.speaker_mean
        gain = self.style_gain if self.style_gain.size else np.ones_like(self.speaker_mean)
        defaults = {
            "model_mean": mean, "style_gain": gain, "live_model_mean": mean, "live_style_gain": gain,
            "noise_gain": np.ones(2, np.float32),
        }  # fmt: skip
        speakers = len(self.speaker_mean)
        defaults["style_codes"] = np.eye(speakers, dtype=np.float32) if one_hot else np.zeros((speakers, 0), np.float32)
        return replace(self, **{name: value for name, value in defaults.items() if not getattr(self, name).size})

    def check(self, shapes: dict[str, tuple[int, ...]]) -> None:
        """Check types, shapes and values.

        Args:
            shapes: of the arrays that are not of a pose or of speech.

        Raises:
            InputError: they cannot be used.
        """
        for f in fields(self):
            value, optional = getattr(self, f.name), f.name not in _MANDATORY
            shape = shapes.get(f.name, (0,))
            if value.dtype != np.float32 or (value.shape != shape and not (optional and not value.size)):
                raise InputError(
                    f"statistics {f.name!r} are {value.dtype} of shape {value.shape}", f"expected float32 of shape {shape}"
                )
            if not np.abs(value).max(initial=0) < FARTHEST:  # not a number fails this too
                raise InputError(
                    f"statistics {f.name!r} hold numbers that are not finite or too large", "is the bundle damaged?"
                )
            if f.name.endswith(("_std", "_gain")) and value.size and value.min() <= 0:
                raise InputError(f"statistics {f.name!r} hold numbers that are not positive", "is the bundle damaged?")
        if (self.pose_low > self.pose_high).any() or (self.audio_low > self.audio_high).any():
            raise InputError("statistics have a lower bound above its upper bound", "is the bundle damaged?")
        if self.words.size and self.words[0].any():
            raise InputError("row 0 of the word vectors, which stands for no word, is not zero", "is the bundle damaged?")


_MANDATORY = {f.name for f in fields(Statistics)[:9]}
