"""Mix several sound files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from os import PathLike

import numpy as np

from .speech import Samples, SpeechSource

__all__ = ["SoundMix"]


class SoundMix:
    """Adds up files that begin at the same moment; where one is over, the others go on.

    Args:
        paths: the files, one or more.
        rate: samples per second of what comes out.

    Raises:
        InputError: one cannot be read.
    """

    def __init__(self, paths: Sequence[str | PathLike[str]], rate: int) -> None:
        with ExitStack() as stack:
            self._sources = [stack.enter_context(SpeechSource(path, rate)) for path in paths]
            self._stack = stack.pop_all()

    def blocks(self) -> Iterator[Samples]:
        """The sum, in blocks of any size."""
        streams = [source.blocks() for source in self._sources]
        blocks: list[Samples | None] = [next(stream, None) for stream in streams]
        while any(block is not None for block in blocks):
            count = min(len(block) for block in blocks if block is not None)
            yield np.sum([block[:count] for block in blocks if block is not None], axis=0, dtype=np.float32)
            for k, block in enumerate(blocks):
                if block is not None:
                    blocks[k] = block[count:] if len(block) > count else next(streams[k], None)

    def close(self) -> None:
        """End all decoders."""
        self._stack.close()
