"""Several sound files, heard together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from os import PathLike

import numpy as np

from .speech import Samples, SpeechSource

__all__ = ["SoundMix"]


class SoundMix:
    """Files that begin at the same moment, added up; where one is over, the others go on.

    Args:
        paths: the files, one or more.
        rate: samples per second of what comes out.

    Raises:
        InputError: one cannot be read.
    """

    def __init__(self, paths: Sequence[str | PathLike[str]], rate: int) -> None:
        with ExitStack() as opened:
            self._sources = [opened.enter_context(SpeechSource(path, rate)) for path in paths]
            self._opened = opened.pop_all()

    def blocks(self) -> Iterator[Samples]:
        """The sum, in blocks of any size."""
        streams = [source.blocks() for source in self._sources]
        held: list[Samples | None] = [next(stream, None) for stream in streams]
        while any(block is not None for block in held):
            count = min(len(block) for block in held if block is not None)
            yield np.sum([block[:count] for block in held if block is not None], axis=0, dtype=np.float32)
            for k, block in enumerate(held):
                if block is not None:
                    held[k] = block[count:] if len(block) > count else next(streams[k], None)

    def close(self) -> None:
        """End all decoders."""
        self._opened.close()
