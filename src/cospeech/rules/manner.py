"""How a session performs: style, size and face; and how one manner turns into another while it runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..face.composition import Face
from ..face.delays import FaceDelays
from ..motion.curves import smoothstep
from ..motion.rotations import Array
from .styles import Style

__all__ = ["FADE", "Manner", "MannerCourse", "make_manner", "mix_frames"]

FADE = 0.5  # s; [ours] as trained models fade a style in (`cospeech.runtime.crossfade`)
_MOST_FACE = 1.3  # [ours] intensity of a face at most: beyond it faces grimace


@dataclass(frozen=True)
class Manner:
    """Style, size, face and seed with which a session performs.

    Args:
        style: the speaker.
        intensity: size of all movement.
        face: made for both.
    """

    style: Style
    intensity: float
    face: Face
    seed: int
    """Of the noise that keeps hands and body from being still."""


def make_manner(
    style: Style, intensity: float, *, seed: int, gains: Array | None, delays: FaceDelays | None = None
) -> Manner:  # fmt: skip
    """A manner and its face.

    Args:
        style, intensity: as of `Manner`.
        seed: of the take.
        gains: (52,) factors of the face's channels; all 1 where None.
        delays: see `Face`.
    """
    face = Face(
        seed=seed, intensity=min(intensity, _MOST_FACE), expressiveness=style.expressiveness, emphasis=style.emphasis,
        blink_rate=style.blinks / 60, coupling=style.coupling, gains=gains, delays=delays,
    )  # fmt: skip
    return Manner(style, intensity, face, seed)


class MannerCourse:
    """Which manner is performed when: each takes over from the one before within `FADE` seconds."""

    def __init__(self, first: Manner) -> None:
        self._layers: list[tuple[float, Manner]] = [(-np.inf, first)]

    @property
    def last(self) -> Manner:
        """The one that was set last."""
        return self._layers[-1][1]

    def change(self, manner: Manner, time: float) -> None:
        """Another manner from ``time`` seconds on; times ascend."""
        self._layers.append((time, manner))

    def layers(self, times: Array) -> list[tuple[Manner, Array]]:
        """The manners of ``times (n,)`` seconds, each with its share (n,) over those before it; that of the first is 1."""
        if len(self._layers) == 1:
            return [(self.last, np.ones(len(times)))]
        current = [(start, manner) for start, manner in self._layers if start <= times[-1]]
        shares = [smoothstep((times - start) / FADE) for start, _ in current]
        first = max((k for k, share in enumerate(shares) if share[0] == 1.0), default=0)
        return [(manner, share) for (_, manner), share in zip(current[first:], shares[first:], strict=True)]

    def forget(self, before: float) -> None:
        """Drop what only times before this one need."""
        while len(self._layers) > 1 and self._layers[1][0] + FADE < before:
            del self._layers[0]


def mix_frames(layers: list[tuple[Array, Array]]) -> Array:
    """(n, …) numbers, or quaternions (n, J, 4) of unit length, of several manners.

    Args:
        layers: the numbers of each, and its share (n,) over those before it.
    """
    mix = layers[0][0]
    for values, share in layers[1:]:
        weight = share.reshape(-1, *[1] * (values.ndim - 1))
        if values.ndim == 3:
            values = np.where((values * mix).sum(-1, keepdims=True) < 0, -values, values)
        mix = mix + weight * (values - mix)
    if mix.ndim == 3 and len(layers) > 1:
        mix = mix / np.linalg.norm(mix, axis=-1, keepdims=True)
    return mix
