"""Small pieces of speech that wait until they are long enough to be heard together."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import inf

import numpy as np

from ..audio.speech import Speech

__all__ = ["WaitingSpeech"]


class WaitingSpeech:
    """Pieces of one rate that wait, and are taken as one.

    >>> held = WaitingSpeech()
    >>> for piece in Speech(np.zeros(1600, np.float32)).chunks(0.02):
    ...     held.hold(piece)
    >>> held.seconds, held.heard, len(held.take()), held.take() is None
    (0.1, 1600, 1600, True)
    """

    def __init__(self) -> None:
        self._pieces: list[Speech] = []
        self._count = 0
        self.heard = 0
        """Samples that came, in all."""

    @property
    def seconds(self) -> float:
        """Of what is held."""
        return self._count / self._pieces[0].rate if self._pieces else 0.0

    @property
    def begin(self) -> int:
        """Samples before those that are held, in all."""
        return self.heard - self._count

    def hold(self, piece: Speech) -> None:
        """Keep a copy of a piece: a caller may fill one buffer again and again."""
        self._pieces.append(replace(piece, samples=piece.samples.copy()))
        self._count += len(piece)
        self.heard += len(piece)

    def take(self, until: float = inf) -> Speech | None:
        """What is held up to a place in samples, counted from the beginning, as one piece; None where there is nothing."""
        end, count = self.heard - self._count, 0
        for piece in self._pieces:
            if end + len(piece) > until:
                break
            end, count = end + len(piece), count + 1
        pieces, self._pieces, self._count = self._pieces[:count], self._pieces[count:], self.heard - end
        if len(pieces) < 2:
            return pieces[0] if pieces else None
        word_lists = [piece.words for piece in pieces if piece.words is not None]
        words = tuple(word for each in word_lists for word in each) if word_lists else None
        samples = np.concatenate([piece.samples for piece in pieces])
        length = sum((piece.duration for piece in pieces), Fraction(0))
        return Speech(samples, pieces[0].rate, words, start=pieces[0].start, duration=length)
