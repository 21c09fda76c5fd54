"""A Chain of Generation, played over speech that comes in pieces: frame by frame, or in windows that hear more of what follows.

The style of a frame is two distributions: over the speakers, by what the user asked for and, as far as he left it open, by the
voice; and over the emotions, by the voice or as given.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..audio.emotions import EMOTIONS, Moods
from ..errors import InputError
from ..motion.rotations import Array
from .chain_bundle import ChainSystem
from .conditioning import ConditioningFace
from .crossfade import Crossfade
from .mode_noise import SmoothGumbel
from .pose_resampler import MOST_LAG
from .speaker_emotion_tracker import SpeakerEmotionTracker
from .style_measures import StyleMixture, average_parts
from .window_layout import Sliding, WindowLayout

__all__ = ["CausalStreamDecoder", "ChainPlayer", "OverlapAddDecoder", "sections"]

KEPT = 10.0  # s; ours: of the voice's course, more than the face lags behind


def sections(window: int) -> WindowLayout:
    """Windows as in training, half of each new, a quarter heard before and a quarter after; ours."""
    ahead = max(1, window // 4)
    return WindowLayout(window=window, hop=max(1, window // 2), ahead=ahead, fade=min(ahead, max(1, window // 2)) // 2)


class ChainPlayer:
    """What both ways of playing have in common; see `cospeech.runtime.session.Decoder`.

    A take's seed draws smooth noise, where the network was trained with noise; takes of another one are alike.

    Args:
        system: the bundle, opened.
        blend: the style to begin with; shares of nobody are the voice's.
        seeds: of the takes.
        silence: (1, A + W) row of silence, which is before the speech.
        tracker: hears who speaks and how.
        temperature: scale of the noise.
        intensity: how far poses stray from the style's mean one.
    """

    def __init__(
        self,
        system: ChainSystem,
        blend: StyleMixture,
        seeds: Sequence[int],
        silence: Array,
        tracker: SpeakerEmotionTracker,
        *,
        temperature: float = 1.0,
        intensity: float = 1.0,
    ) -> None:
        sizes = system.engine.sizes
        self.takes, self.width = len(seeds), sizes.pose
        self._system, self._tracker, self._silent_row = system, tracker, silence
        self._temperature, self._intensity = np.float32(temperature), np.float32(intensity)
        self._noise = [SmoothGumbel(sizes.noise, system.fps, seed=seed) for seed in seeds]
        self._asked = Crossfade(_speakers(blend), system.fps)
        self._made = 0

    @property
    def moods(self) -> Moods | None:
        """See `Decoder`; None where none was given."""
        return self._tracker if self._tracker.knows else None

    @property
    def emotion(self) -> dict[str, float] | None:
        """See `Decoder`."""
        if not self._tracker.hears:
            return None
        return {name: float(p) for name, p in zip(EMOTIONS, self._tracker.emotion, strict=True)}

    @property
    def speaker(self) -> dict[str, float] | None:
        """See `Decoder`."""
        if not self._system.engine.classifies:
            return None
        return {name: float(p) for name, p in zip(self._system.speakers, self._tracker.speaker, strict=True)}

    def restyle(self, blend: StyleMixture, frame: int) -> None:
        """See `Decoder`."""
        self._asked.change(_speakers(blend), frame)

    def denormalise(self, poses: Array, at: Array) -> Array:
        """See `Decoder`."""
        s, (centre, made, gain) = self._system.statistics, self._scales(at)
        return (centre + gain * (poses - made)) * s.pose_std + s.pose_mean

    def _scales(self, at: Array) -> tuple[Array, Array, Array]:
        """(n, D) mean pose of the style, that of what the network makes in it, and by what the difference is multiplied."""
        calibration = self._calibration
        shares = self._style(at)[:, : self._system.engine.sizes.speakers].astype(np.float32)
        return (
            shares @ self._system.statistics.speaker_mean,
            shares @ calibration[0],
            self._intensity * (shares @ calibration[1]),
        )

    @property
    def _calibration(self) -> tuple[Array, Array, np.float32]:
        """(S, D) mean of what the network makes in each speaker's style, (S, D) by what it is multiplied, by what noise is."""
        raise NotImplementedError

    def _style(self, frames: Array) -> Array:
        """(n, S + 8) of these frames."""
        speakers = self._system.engine.sizes.speakers
        heard = self._tracker.shares(frames)
        asked = np.broadcast_to(self._asked.mix(lambda shares: shares, frames)[0], (len(frames), speakers))
        left = np.maximum(1 - asked.sum(1, keepdims=True), 0)
        return np.concatenate([asked + left * heard[:, :speakers], heard[:, speakers:]], 1)

    def _draw_noise(self, frames: int) -> Array:
        """(N, frames, Z) the next noise."""
        return self._calibration[2] * self._temperature * np.stack([noise.draw(frames) for noise in self._noise])

    def _forget(self, back: int) -> None:
        """What no window that begins ``back`` frames before what is made next, and no pose handed out so far, asks for."""
        self._asked.forget(self._made - back - MOST_LAG)
        self._tracker.forget(self._made - back - round(KEPT * self._system.fps))


