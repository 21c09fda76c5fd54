"""Speech on its way to a network: brought to 16 kHz once for all who listen, and held until there is enough to be worth a look."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from ..audio.features.at_16_khz import At16kHz
from ..audio.features.mel import RATE, Floats
from ..audio.speech import SPARE, Speech, Word

__all__ = ["HeldSpeech"]


class HeldSpeech:
    """Pieces of speech of one rate, whichever → the same speech at 16 kHz, in pieces that may be held back and joined.

    >>> held = HeldSpeech()
    >>> for piece in Speech(np.zeros(9600, np.float32), 48_000).chunks(0.02):
    ...     held.hold(held.convert(piece))
    >>> held.hold(held.end()), len(held.take()), held.heard
    (None, 3200, 3200)
    """

    def __init__(self) -> None:
        self._sound = At16kHz()
        self._pieces: list[Speech] = []
        self._owed = Fraction(0)
        self.heard = 0
        """Samples at 16 kHz that were converted so far."""

    def convert(self, piece: Speech) -> Speech:
        """The same piece at 16 kHz: what the resampler makes certain of it, with all of its words and its length."""
        samples = self._sound.push(piece)
        if piece.rate == RATE:
            self.heard += len(samples)
            return piece
        return self._as_speech(samples, piece.words, piece.start, piece.duration)

    def end(self) -> Speech:
        """What the resampler has kept; nothing at 16 kHz."""
        return self._as_speech(self._sound.finish(), None, float(self._sound.duration), Fraction(0))

    def _as_speech(self, samples: Floats, words: tuple[Word, ...] | None, start: float, duration: Fraction) -> Speech:
        """A piece; a length that its samples do not yet come near is owed to the next one."""
        self.heard += len(samples)
        self._owed += duration
        length = min(self._owed, Fraction(len(samples), RATE) + SPARE)
        self._owed -= length
        return Speech(samples, RATE, words, start=start, duration=length)

    @property
    def seconds(self) -> float:
        """Of what is held."""
        return sum(len(piece) for piece in self._pieces) / RATE

    def hold(self, piece: Speech) -> None:
        """Keep a piece at 16 kHz."""
        self._pieces.append(piece)

    def take(self) -> Speech | None:
        """All that is held, as one piece; None where there is nothing."""
        pieces, self._pieces = self._pieces, []
        if len(pieces) < 2:
            return pieces[0] if pieces else None
        said = [piece.words for piece in pieces if piece.words is not None]
        words = tuple(word for each in said for word in each) if said else None
        samples = np.concatenate([piece.samples for piece in pieces])
        length = sum((piece.duration for piece in pieces), Fraction(0))
        return Speech(samples, RATE, words, start=pieces[0].start, duration=length)
