"""Cut several streams of motion at the same frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from .motion import Motion

__all__ = ["cut_alike"]


def cut_alike(streams: Sequence[Iterator[Motion]]) -> Iterator[list[Motion]]:
    """Yield pieces of several motions as they come: the same frames of each, until the shortest ends."""
    buffer = [next(motion, None) for motion in streams]
    while all(piece is not None for piece in buffer):
        pieces = [piece for piece in buffer if piece is not None]
        count = min(map(len, pieces))
        if count:
            yield [piece[:count] for piece in pieces]
        buffer = [
            piece[count:] if len(piece) > count else next(motion, None) for piece, motion in zip(pieces, streams, strict=True)
        ]
