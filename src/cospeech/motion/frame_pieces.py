"""Streams of motion, cut at the same frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from .motion import Motion

__all__ = ["cut_alike"]


def cut_alike(moving: Sequence[Iterator[Motion]]) -> Iterator[list[Motion]]:
    """Pieces of several motions as they come: the same frames of each, until the shortest is over."""
    held = [next(motion, None) for motion in moving]
    while all(piece is not None for piece in held):
        pieces = [piece for piece in held if piece is not None]
        count = min(map(len, pieces))
        if count:
            yield [piece[:count] for piece in pieces]
        held = [
            piece[count:] if len(piece) > count else next(motion, None) for piece, motion in zip(pieces, moving, strict=True)
        ]
