"""What decoders that play networks have in common: takes that differ by noise, and poses in the style that is asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..audio.emotions import Moods
from ..motion.rotations import Array
from .mode_noise import SmoothNoise
from .network import Network
from .styles.embedding import StyleMixture
from .styles.track import SpokenStyleTrack, StyleTrack
from .system import System

__all__ = ["NetworkDecoder", "RestingDecoder"]


class NetworkDecoder:
    """Takes of one speech on a network; see `cospeech.runtime.session.Decoder`.

    A take's seed draws smooth noise where the network takes noise. At temperature 0 all takes are the network's own,
    deterministic motion.

    Args:
        system: the bundle, opened.
        network: the one that plays.
        style: of every frame.
        seeds: of the takes.
        silence: (1, A) row of silence, which is before the speech.
        temperature: scale of the noise.
        intensity: how far poses stray from the style's mean one.
    """

    def __init__(
        self, system: System, network: Network, style: StyleTrack | SpokenStyleTrack, seeds: Sequence[int], silence: Array, *,
        temperature: float = 1.0, intensity: float = 1.0,
    ) -> None:  # fmt: skip
        self.takes, self.width = len(seeds), system.pose_width
        self._system, self._network, self._style, self._silent_row = system, network, style, silence
        self._intensity = np.float32(intensity)
        gain = system.statistics.noise_gain[int(network.signature.window is None)]
        self._temperature = gain * np.float32(temperature)
        width, is_normal = network.signature.width("noise"), network.signature.normal_noise
        self._noise = [SmoothNoise(width, system.fps, seed=seed, normal=is_normal) for seed in seeds]

    @property
    def moods(self) -> Moods | None:
        """See `Decoder`."""
        return self._style.moods

    @property
    def emotion(self) -> dict[str, float] | None:
        """See `Decoder`."""
        return self._style.emotion

    @property
    def speaker(self) -> dict[str, float] | None:
        """See `Decoder`."""
        return self._style.speaker

    def set_emotion(self, moods: Moods | None, time: float) -> None:
        """Other emotions from ``time`` seconds on, for a network that knows some."""
        self._style.set_emotion(moods, time)

    def restyle(self, blend: StyleMixture, frame: int) -> None:
        """See `Decoder`."""
        self._style.restyle(blend, frame)

    def denormalise(self, poses: Array, at: Array, amplitude: Array | float = 1.0) -> Array:
        """See `Decoder`."""
        s, (centre, model_mean, gain) = self._system.statistics, self._style.scales(at)
        return (centre + self._intensity * gain * amplitude * (poses - model_mean)) * s.pose_std + s.pose_mean

    def _draw_noise(self, frames: int) -> Array:
        """(N, frames, Z) the next noise."""
        return self._temperature * np.stack([noise.draw(frames) for noise in self._noise])

    def _hear(self, rows: Array) -> None:
        """Give the style rows of speech: only their features, without style controls and words."""
        self._style.hear(rows[:, : len(self._system.statistics.audio_mean)])

    def _run(self, ports: dict[str, Array]) -> dict[str, Array]:
        """The network, given those of the ports that it has; poses are (N, …) of every take."""
        has = self._network.signature
        outputs = self._network.run(**{name: x for name, x in ports.items() if name in has.inputs or name in has.state})
        poses = outputs["poses"]
        return outputs | {"poses": np.broadcast_to(poses, (self.takes, *poses.shape[1:]))}

    def _none(self) -> Array:
        """(N, 0, D)."""
        return np.zeros((self.takes, 0, self.width), np.float32)


class RestingDecoder(NetworkDecoder):
    """Mean poses, at once, of a network that is played elsewhere: that of a mouth, which the face's session plays."""

    @property
    def latency(self) -> float:
        """See `Decoder`."""
        return 1 / self._system.fps

    def push(self, rows: Array) -> Array:
        """See `Decoder`."""
        return np.zeros((self.takes, len(rows), self.width), np.float32)

    def finish(self, silence: Array) -> Array:
        """See `Decoder`."""
        return self._none()
