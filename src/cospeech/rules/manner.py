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
    """What a session performs with.

    Args:
        style: the speaker.
        intensity: size of all movement.
        face: made for both.
    """

    style: Style
    intensity: float
    face: Face
    seed: int
    """Of what is never still."""


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
        """The manners of ``times (n,)`` seconds, each with its share (n,) over those before it; the first has all of it."""
        if len(self._layers) == 1:
            return [(self.last, np.ones(len(times)))]
        begun = [(start, manner) for start, manner in self._layers if start <= times[-1]]
        shares = [smoothstep((times - start) / FADE) for start, _ in begun]
        first = max((k for k, share in enumerate(shares) if share[0] == 1.0), default=0)
        return [(manner, share) for (_, manner), share in zip(begun[first:], shares[first:], strict=True)]

    def forget(self, before: float) -> None:
        """Drop what only times before this one need."""
        while len(self._layers) > 1 and self._layers[1][0] + FADE < before:
            del self._layers[0]


def mix_frames(made: list[tuple[Array, Array]]) -> Array:
    """(n, …) numbers, or quaternions (n, J, 4) of unit length, of several manners.

    Args:
        made: the numbers of each, and its share (n,) over those before it.
    """
    mixed = made[0][0]
    for values, share in made[1:]:
        weight = share.reshape(-1, *[1] * (values.ndim - 1))
        if values.ndim == 3:
            values = np.where((values * mixed).sum(-1, keepdims=True) < 0, -values, values)
        mixed = mixed + weight * (values - mixed)
    if mixed.ndim == 3 and len(made) > 1:
        mixed = mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)
    return mixed
