"""The styles of a system: its speakers by name, examples, and mixtures of them.

A network knows a style as weights of its speakers (`OneHotSpace`), as a code of its own (`CodeSpace`, which is of no width for
a network without styles), and a flow by its code, its beginnings and its moments, too (`FlowSpace`).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ...errors import InputError, say_count
from ...motion.motion import Motion
from ...motion.poses import find_pose
from ...motion.rotations import Array
from ..bundles.spec import VOICE
from ..flow.engine import FlowEngine
from ..system import System
from .embedding import StyleEmbedding, StyleMixture, mix, standardise_example, stretches

__all__ = ["CodeSpace", "FlowSpace", "OneHotSpace", "StyleSpace", "style_space"]

LEAST_SHOWN = 0.005  # ours: shares of a mixture below are not reported
DIGITS = 3
SHORTEST = 1.0  # s; ours: less shows no movement
SPREAD_FLOOR = 0.1  # cospeech.training.batch_loader
STRETCH = 128  # frames that a style code is made of; cospeech.training.calibration_clips
BEGINNINGS = 8  # ours: places in an example that takes begin from
FARTHEST_MEAN, FARTHEST_STD = 3.0, 2.0
"""[ours] How far from the speakers of the corpus an example may be, in its deviations: ours have means up to 2.3 and deviations
up to 1.9. A person who turns round, bends down or sits is ten times farther away, and the flow knows only standing people."""


class StyleSpace(Protocol):
    """Turns names, examples and mixtures into styles of a system."""

    def by_name(self, name: str) -> StyleEmbedding:
        """One of the system's styles."""
        ...

    def by_example(self, motion: Motion, name: str = "the example") -> StyleEmbedding:
        """The style of an example; its face is ignored.

        Args:
            motion: of any skeleton that is recognised; of one longer than two minutes, twelve pieces of ten seconds are seen.
            name: for messages.

        Raises:
            InputError: the system has no style encoder, the motion is too short, or its skeleton is not recognised.
        """
        ...

    def mix(self, mixture: StyleMixture) -> StyleEmbedding:
        """One style out of several, by their shares."""
        ...

    def shares(self, mixture: StyleMixture) -> dict[str, float] | None:
        """Speaker → weight, the heaviest first, where a mixture of speakers is played; None for a speaker by name, and for a
        system whose styles are no mixtures."""
        ...


def style_space(system: System) -> StyleSpace:
    """The style space of a system."""
    if system.flow is not None:
        return FlowSpace(system, system.flow)
    return OneHotSpace(system) if system.style_space in ("one-hot", "speaker-emotion") else CodeSpace(system)


class CodeSpace:
    """Styles are codes, one for each speaker; an example has the code that the style encoder sees in it, and its own mean pose.

    Args:
        system: the bundle, opened.
    """

    def __init__(self, system: System) -> None:
        self._system = system

    def by_name(self, name: str) -> StyleEmbedding:
        """See `StyleSpace`."""
        s, k = self._system.statistics, self._system.speakers.index(name)
        return StyleEmbedding(
            s.style_codes[k], s.speaker_mean[k], _no_beginnings(self._system), model_mean=s.model_mean[k],
            style_gain=s.style_gain[k], live_model_mean=s.live_model_mean[k], live_style_gain=s.live_style_gain[k],
        )  # fmt: skip

    def by_example(self, motion: Motion, name: str = "the example") -> StyleEmbedding:
        """See `StyleSpace`."""
        code, clips = self._encode(motion, name)
        shares = np.full(len(self._system.speakers), 1 / len(self._system.speakers))
        return self._embedding(code, np.concatenate(clips).mean(0), shares, clips)

    def mix(self, mixture: StyleMixture) -> StyleEmbedding:
        """See `StyleSpace`."""
        return mix(mixture)

    def shares(self, mixture: StyleMixture) -> dict[str, float] | None:
        """See `StyleSpace`."""
        return None

    def _encode(self, motion: Motion, name: str) -> tuple[Array, tuple[Array, ...]]:
        """The mean of what the style encoder makes of stretches that overlap by half; and all poses of the example."""
        system, encoder = self._system, self._system.networks.get("style")
        if encoder is None:
            hint = f"its styles are {', '.join(system.styles)}, and mixtures of them"
            raise InputError(f"this model cannot take a style from {name}", hint)
        least = encoder.signature.probe
        clips = standardise_example(system, motion, least / system.fps, name)
        frames = min(len(poses) for poses in clips)
        if frames < least:
            hint = f"at least {least} frames, {least / system.fps:.2f} s"
            raise InputError(f"example {name} has only {say_count(frames, 'frame')} at {system.fps:g} per second", hint)
        clips = tuple(np.clip(poses, system.statistics.pose_low, system.statistics.pose_high) for poses in clips)
        pieces = [stretch for poses in clips for stretch in stretches(poses, least)]
        return np.mean([encoder.run(poses=piece[None])["style"][0] for piece in pieces], 0), clips

    def _embedding(self, code: Array, mean: Array, shares: Array, clips: tuple[Array, ...]) -> StyleEmbedding:
        """The style of an example that is a mixture of the speakers with these shares."""
        s = self._system.statistics
        numbers = (s.model_mean, s.style_gain, s.live_model_mean, s.live_style_gain)
        model_mean, gain, live_mean, live_gain = ((shares @ each).astype(np.float32) for each in numbers)
        model_mean = mean.astype(np.float32) if self._system.draws else model_mean  # what is drawn has that mean already
        return StyleEmbedding(
            code.astype(np.float32), mean.astype(np.float32), _no_beginnings(self._system), None, clips, model_mean, gain,
            live_mean, live_gain,
        )  # fmt: skip


