"""A temporary file that takes frames as they come, and gives each track in one piece."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..errors import InputError
from ..files import describe_os_error
from ..motion.rotations import Array

__all__ = ["FrameBuffer"]

_BLOCK = 1024  # frames per block; ours: 64 joints make 1 MiB, and 3 hours make 316 seeks per track


class FrameBuffer:
    """Frames in, tracks out, in constant memory.

    Motion arrives frame by frame (all joints), but files want track by track (all frames). Blocks of 1,024 frames are
    written transposed, so that reading a track back is one seek per block.

    Args:
        widths: number of float32 values per frame in each track.
        folder: where the temporary file lives (beside the file to be, where there is room for it).
    """

    def __init__(self, widths: Sequence[int], folder: Path) -> None:
        self.widths, self.frames = tuple(widths), 0
        self._starts = np.concatenate([[0], np.cumsum(self.widths)]).astype(int)
        self._pending = np.empty((_BLOCK, self._starts[-1]), "<f4")
        self._count = 0
        self.lows = np.full(self._starts[-1], np.inf)
        self.highs = np.full(self._starts[-1], -np.inf)
        try:
            self._file: BinaryIO = tempfile.TemporaryFile(dir=folder)  # type: ignore[assignment]  # noqa: SIM115 (close() ends it)
        except OSError as error:
            raise InputError(f"cannot write in {str(folder)!r}: {describe_os_error(error)}") from None

    def add(self, rows: Array) -> None:
        """Append frames ``(T, sum of widths)``."""
        rows = np.asarray(rows, "<f4")
        if len(rows):
            self.lows, self.highs = np.minimum(self.lows, rows.min(0)), np.maximum(self.highs, rows.max(0))
        while len(rows):
            some = rows[: _BLOCK - self._count]
            self._pending[self._count : self._count + len(some)] = some
            self._count += len(some)
            self.frames += len(some)
            rows = rows[len(some) :]
            if self._count == _BLOCK:
                self._flush()

    def _flush(self) -> None:
        for a, b in zip(self._starts[:-1], self._starts[1:], strict=True):
            self._file.write(np.ascontiguousarray(self._pending[: self._count, a:b]).tobytes())
        self._count = 0

    def constant(self, track: int) -> bool:
        """Whether all frames of a track are the same."""
        columns = slice(self._starts[track], self._starts[track + 1])
        return self.frames > 0 and bool(np.all(self.lows[columns] == self.highs[columns]))

    def blocks(self, track: int) -> Iterator[Array]:
        """The frames of one track in order, as float32 arrays ``(≤ 1024, width)``."""
        tail = self._count
        first, row = 0, int(self._starts[-1]) * 4
        width = self.widths[track]
        while first < self.frames - tail:
            self._file.seek(first * row + int(self._starts[track]) * 4 * _BLOCK)
            yield np.frombuffer(self._file.read(_BLOCK * width * 4), "<f4").reshape(-1, width)
            first += _BLOCK
        if tail:
            yield self._pending[:tail, self._starts[track] : self._starts[track + 1]]
        self._file.seek(0, 2)

    def close(self) -> None:
        """Remove the temporary file."""
        self._file.close()
