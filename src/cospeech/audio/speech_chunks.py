"""A sound file as pieces of speech, in constant memory."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from fractions import Fraction
from itertools import chain
from math import inf

import numpy as np

from .speech import Samples, Speech, SpeechSource, Word, count_frames, shift_times

__all__ = ["MOST_AT_ONCE", "PieceTimes", "speech_chunks"]

MOST_AT_ONCE = 8.0
"""Seconds of speech that are processed at once where there is enough of it [ours]. More take memory and save little time."""
_SAME_TIME = 1e-3  # s by which the start of a piece may differ from its place [ours: times are often rounded to milliseconds]


def speech_chunks(source: SpeechSource, tail: Fraction = Fraction(0)) -> Iterator[Speech]:
    """Pieces whose durations add up exactly to those of the file and the tail; words travel with the piece they start in.

    Args:
        source: the file.
        tail: seconds of silence that follow it.
    """
    words = list(source.words) if source.words is not None else None
    at, before = Fraction(0), None
    for block in _join_blocks(chain(source.blocks(), _silence(source, tail)), round(MOST_AT_ONCE * source.rate)):
        if before is not None:
            yield _chunk(before, source, at, Fraction(len(before), source.rate), words)
            at += Fraction(len(before), source.rate)
        before = block
    if before is not None and source.duration is not None:
        yield _chunk(before, source, at, source.duration + tail - at, words, last=True)


class PieceTimes:
    """Counts the times of pieces of a stream, and of their words, from the beginning of the stream.

    Pieces whose starts follow each other count from one origin. A piece whose start is elsewhere counts by itself, such as
    one that a text-to-speech begins at 0.

    >>> pieces, times = [Speech(np.zeros(1600, np.float32), start=start) for start in (4.0, 4.1, 0.0)], PieceTimes()
    >>> [times.count(piece, before).start for piece, before in zip(pieces, (0.0, 0.1, 0.25), strict=True)][::2]
    [0.0, 0.25]
    """

    def __init__(self) -> None:
        self._origin: float | None = None  # of the piece before, seconds

    def count(self, piece: Speech, seconds: float) -> Speech:
        """The next piece, with its times; ``seconds``: of sound before it."""
        if self._origin is None or abs(piece.start - self._origin - seconds) >= _SAME_TIME:
            self._origin = piece.start - seconds
        return shift_times(piece, self._origin)


def _silence(source: SpeechSource, seconds: Fraction) -> Iterator[Samples]:
    """Silence that follows the sound, once all of the sound has been read."""
    if seconds and source.duration is not None:
        count = count_frames(source.duration + seconds, source.rate) - source.frames(source.rate)
        for first in range(0, count, source.rate):
            yield np.zeros(min(source.rate, count - first), np.float32)


def _join_blocks(blocks: Iterable[Samples], size: int) -> Iterator[Samples]:
    """The same samples in blocks of this size; a decoder's own are short where a file has many samples a second."""
    rest = np.zeros(0, np.float32)
    for block in blocks:
        rest = np.concatenate([rest, block])
        while len(rest) >= size:
            yield rest[:size]
            rest = rest[size:]
    if len(rest):
        yield rest


def _chunk(
    block: Samples, source: SpeechSource, at: Fraction, duration: Fraction, words: list[Word] | None, *, last: bool = False
) -> Speech:
    """One piece, with the words that start in it; they are removed from the list."""
    own_words: tuple[Word, ...] | None = None
    if words is not None:
        end = inf if last else float(at + duration)
        count = next((i for i, word in enumerate(words) if word.start >= end), len(words))
        own_words = tuple(words[:count])
        del words[:count]
    return Speech(block, source.rate, own_words, name=source.name, start=float(at), duration=duration)