class OneHotSpace(CodeSpace):
    """Styles are weights of the speakers. An example is the nearest mixture of them, and has its mean pose. The share of
    `VOICE` goes to the speakers that the classifier estimates."""

    def by_name(self, name: str) -> StyleEmbedding:
        """See `StyleSpace`."""
        if name != VOICE:
            return super().by_name(name)
        nothing = np.zeros(self._system.pose_width, np.float32)
        return StyleEmbedding(np.zeros(len(self._system.speakers), np.float32), nothing, _no_beginnings(self._system))

    def by_example(self, motion: Motion, name: str = "the example") -> StyleEmbedding:
        """See `StyleSpace`."""
        code, clips = self._encode(motion, name)
        shares = _normalise(code)
        return self._embedding(shares, shares @ self._system.statistics.speaker_mean, shares, clips)

    def shares(self, mixture: StyleMixture) -> dict[str, float] | None:
        """See `StyleSpace`."""
        if len(mixture) == 1 and not mixture[0][1].poses:
            return None
        weights = self.mix(mixture).code
        by_speaker = dict(zip(self._system.speakers, weights.tolist(), strict=True)) | {VOICE: 1 - float(weights.sum())}
        order = sorted(by_speaker.items(), key=lambda part: (-part[1], part[0]))
        return {name: round(share, DIGITS) for name, share in order if share >= LEAST_SHOWN}


class FlowSpace:
    """Styles are a code, a mean pose, beginnings, and the standard deviation of poses where the flow knows them by it.

    Args:
        system: the bundle, opened.
        flow: its engine.
    """

    def __init__(self, system: System, flow: FlowEngine) -> None:
        self._system, self._flow = system, flow

    def by_name(self, name: str) -> StyleEmbedding:
        """See `StyleSpace`."""
        s, k = self._system.statistics, self._system.styles.index(name)
        each = len(s.histories) // len(self._system.styles)
        return StyleEmbedding(
            s.style_codes[k], s.speaker_mean[k], s.histories[k * each : (k + 1) * each],
            s.speaker_std[k] if s.speaker_std.size else None,
        )  # fmt: skip

    def by_example(self, motion: Motion, name: str = "the example") -> StyleEmbedding:
        """See `StyleSpace`; it is a second long at least."""
        s, sizes = self._system.statistics, self._flow.sizes
        least = max(SHORTEST, max(8, sizes.history + 2) / self._system.fps)  # 8: cospeech.models.nn.conditioning.StyleEncoder
        clips = standardise_example(self._system, motion, least, name)
        mean, std = np.concatenate(clips).mean(0), None
        if s.speaker_std.size:  # standardised as in training; but what is still in the example stays as still
            std = np.concatenate(clips).std(0).astype(np.float32)
            clips = tuple((poses - mean) / np.maximum(std, SPREAD_FLOOR) for poses in clips)
            mean, std = self._hold_near(mean, std)  # played so; what is standardised has all of its movement
        clips = tuple(np.clip(poses, s.pose_low, s.pose_high) for poses in clips)
        code = np.zeros(0)
        if sizes.style:
            code = np.mean([self._flow.style_code(piece) for poses in clips for piece in stretches(poses, STRETCH)], 0)
        places = np.linspace(0, sum(len(poses) - sizes.history for poses in clips), BEGINNINGS, endpoint=False)
        every = [np.lib.stride_tricks.sliding_window_view(p[:-1], sizes.history, 0).transpose(0, 2, 1) for p in clips]
        beginnings = np.concatenate(every)[places.astype(int)]
        return StyleEmbedding(code.astype(np.float32), mean.astype(np.float32), beginnings.astype(np.float32), std, clips)

    def _hold_near(self, mean: Array, std: Array) -> tuple[Array, Array]:
        """Mean pose and deviations (D,) of an example, near those of speakers; of the hips, over planted feet, within them."""
        s = self._system.statistics
        hips = np.array([name.startswith("hips.") for name in find_pose(self._system.pose).names])
        low = np.where(hips, s.speaker_mean.min(0), np.minimum(s.speaker_mean.min(0), -FARTHEST_MEAN))
        high = np.where(hips, s.speaker_mean.max(0), np.maximum(s.speaker_mean.max(0), FARTHEST_MEAN))
        most = np.where(hips, s.speaker_std.max(0), np.maximum(s.speaker_std.max(0), FARTHEST_STD))
        return np.clip(mean, low, high).astype(np.float32), np.minimum(std, most).astype(np.float32)

    def mix(self, mixture: StyleMixture) -> StyleEmbedding:
        """See `StyleSpace`."""
        return mix(mixture)

    def shares(self, mixture: StyleMixture) -> dict[str, float] | None:
        """None: a flow mixes no speakers."""
        return None

    def latents(self, style: StyleEmbedding, code: Array) -> list[Array]:
        """(T − τ, D) for each piece of an example: the latents that make it under mean speech and this code."""
        sizes, latents = self._flow.sizes, []
        after = sizes.speech_frames - 1 - sizes.history
        for poses in style.poses:
            rows = np.concatenate([poses, np.repeat(poses[-1:], after, 0)])
            latents.append(self._flow.latents(rows, np.zeros((len(rows), sizes.audio), np.float32), code))
        return latents


def _normalise(code: Array) -> Array:
    """Weights ≥ 0 that sum to 1, whatever an encoder gives."""
    positive = np.clip(np.nan_to_num(np.asarray(code, float)), 0, 1)
    total = positive.sum()
    return positive / total if total > 0 else np.full(len(positive), 1 / len(positive))


def _no_beginnings(system: System) -> Array:
    """No beginnings: networks of windows have no history."""
    return np.zeros((0, 0, system.pose_width), np.float32)
