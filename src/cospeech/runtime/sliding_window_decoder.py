"""A network that turns windows of speech into windows of poses, played over speech of any length that comes in pieces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from ..motion.rotations import Array
from .crossfade import Crossfade
from .mode_noise import SmoothGumbel
from .pose_resampler import MOST_LAG
from .style_measures import StyleMixture, average_parts
from .window_bundle import WindowSystem
from .window_engine import WindowSizes
from .window_layout import Sliding, WindowLayout, check_look_ahead
from .window_style import plays_mixtures

__all__ = ["LIVE", "SlidingWindowDecoder", "live", "looking", "whole"]

BLOCK = 256  # ours: frames that are made at once where nobody waits


LIVE = WindowLayout(window=64, hop=4, ahead=8, fade=4)
"""Ours: half a second of foresight at 15 frames a second, about the preparation of a stroke; windows as in training (64 frames,
Ahuja et al. 2020, section 5)."""
NEAR = 16  # frames [ours]: at 60 a second, as faces are, 0.27 s


def live(sizes: WindowSizes) -> WindowLayout:
    """`LIVE`, in windows as the network was trained on; a network that hears at most `NEAR` frames ahead gets all of them."""
    near = sizes.reach if sizes.reach is not None and sizes.reach <= NEAR else 0
    setting = replace(LIVE, ahead=max(LIVE.ahead, _up(near, sizes.multiple)))
    return replace(setting, window=_up(max(sizes.window, setting.waits), sizes.multiple))


def whole(sizes: WindowSizes) -> WindowLayout:
    """Exact: what one pass over the whole speech makes, with silence around it.

    Windows begin where the network's own steps in time do, and every new frame has all around it that matters to it. There is
    no such thing for a network that normalises over a window: that hears as much before as after, in windows as in training.
    """
    if sizes.reach is None:
        usual = live(sizes)
        return replace(usual, ahead=max(usual.ahead, (usual.window - usual.hop) // 2))
    reach, block = _up(sizes.reach, sizes.multiple), _up(BLOCK, sizes.multiple)
    return WindowLayout(window=2 * reach + block, hop=block, ahead=reach, fade=0)


def looking(sizes: WindowSizes, fps: float, seconds: float | None = None) -> WindowLayout:
    """The setting with this look-ahead: `live` where it is None, `whole` from the network's reach on.

    Raises:
        InputError: no number of seconds from 0 on.
    """
    check_look_ahead(seconds)
    if seconds is None:
        return live(sizes)
    usual, most = live(sizes), whole(sizes)
    if seconds * fps >= (most.ahead if sizes.reach is None else sizes.reach):
        return most
    ahead = ceil(seconds * fps - 1e-9)
    longer = sizes.reach is not None and ahead > usual.ahead
    window = _up(usual.window + ahead - usual.ahead, sizes.multiple) if longer else usual.window
    return WindowLayout(window, usual.hop, ahead, min(usual.fade, ahead))


def _up(frames: int, multiple: int) -> int:
    return -(-frames // multiple) * multiple


@dataclass(frozen=True, eq=False)
class _Style:
    """What the network plays a style by."""

    codes: Array
    """(N, 1, styles) of each take."""
    speaker_mean: Array
    """(1, 1, D) standardised mean pose."""
    model_mean: Array
    """(1, 1, D) that of what the network makes."""
    style_gain: Array
    """(1, 1, D) by what the network's poses are multiplied."""


