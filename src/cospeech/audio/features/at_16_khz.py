"""Resample speech that arrives in pieces to the rate at which features are computed."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from .mel import RATE, Floats

if TYPE_CHECKING:
    from ..speech import Speech

__all__ = ["At16kHz", "HeldSamples"]


class At16kHz:
    """Resamples pieces of any size and of any one rate to 16 kHz; the samples do not depend on how the speech is cut.

    >>> from cospeech.audio.speech import Speech
    >>> stream = At16kHz()
    >>> len(stream.push(Speech(np.zeros(4800, np.float32), 48_000))) + len(stream.finish())
    1600
    """

    def __init__(self) -> None:
        self.duration = Fraction(0)
        """Seconds heard so far."""
        self.finished = False
        self._resampler: Any = None
        self._rate: int | None = None

    def push(self, chunk: Speech) -> Floats:
        """(n,) the samples that this piece makes certain; possibly none.

        Raises:
            InputError: the piece has another rate than those before, or the speech is over.
        """
        if self.finished or self._rate not in (None, chunk.rate):
            was = "the speech is over" if self.finished else f"the speech began at {self._rate} Hz"
            raise InputError(f"a piece of speech at {chunk.rate} Hz, but {was}", "one stream, one rate, one speech")
        self._rate = chunk.rate
        self.duration += chunk.duration
        if chunk.rate == RATE:
            return chunk.samples
        if self._resampler is None:
            from soxr import ResampleStream  # its output does not depend on the pieces either

            self._resampler = ResampleStream(chunk.rate, RATE, 1, "float32", "HQ")
        return self._resampler.resample_chunk(chunk.samples)  # type: ignore[no-any-return]

    def finish(self) -> Floats:
        """(n,) the rest; none at a second call."""
        nothing = np.zeros(0, np.float32)
        if self.finished or self._resampler is None:
            self.finished = True
            return nothing
        self.finished = True
        return self._resampler.resample_chunk(nothing, last=True)  # type: ignore[no-any-return]


class HeldSamples:
    """Keeps samples until there are enough of them: to process many small pieces costs more than a few large ones.

    It keeps copies: a caller may fill one buffer again and again, as drivers of sound do.

    >>> held = HeldSamples()
    >>> held.is_short(np.zeros(320, np.float32), 1000), held.is_short(np.zeros(700, np.float32), 1000)
    (True, False)
    >>> len(held.take(np.zeros(700, np.float32)))
    1020
    """

    def __init__(self) -> None:
        self._pieces: list[Floats] = []
        self._count, self._start = 0, 0

    def is_short(self, samples: Floats, minimum: int) -> bool:
        """Whether there are fewer than ``minimum`` samples since the beginning, with these; then a copy of these is kept."""
        if self._start + self._count + len(samples) >= minimum:
            return False
        self._pieces.append(samples.copy())
        self._count += len(samples)
        return True

    def take(self, samples: Floats) -> Floats:
        """All samples that are kept, and these."""
        self._start += self._count + len(samples)
        if not self._pieces:
            return samples
        pieces, self._pieces, self._count = [*self._pieces, samples], [], 0
        return np.concatenate(pieces)
