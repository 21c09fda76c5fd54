"""Merge the channels of a sound file."""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce

import numpy as np
from numpy.typing import NDArray

__all__ = ["ChannelMerge"]

Samples = NDArray[np.float32]

AUDIBLE = 1e-3  # ours: RMS of -60 dBFS, above the noise floor of most microphones
CANCELLATION = 0.14  # ours: share of the RMS of a mean of as many unrelated channels; for two, 20 dB below the louder one
_MEAN = -1  # instead of the number of a channel


class ChannelMerge:
    """Merges channels in a stream: to the mean, or to the loudest if they cancel out (decided once, in the first audible
    second).

    Args:
        channels: how many there are.
        rate: samples per second.
        pick: the only channel to use, from 0 on.
    """

    def __init__(self, channels: int, rate: int, pick: int | None = None) -> None:
        self._channels, self._rate = channels, rate
        self._pick = pick  # None: not decided yet
        self._waiting: list[Samples] = []

    def push(self, block: Samples) -> Iterator[Samples]:
        if self._channels == 1:
            yield block[:, 0]
            return
        self._waiting.append(block)
        if self._pick is not None or sum(map(len, self._waiting)) >= self._rate:
            yield from self.flush()

    def flush(self) -> Iterator[Samples]:
        if not self._waiting:
            return
        block = np.concatenate(self._waiting) if len(self._waiting) > 1 else self._waiting[0]
        self._waiting = []
        if self._pick is None or self._pick == _MEAN:
            # not through BLAS: the same bits on any number of threads
            mean = reduce(np.add, block.T) / np.float32(self._channels)
            if self._pick is None:
                self._pick = self._decide(block, mean)
        yield mean if self._pick in (None, _MEAN) else np.ascontiguousarray(block[:, self._pick])

    def _decide(self, block: Samples, mean: Samples) -> int | None:
        """Choose a channel or the mean; None where nothing is audible yet."""
        loudness = np.sqrt(np.mean(np.square(block), axis=0))
        if not loudness.max() > AUDIBLE:
            return None
        reference = loudness.max() / np.sqrt(self._channels)
        is_cancelled = np.sqrt(np.mean(np.square(mean))) < CANCELLATION * reference
        return int(loudness.argmax()) if is_cancelled else _MEAN
