"""Front-ends: they compute rows of features at the rate of the motion from speech in pieces of any size."""

from __future__ import annotations

from abc import ABC, abstractmethod
from fractions import Fraction
from math import floor
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .at_16_khz import At16kHz, HeldSamples
from .mel import RATE, Floats

if TYPE_CHECKING:
    from ..speech import Speech
    from .shared_prosody import SharedProsody

__all__ = ["StreamingFeatures"]


class StreamingFeatures(ABC):
    """Keeps data of the speech, samples or features of them, until no later row needs it.

    Args:
        fps: frames per second of the motion.
        nothing: (0, …) the data before anything was heard.

    Raises:
        InputError: fps is not a positive number.
    """

    delay: float
    """Seconds of 16 kHz sound after a frame's time that must have been heard before its row is certain."""

    def __init__(self, fps: float, nothing: Floats) -> None:
        if not 0 < fps < np.inf:
            raise InputError(f"{fps} frames per second", "a positive number, such as 20")
        self.fps = fps
        self._speech, self._queue = At16kHz(), HeldSamples()
        self._first, self._data = 0, nothing  # the data that is kept, and the index of its first row
        self._next = 0  # the next row to hand out
        self._none: Floats | None = None  # no rows, of the right width; every other piece of a stream gives it

    @property
    def duration(self) -> Fraction:
        """Seconds heard so far."""
        return self._speech.duration

    def share(self, prosody: SharedProsody) -> None:  # noqa: B027  # most compute their own
        """Take prosody that other listeners use, too, if rows are computed from it; call it before anything is pushed."""

    def push(self, chunk: Speech) -> Floats:
        """(n, C) float32: the rows that this piece makes certain; possibly none.

        Raises:
            InputError: the piece has another rate than those before, or the speech is over.
        """
        samples = self._speech.push(chunk)
        if self._none is not None and self._queue.is_short(samples, self._needs()):
            return self._none
        self._keep(self._convert(self._queue.take(samples)))
        return self._give(self._find_certain())

    def finish(self, frames: int | None = None) -> Floats:
        """The rest of the rows; frames after the end of the sound have the last of it.

        Args:
            frames: how many rows there shall be in all; ceil(duration × fps) where not given. Fewer than were handed out
                already are no error: then there is no rest.
        """
        from ..speech import count_frames

        total = count_frames(self.duration, self.fps) if frames is None else frames
        if not self._speech.finished:
            self._keep(self._convert(self._queue.take(self._speech.finish())))
            self._keep(self._rest())
        return self._give(max(total, self._next))

    def _find_certain(self) -> int:
        """The first frame whose row is not certain yet; in steps that double, and then halve."""
        until, step = self._next, 1
        while self._certain(until + step - 1):
            until, step = until + step, 2 * step
        while step > 1:
            step //= 2
            if self._certain(until + step - 1):
                until += step
        return until

    def _needs(self) -> int:
        """Samples after which the next row is certain; until then, the sound only waits."""
        return floor((self._next / self.fps + self.delay) * RATE)

    @property
    def _end(self) -> int:
        """Index after the last row of the data."""
        return self._first + len(self._data)

    def _keep(self, data: Floats) -> None:
        self._data = np.concatenate([self._data, data])

    def _give(self, until: int) -> Floats:
        """Rows up to ``until``; forgets what no later row needs."""
        if until == self._next and self._none is not None:
            return self._none
        rows = self._rows(np.arange(self._next, until))
        self._none = rows[:0] if self._none is None else self._none
        self._next = until
        excess = self._find_oldest(until) - self._first
        if excess > 0:
            self._first, self._data = self._first + excess, self._data[excess:].copy()
        return rows

    @abstractmethod
    def _convert(self, samples: Floats) -> Floats:
        """The data of samples at 16 kHz."""

    @abstractmethod
    def _rest(self) -> Floats:
        """Data to add when the sound is over."""

    @abstractmethod
    def _certain(self, frame: int) -> bool:
        """Whether all has been heard that the row of a frame needs; then the rows before it are certain, too."""

    @abstractmethod
    def _rows(self, frames: NDArray[np.int64]) -> Floats:
        """(n, C) float32 rows of frames, from the data."""

    @abstractmethod
    def _find_oldest(self, frame: int) -> int:
        """Index of the first data that the rows from this frame on need; it may not exceed the end of the data."""
