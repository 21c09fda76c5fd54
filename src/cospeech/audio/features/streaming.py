"""Front-ends: speech that arrives in pieces of any size → rows of features at the rate of the motion, the same ones always."""

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
    """What is heard is kept, samples or what was made of them, until no later row needs it.

    Args:
        fps: frames per second of the motion.
        nothing: (0, …) what is kept, while nothing was heard.

    Raises:
        InputError: fps is not a positive number.
    """

    delay: float
    """Seconds of 16 kHz sound after a frame's time that must have been heard before its row is certain."""

    def __init__(self, fps: float, nothing: Floats) -> None:
        if not 0 < fps < np.inf:
            raise InputError(f"{fps} frames per second", "a positive number, such as 20")
        self.fps = fps
        self._speech, self._held = At16kHz(), HeldSamples()
        self._first, self._heard = 0, nothing  # what is kept, and the index of its first
        self._given = 0  # rows handed out
        self._none: Floats | None = None  # no rows, of their width; asked for at every other piece of a stream

    @property
    def duration(self) -> Fraction:
        """Seconds heard so far."""
        return self._speech.duration

    def share(self, prosody: SharedProsody) -> None:  # noqa: B027  # most hear by themselves
        """Hear with what others hear, too, where the rows are made of that; before anything is pushed."""

    def push(self, chunk: Speech) -> Floats:
        """(n, C) float32: the rows that this piece makes certain; possibly none.

        Raises:
            InputError: the piece has another rate than those before, or the speech is over.
        """
        samples = self._speech.push(chunk)
        if self._none is not None and self._held.is_short(samples, self._needs()):
            return self._none
        self._keep(self._convert(self._held.take(samples)))
        return self._give(self._find_certain())

    def finish(self, frames: int | None = None) -> Floats:
        """The rest of the rows; frames after the end of the sound have what was heard last.

        Args:
            frames: how many rows there shall be in all; ceil(duration × fps) where not given. Fewer than were handed out
                already are no error: then there is no rest.
        """
        from ..speech import count_frames

        total = count_frames(self.duration, self.fps) if frames is None else frames
        if not self._speech.finished:
            self._keep(self._convert(self._held.take(self._speech.finish())))
            self._keep(self._rest())
        return self._give(max(total, self._given))

    def _find_certain(self) -> int:
        """The first frame whose row is not certain yet; in steps that double, and then halve."""
        until, step = self._given, 1
        while self._certain(until + step - 1):
            until, step = until + step, 2 * step
        while step > 1:
            step //= 2
            if self._certain(until + step - 1):
                until += step
        return until

    def _needs(self) -> int:
        """Samples after which the next row is certain; more of the sound is not looked at before."""
        return floor((self._given / self.fps + self.delay) * RATE)

    @property
    def _end(self) -> int:
        """Index behind the last that was heard."""
        return self._first + len(self._heard)

    def _keep(self, heard: Floats) -> None:
        self._heard = np.concatenate([self._heard, heard])

    def _give(self, until: int) -> Floats:
        """Rows up to ``until``; forgets what no later row needs."""
        if until == self._given and self._none is not None:
            return self._none
        rows = self._rows(np.arange(self._given, until))
        self._none = rows[:0] if self._none is None else self._none
        self._given = until
        done = self._find_oldest(until) - self._first
        if done > 0:
            self._first, self._heard = self._first + done, self._heard[done:].copy()
        return rows

    @abstractmethod
    def _convert(self, samples: Floats) -> Floats:
        """What is kept of samples at 16 kHz."""

    @abstractmethod
    def _rest(self) -> Floats:
        """What is kept besides when the sound is over."""

    @abstractmethod
    def _certain(self, frame: int) -> bool:
        """Whether all has been heard that the row of a frame is made of; then it is for the frames before, too."""

    @abstractmethod
    def _rows(self, frames: NDArray[np.int64]) -> Floats:
        """(n, C) float32 rows of frames, of what is kept."""

    @abstractmethod
    def _find_oldest(self, frame: int) -> int:
        """Index of the first that the rows from this frame on need, and that is there."""