class CausalStreamDecoder(ChainPlayer):
    """Frame by frame: every row of speech makes the pose of the frame that lies ``look_ahead`` before it certain."""

    def __init__(self, *given: Any, **options: Any) -> None:
        super().__init__(*given, **options)
        self._live = self._system.engine.live(self.takes)
        self._heard = 0

    @property
    def latency(self) -> float:
        """See `Decoder`."""
        return (self._system.engine.sizes.look_ahead + 1) / self._system.fps

    @property
    def _calibration(self) -> tuple[Array, Array, np.float32]:
        s = self._system.statistics
        return s.live_model_mean, s.live_style_gain, s.noise_gain[1]

    def push(self, rows: Array) -> Array:
        """See `Decoder`."""
        self._forget(0)
        audio, made = self._system.engine.sizes.audio, [np.zeros((self.takes, 0, self.width), np.float32)]
        for row in rows:
            self._tracker.push(row[None, :audio])
            style = self._style(np.array([self._heard]))[0]
            poses = self._live.frame(row, np.broadcast_to(style, (self.takes, len(style))), self._draw_noise(1)[:, 0])
            self._heard += 1
            if self._heard > self._system.engine.sizes.look_ahead:
                made.append(poses[:, None])
                self._made += 1
        return np.concatenate(made, 1)

    def finish(self, silence: Array) -> Array:
        """See `Decoder`."""
        return self.push(np.repeat(silence, self._system.engine.sizes.look_ahead if self._heard else 0, 0))


class OverlapAddDecoder(ChainPlayer):
    """In windows (`sections`), each of which hears both ways, faded from one to the next.

    Args:
        face: in the place of the network's own.
        before: (seeds, D) standardised poses, of the frames before the first, with which the first window begins; what is
            missing from the last of them to the first pose that is made is faded out within half a second.

    Raises:
        InputError: windows too short for these.
    """

    def __init__(self, *given: Any, face: ConditioningFace | None = None, before: Array | None = None, **options: Any) -> None:
        super().__init__(*given, **options)
        self.setting, self._face, self._before = sections(self._system.engine.sizes.window), face, before
        self._gap: Array | None = None
        if before is not None and len(before) > self.setting.past:
            raise InputError(f"windows of {self.setting.window} frames", f"{4 * len(before)} at least, to go on from poses")
        self._windows = Sliding(self.setting, self._silent_row, self._draw_noise, self._window)

    @property
    def latency(self) -> float:
        """See `Decoder`."""
        return self.setting.waits / self._system.fps

    @property
    def _calibration(self) -> tuple[Array, Array, np.float32]:
        s = self._system.statistics
        return s.model_mean, s.style_gain, s.noise_gain[0]

    def push(self, rows: Array) -> Array:
        """See `Decoder`."""
        self._forget(self.setting.past)
        self._tracker.push(rows[:, : self._system.engine.sizes.audio])
        return self._join(self._windows.push(rows))

    def finish(self, silence: Array) -> Array:
        """See `Decoder`."""
        self._tracker.push(np.repeat(silence, self.setting.window, 0)[:, : self._system.engine.sizes.audio])
        return self._join(self._windows.finish(silence))

    def denormalise(self, poses: Array, at: Array) -> Array:
        """See `Decoder`; the first call has the first pose."""
        found = super().denormalise(poses, at)
        if self._before is None or not len(at):
            return found
        if self._gap is None:
            s = self._system.statistics
            self._gap = self._before[-1] * s.pose_std + s.pose_mean - found[:, :1]
        left = np.clip(1 - (at + 1) / (_JOIN * self._system.fps), 0, 1)  # all of it a frame before the first
        return found + (left * left * (3 - 2 * left)).astype(np.float32)[:, None] * self._gap

    def _join(self, made: list[Array]) -> Array:
        self._made = self._windows.frames
        return np.concatenate([np.zeros((self.takes, 0, self.width), np.float32), *made], 1)

    def _window(self, rows: Array, first: int, mode_noise: Array) -> Array:
        """(N, window, D) where ``first`` is the first new frame."""
        frames = np.arange(self.setting.window) + (first - self.setting.past)
        style, more = self._style(np.maximum(frames, 0)), dict[str, Array]()
        if self._face is not None:
            weights, share = self._face.at(frames / self._system.fps)
            more["face"] = np.concatenate([weights * (share > 0), share], 1)
        began = 0
        if first == 0 and self._before is not None:  # the first window begins with them
            began = self.setting.past - len(self._before)
            more["seed"] = self._seeds(len(frames))
        styles = np.broadcast_to(style[began:], (self.takes, len(style) - began, style.shape[1]))
        more = {name: x[began:] for name, x in more.items()}
        made = self._system.engine.windows.make(rows[began:], styles, mode_noise[:, began:], more=more)
        return np.concatenate([np.repeat(made[:, :1], began, 1), made], 1)

    def _seeds(self, frames: int) -> Array:
        """(frames, D + 1) poses before the first as the network would have made them, and a flag."""
        assert self._before is not None
        centre, made, gain = self._scales(np.zeros(1, int))
        engine, past = self._system.engine.windows, self.setting.past
        poses = np.clip((self._before - centre) / np.maximum(gain, _LEAST_GAIN) + made, engine.low, engine.high)
        rows = np.zeros((frames, self.width + 1), np.float32)
        rows[past - len(poses) : past] = np.concatenate([poses, np.ones((len(poses), 1), np.float32)], 1)
        return rows


_JOIN = 0.5  # s; ours: as styles are faded
_LEAST_GAIN = np.float32(1e-3)  # ours: below, nothing moves that could be gone on from


def _speakers(blend: StyleMixture) -> Array:
    """(1, 1, S) shares of the speakers that were asked for."""
    return average_parts((share, embedding.code) for share, embedding in blend)[None, None]
