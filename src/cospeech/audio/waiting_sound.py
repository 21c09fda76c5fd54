"""A queue of sound that has come and was not heard yet. One thread puts it, another one takes it, and it can be dropped."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .speech import Speech

__all__ = ["WaitingSound"]

Samples = NDArray[np.float32]


class WaitingSound:
    """Blocks of samples in a queue. Places in the sound are counted in samples, from the first one that came.

    Args:
        most: samples that may wait; a thread that puts more has to wait, or the oldest are dropped.
    """

    def __init__(self, most: int) -> None:
        self._most, self._count = most, 0
        self._blocks: deque[tuple[int, Samples]] = deque()  # each with the place of its end
        self._condition, self._is_ended = threading.Condition(), False
        self._error: Exception | None = None
        self.received, self.taken, self.dropped = 0, 0, 0
        """Places: the end of what came, the end of what was taken, and the end of what was dropped."""
        self.piece = 0
        """Place of the first sample of the piece that is heard now; the maker of pieces sets it."""

    @property
    def is_over(self) -> bool:
        """Whether all was taken, no more comes, and no error is to be raised."""
        with self._condition:
            return self._is_ended and not self._blocks and self._error is None

    def put(self, block: Samples, *, wait: bool = True) -> None:
        """Add a block, as soon as there is room. It is forgotten if it is dropped before.

        Args:
            block: (n,) samples.
            wait: until there is room; else the oldest samples go, so that never more than ``most`` wait.
        """
        with self._condition:
            self.received += len(block)
            end = self.received
            if wait:
                self._condition.wait_for(lambda: self._count < self._most or self.dropped >= end)
            else:
                block = block[-self._most :]
                while self._count + len(block) > self._most:
                    self._forget_oldest()
            if self.dropped < end:
                self._blocks.append((end, block))
                self._count += len(block)
                self._condition.notify_all()

    def end(self, error: Exception | None = None) -> None:
        """End the sound, because of this error or because it is over."""
        with self._condition:
            self._is_ended, self._error = True, error
            self._condition.notify_all()

    def take(self, timeout: float | None) -> Samples | None:
        """The next block; None where none comes within ``timeout`` seconds, or ever.

        Raises:
            Exception: the error that ended the sound, after its last block.
        """
        with self._condition:
            self._condition.wait_for(lambda: self._blocks or self._is_ended, timeout)
            if not self._blocks:
                if self._error is not None:
                    raise self._error
                return None
            self.taken, block = self._blocks.popleft()
            self._count -= len(block)
            self._condition.notify_all()
        return block

    def drop(self, before: int) -> None:
        """Forget all blocks that end at this place or before it."""
        with self._condition:
            self.dropped = max(self.dropped, before)
            while self._blocks and self._blocks[0][0] <= before:
                self._forget_oldest()
            self._condition.notify_all()

    def _forget_oldest(self) -> None:
        self.taken, block = self._blocks.popleft()
        self._count -= len(block)

    def mute_piece(self, piece: Speech) -> Speech:
        """The piece that is heard now, with silence in the place of samples that were dropped."""
        many = self.dropped - self.piece
        if many <= 0:
            return piece
        samples = piece.samples.copy()
        samples[:many] = 0
        return replace(piece, samples=samples)