class SlidingWindowDecoder:
    """Takes of one speech on a network of windows; see `cospeech.runtime.session.Decoder`.

    A take's seed draws noise for the network's choice among its modes (`SmoothGumbel`), or, for a network without modes
    whose style is a code of its own, where the take lies beside the style: for good, by so many deviations of the speakers'
    codes. Takes of a network with neither are alike. At temperature 0 all are the network's own, deterministic motion.

    A mixture of speakers may be another at every frame; a code of another kind is one for a window (MUNIT), that of the middle
    of its new frames.

    Args:
        system: the bundle, opened.
        setting: how windows lie.
        blend: the style to begin with.
        seeds: of the takes.
        silence: (1, A) row of silence, which is before the speech.
        temperature: scale of the noise.
        intensity: how far poses stray from the style's mean one.
    """

    moods = None
    speaker = None
    emotion = None
    """It hears none of them."""

    def __init__(
        self,
        system: WindowSystem,
        setting: WindowLayout,
        blend: StyleMixture,
        seeds: Sequence[int],
        silence: Array,
        *,
        temperature: float = 1.0,
        intensity: float = 1.0,
    ) -> None:
        self._system, self.setting, self._intensity = system, setting, np.float32(intensity)
        sizes = system.engine.sizes
        self.takes, self.width = len(seeds), sizes.pose
        self._temperature, self._by_frame = np.float32(temperature), plays_mixtures(system)
        self._noise = [SmoothGumbel(sizes.modes, system.fps, seed=seed) for seed in seeds]
        self._moved = self._temperature * _asides(system, seeds)
        self._styles = Crossfade(self._style(blend), system.fps)
        self._windows = Sliding(setting, silence, self._draw_noise, self._window)

    @property
    def latency(self) -> float:
        """See `Decoder`."""
        return self.setting.waits / self._system.fps

    def push(self, rows: Array) -> Array:
        """See `Decoder`."""
        return self._join(self._windows.push(rows))

    def finish(self, silence: Array) -> Array:
        """See `Decoder`."""
        return self._join(self._windows.finish(silence))

    def denormalise(self, poses: Array, at: Array) -> Array:
        """See `Decoder`."""
        s, mixed = self._system.statistics, self._styles.mix
        centre, made, gain = (mixed(f, at) for f in (lambda x: x.speaker_mean, lambda x: x.model_mean, lambda x: x.style_gain))
        return (centre + self._intensity * gain * (poses - made)) * s.pose_std + s.pose_mean

    def restyle(self, blend: StyleMixture, frame: int) -> None:
        """See `Decoder`."""
        self._styles.change(self._style(blend), frame)

    def _style(self, blend: StyleMixture) -> _Style:
        code, *rest = (
            average_parts((s, getattr(m, name)) for s, m in blend)
            for name in ("code", "speaker_mean", "model_mean", "style_gain")
        )
        return _Style((code + self._moved)[:, None], *(each[None, None] for each in rest))

    def _draw_noise(self, frames: int) -> Array:
        """(N, frames, modes) the next noise."""
        return self._temperature * np.stack([noise.draw(frames) for noise in self._noise])

    def _join(self, made: list[Array]) -> Array:
        """(N, k, D) of the windows that were made."""
        self._styles.forget(self._windows.frames - self.setting.past - MOST_LAG)
        return np.concatenate([np.zeros((self.takes, 0, self.width), np.float32), *made], 1)

    def _window(self, rows: Array, first: int, mode_noise: Array) -> Array:
        """(N, window, D) where ``first`` is the first new frame."""
        window, hop, past = self.setting.window, self.setting.hop, self.setting.past
        at = np.arange(window) + (first - past) if self._by_frame else np.array([first + hop // 2])
        codes = self._styles.mix(lambda style: style.codes, at)
        codes = np.broadcast_to(codes, (self.takes, window, codes.shape[2]))
        return self._system.engine.make(rows, codes, mode_noise)


def _asides(system: WindowSystem, seeds: Sequence[int]) -> Array:
    """(N, styles) how far takes lie beside a style: for networks that have codes of their own and no modes, else not at all."""
    sizes, codes = system.engine.sizes, system.statistics.codes
    if sizes.modes or plays_mixtures(system):
        return np.zeros((len(seeds), sizes.styles), np.float32)
    drawn = [np.random.default_rng([seed, 4]).standard_normal(sizes.styles) * codes.std(0) for seed in seeds]
    return np.array(drawn, np.float32).reshape(len(seeds), sizes.styles)
