"""A flow under way: rows of speech in, poses of one or several takes out, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from ..audio.emotions import Moods
from ..motion.rotations import Array
from .crossfade import Crossfade
from .flow.engine import FlowEngine
from .pose_resampler import MOST_LAG
from .styles.embedding import StyleMixture
from .system import System

__all__ = ["AutoregressiveDecoder", "Source", "SourceFactory"]

SKIP = 1024  # ours: latents that are drawn and thrown away at once


class Source(Protocol):
    """Where a take's latents come from, and how it begins: at random, or from an example."""

    @property
    def history(self) -> Array:
        """(τ, D) standardised poses before the first frame."""
        ...

    @property
    def style(self) -> Array:
        """(style,) code, for a system that has them."""
        ...

    @property
    def speaker_mean(self) -> Array:
        """(D,) standardised mean pose of the speaker, from which ``intensity`` scales."""
        ...

    @property
    def style_gain(self) -> Array | None:
        """(D,) what the network's poses are multiplied by before they are added to the mean pose, so that they deviate as the
        speaker's do; None for a network that gives standardised poses themselves."""
        ...

    @property
    def model_mean(self) -> Array | None:
        """(D,) mean of what the network makes of these latents by itself, taken off before; None with ``spread``."""
        ...

    def draw(self, frames: int) -> Array:
        """(frames, D) the next latents; pieces of any size make the same sequence."""
        ...


SourceFactory = Callable[[StyleMixture], Sequence[Source]]
"""A style → the sources of the takes, one for each seed."""


class AutoregressiveDecoder:
    """Takes of one speech on a flow; see `cospeech.runtime.session.Decoder`.

    A new style brings a second set of sources, which play as if they had played from the beginning; latents, codes, mean poses
    and deviations fade from the first set to the second.

    Args:
        system: the bundle, opened.
        flow: its engine.
        make_sources: makes sources.
        blend: the style to begin with.
        silence: (1, A) row of silence, which is before the speech.
        intensity: how far poses stray from the mean one.
        ahead: how many frames of speech after a frame are waited for, of those that the flow hears; all where not given. The
            last frame that was heard stands for the others.
    """

    moods = None
    speaker = None
    emotion = None
    """It hears none of them."""

    def __init__(
        self,
        system: System,
        flow: FlowEngine,
        make_sources: SourceFactory,
        blend: StyleMixture,
        silence: Array,
        *,
        intensity: float = 1.0,
        ahead: int | None = None,
    ) -> None:
        self._system, self._flow, self._make_sources, self._intensity = system, flow, make_sources, np.float32(intensity)
        sources = make_sources(blend)
        self._sources = Crossfade(sources, system.fps)
        self._takes = flow.begin(np.stack([s.history for s in sources]), np.stack([s.style for s in sources]))
        usual = flow.sizes.speech_frames - 1 - flow.sizes.history
        self._hold = 0 if ahead is None else max(usual - ahead, 0)
        self._rows = np.repeat(silence, flow.sizes.history, 0)
        self._frame = 0
        self.takes, self.width = len(sources), flow.sizes.pose

    @property
    def latency(self) -> float:
        """See `Decoder`."""
        sizes = self._flow.sizes
        return (sizes.speech_frames - sizes.history - self._hold) / self._system.fps

    def push(self, rows: Array) -> Array:
        """See `Decoder`."""
        self._sources.forget(self._frame - MOST_LAG)
        self._rows = np.concatenate([self._rows, rows])
        windows = self._windows()
        self._rows = self._rows[len(windows) :].copy()
        if not len(windows):
            return np.zeros((self.takes, 0, self.width), np.float32)
        first, end = self._frame, self._frame + len(windows)
        self._frame = end
        z = self._latents(first, end)
        if self._sources.steady(first, end):
            return self._make_frames(first, windows, z)
        frames = [self._make_frames(first + k, windows[k : k + 1], z[:, k : k + 1]) for k in range(len(windows))]
        return np.concatenate(frames, 1)

    def finish(self, silence: Array) -> Array:
        """See `Decoder`."""
        sizes = self._flow.sizes
        return self.push(np.repeat(silence, sizes.speech_frames - 1 - sizes.history - self._hold, 0))

    def _windows(self) -> Array:
        """(F, heard, A) of the frames that can be made; what is not waited for is held."""
        if not self._hold:
            return self._flow.windows(self._rows)
        length = self._flow.sizes.speech_frames - self._hold
        count = max(len(self._rows) - length + 1, 0)
        index = np.arange(count)[:, None] + np.minimum(np.arange(self._flow.sizes.speech_frames), length - 1)
        return np.asarray(self._rows, np.float32)[index]

    def denormalise(self, poses: Array, at: Array, amplitude: Array | float = 1.0) -> Array:
        """See `Decoder`."""
        s, centres = self._system.statistics, self._mix_sources("speaker_mean", at)
        return (centres + self._intensity * amplitude * self._deviate(poses, centres, at)) * s.pose_std + s.pose_mean

    def set_emotion(self, moods: Moods | None, time: float) -> None:
        """A flow knows no emotions."""

    def restyle(self, blend: StyleMixture, frame: int) -> None:
        """See `Decoder`."""
        sources = self._make_sources(blend)
        for source in sources:
            for start in range(0, frame, SKIP):
                source.draw(min(SKIP, frame - start))
        self._sources.change(sources, frame)

    def _latents(self, first: int, end: int) -> Array:
        """(N, end − first, D)."""
        latents: dict[int, Array] = {}
        for start, sources in self._sources.layers:
            z = np.stack([source.draw(max(0, end - max(first, start))) for source in sources])
            latents[id(sources)] = np.pad(z, ((0, 0), (end - first - z.shape[1], 0), (0, 0)))
        return self._sources.mix(lambda sources: latents[id(sources)], np.arange(first, end))

    def _make_frames(self, frame: int, windows: Array, z: Array) -> Array:
        """Poses of frames that have one style."""
        self._takes.styles[:] = self._mix_sources("style", np.array([frame]))[:, 0]
        return self._takes.frames(windows, z)

    def _deviate(self, poses: Array, centres: Array, at: Array) -> Array:
        """(N, n, D) how far poses are from the mean ones, standardised."""
        if self._sources.layers[0][1][0].style_gain is None:  # of a system, all have one or none
            return poses - centres
        return (poses - self._mix_sources("model_mean", at)) * self._mix_sources("style_gain", at)

    def _mix_sources(self, name: str, at: Array) -> Array:
        """(N, n or 1, …) an attribute of the sources at these frames."""
        return self._sources.mix(lambda sources: np.stack([getattr(source, name) for source in sources])[:, None], at)
