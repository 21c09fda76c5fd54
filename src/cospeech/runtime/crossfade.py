"""Values that change while speech comes in, each crossfaded with the one before: styles, for example."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np

from ..motion.curves import smoothstep
from ..motion.rotations import Array

__all__ = ["FADE", "Crossfade"]

FADE = 0.5  # s; ours: about a stroke, so that a moving hand does not jump, and a user soon sees the change
T = TypeVar("T")


class Crossfade(Generic[T]):
    """Values that hold from a frame on, each faded in over what was before; a frame's mixture follows from its index alone.

    Args:
        first: holds from the beginning.
        fps: frames per second.

    >>> track = Crossfade(np.zeros((1, 1)), fps=4)
    >>> track.change(np.ones((1, 1)), 2)
    >>> track.mix(lambda value: value, np.arange(6)).ravel().tolist()
    [0.0, 0.0, 0.0, 0.5, 1.0, 1.0]
    """

    def __init__(self, first: T, fps: float) -> None:
        self._frames = FADE * fps
        self._layers: list[tuple[int, T]] = [(0, first)]

    @property
    def layers(self) -> list[tuple[int, T]]:
        """First frame and value of each that is still needed, in the order of their frames; the first one is all there is
        before the second."""
        return self._layers

    def change(self, value: T, frame: int) -> None:
        """Another value from here on; of two at one frame the last counts.

        Args:
            frame: not before that of an earlier change.
        """
        if len(self._layers) > 1 and self._layers[-1][0] == frame:
            self._layers.pop()
        self._layers.append((frame, value))

    def steady(self, first: int, end: int) -> bool:
        """Whether all these frames have the same mixture."""
        return all(end <= start + 1 or first >= start + self._frames for start, _ in self._layers[1:])

    def mix(self, pick: Callable[[T], Array], at: Array) -> Array:
        """(N, n or 1, K) numbers of the values, mixed.

        Args:
            pick: value → its numbers (N, n or 1, K).
            at: (n,) frames, which may be fractions.
        """
        out = pick(self._layers[0][1])
        for start, value in self._layers[1:]:
            share = smoothstep((at - start) / self._frames)[:, None].astype(out.dtype)  # begins and ends without a jerk
            new = pick(value)
            between = np.where(share > 0, out + share * (new - out), out)
            out = np.where(share < 1, between, new)  # to the bit where there is one of them only
        return out

    def forget(self, before: float) -> None:
        """Drop what only frames before this one need."""
        while len(self._layers) > 1 and self._layers[1][0] + self._frames <= before:
            del self._layers[0]
