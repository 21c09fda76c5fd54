"""Frames of a trained session that wait for others."""

from __future__ import annotations

import numpy as np

from ..motion.rotations import Array

__all__ = ["WaitingFrames"]


class WaitingFrames:
    """Frames of arrays that lie side by side, in pieces, until they are wanted."""

    def __init__(self) -> None:
        self._pieces: list[tuple[Array, ...]] = []
        self._frames = 0

    def __len__(self) -> int:
        return self._frames

    def push(self, piece: tuple[Array, ...]) -> None:
        """What comes next."""
        self._pieces.append(piece)
        self._frames += len(piece[0])

    def take(self, count: int) -> tuple[Array, ...]:
        """The first frames, which wait no more."""
        if len(self._pieces) > 1 and len(self._pieces[0][0]) < count:
            self._pieces = [tuple(np.concatenate(arrays) for arrays in zip(*self._pieces, strict=True))]
        first, self._frames = self._pieces[0], self._frames - count
        rest = tuple(array[count:] for array in first)
        self._pieces[:1] = [rest] if len(rest[0]) else []
        return tuple(array[:count] for array in first)
