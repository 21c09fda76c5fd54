"""The interface of a decoder: a network of any kind under way."""

from __future__ import annotations

from typing import Protocol

from ..audio.emotions import Moods
from ..motion.rotations import Array
from .styles.embedding import StyleMixture

__all__ = ["Decoder"]


class Decoder(Protocol):
    """A network of any kind under way: rows of speech in, poses of N takes out."""

    @property
    def takes(self) -> int:
        """N."""
        ...

    @property
    def width(self) -> int:
        """D."""
        ...

    @property
    def latency(self) -> float:
        """Seconds of speech, from a frame's own time on, that the network waits for at most."""
        ...

    @property
    def moods(self) -> Moods | None:
        """The emotions that the network plays, as far as speech was pushed; None for one that knows none."""
        ...

    @property
    def speaker(self) -> dict[str, float] | None:
        """See `TrainedSession.speaker`."""
        ...

    @property
    def emotion(self) -> dict[str, float] | None:
        """See `TrainedSession.emotion`; None where the network hears none."""
        ...

    def push(self, rows: Array) -> Array:
        """Standardised rows (n, A) that come next → the standardised poses (N, k, D) that they make certain."""
        ...

    def finish(self, silence: Array) -> Array:
        """The poses of the rest; ``silence`` (1, A) is the row of silence, which is after the speech."""
        ...

    def denormalise(self, poses: Array, at: Array, amplitude: Array | float = 1.0) -> Array:
        """Poses (N, n, D) in their own units, as far from the style's mean pose as the intensity says.

        Args:
            at: (n,) where they lie, in frames of the model.
            amplitude: (n, 1) further factor on that way.
        """
        ...

    def restyle(self, blend: StyleMixture, frame: int) -> None:
        """Another style, faded in from this frame of the model on; no row beyond it has been pushed yet."""
        ...

    def set_emotion(self, moods: Moods | None, time: float) -> None:
        """Other emotions from ``time`` seconds on, for a network that knows some; None: neutral."""
        ...
