"""Compute prosody once for all listeners to the same speech: the rules, a mouth, a network."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from .mel import Floats
from .prosody import Features, ProsodyStream

__all__ = ["Prosody", "SharedProsody"]


class Prosody(Protocol):
    """The interface of `ProsodyStream`."""

    def push(self, samples: Floats) -> Features:
        """The frames that become certain; possibly none."""
        ...

    def flush(self) -> Features:
        """The rest."""
        ...


class SharedProsody:
    """One `ProsodyStream` with mel bands for several listeners. Each listener pushes all samples, in pieces of any size.

    A listener that is behind gets, with its next piece, all frames that others have made certain: the same frames, earlier.

    >>> shared = SharedProsody()
    >>> one, other = shared.tap(), shared.tap()
    >>> sound = np.zeros(3200, np.float32)
    >>> len(one.push(sound)), len(other.push(sound[:1])), len(other.push(sound[1:])), len(one.flush()), len(other.flush())
    (16, 16, 0, 5, 5)
    """

    def __init__(self) -> None:
        self._stream = ProsodyStream(mel=True)
        self._nothing = self._stream.push(np.zeros(0, np.float32))
        self.samples, self._over = 0, False
        """Samples that at least one listener has pushed, in all."""
        self._first, self._pieces = 0, list[Features]()  # pieces that a listener has not had yet, and the number of the first
        self._had: list[int] = []  # pieces, of each listener

    def tap(self) -> Prosody:
        """Add a listener, before anything is pushed."""
        self._had.append(0)
        return _Tap(self, len(self._had) - 1)

    def hear(self, samples: Floats, end: int) -> None:
        """Take samples that end at this place of the speech; those that were taken before are skipped."""
        new = end - self.samples
        if new > 0 and not self._over:
            self.samples = end
            self._keep(self._stream.push(samples[len(samples) - new :]))

    def end(self) -> None:
        """The speech is over."""
        if not self._over:
            self._over = True
            self._keep(self._stream.flush())

    def take(self, who: int) -> Features:
        """The frames that a listener has not had yet."""
        pieces = self._pieces[self._had[who] - self._first :]
        self._had[who] += len(pieces)
        old = min(self._had) - self._first
        del self._pieces[:old]
        self._first += old
        if len(pieces) < 2:
            return pieces[0] if pieces else self._nothing
        return Features.concatenate(pieces)

    def _keep(self, features: Features) -> None:
        if len(features):
            self._pieces.append(features)


class _Tap:
    """One listener of a `SharedProsody`; see `Prosody`."""

    def __init__(self, source: SharedProsody, number: int) -> None:
        self._source, self._number, self._samples = source, number, 0

    def push(self, samples: Floats) -> Features:
        self._samples += len(samples)
        self._source.hear(samples, self._samples)
        return self._source.take(self._number)

    def flush(self) -> Features:
        self._source.end()
        return self._source.take(self._number)
