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
"""Seconds of speech that are played in one go when there is plenty to do [ours]. More take memory and save little time."""
_SAME_TIME = 1e-3  # s by which the start of a piece may differ from its place [ours: times are often rounded to milliseconds]


def speech_chunks(source: SpeechSource, tail: Fraction = Fraction(0)) -> Iterator[Speech]:
    """Pieces whose durations add up exactly to those of the file and the tail; words travel with the piece they start in.

    Args:
        source: the file.
        tail: seconds of silence that follow it.
    """
    words = list(source.words) if source.words is not None else None
    at, held = Fraction(0), None
    for block in _join_blocks(chain(source.blocks(), _silence(source, tail)), round(MOST_AT_ONCE * source.rate)):
        if held is not None:
            yield _chunk(held, source, at, Fraction(len(held), source.rate), words)
            at += Fraction(len(held), source.rate)
        held = block
    if held is not None and source.duration is not None:
        yield _chunk(held, source, at, source.duration + tail - at, words, last=True)


class PieceTimes:
    """Counts the times of pieces of a stream, and of their words, from the beginning of the stream.

    Pieces whose starts follow each other count from one origin. A piece whose start is elsewhere counts by itself, such as
    one that a text-to-speech begins at 0.

    >>> pieces, times = [Speech(np.zeros(1600, np.float32), start=start) for start in (4.0, 4.1, 0.0)], PieceTimes()
    >>> [times.count(piece, heard).start for piece, heard in zip(pieces, (0.0, 0.1, 0.25), strict=True)][::2]
    [0.0, 0.25]
    """

    def __init__(self) -> None:
        self._origin: float | None = None  # of the piece before, seconds

    def count(self, piece: Speech, heard: float) -> Speech:
        """The next piece, with its times; ``heard``: seconds of sound before it."""
        if self._origin is None or abs(piece.start - self._origin - heard) >= _SAME_TIME:
            self._origin = piece.start - heard
        return shift_times(piece, self._origin)


def _silence(source: SpeechSource, seconds: Fraction) -> Iterator[Samples]:
    """What follows the sound, once all of that has been read."""
    if seconds and source.duration is not None:
        count = count_frames(source.duration + seconds, source.rate) - source.frames(source.rate)
        for first in range(0, count, source.rate):
            yield np.zeros(min(source.rate, count - first), np.float32)


def _join_blocks(blocks: Iterable[Samples], size: int) -> Iterator[Samples]:
    """The same samples in blocks of this size; a decoder's own are short where a file has many samples a second."""
    held = np.zeros(0, np.float32)
    for block in blocks:
        held = np.concatenate([held, block])
        while len(held) >= size:
            yield held[:size]
            held = held[size:]
    if len(held):
        yield held


def _chunk(
    block: Samples, source: SpeechSource, at: Fraction, duration: Fraction, words: list[Word] | None, *, last: bool = False
) -> Speech:
    """One piece; takes the words that start in it off the list."""
    spoken: tuple[Word, ...] | None = None
    if words is not None:
        end = inf if last else float(at + duration)
        count = next((i for i, word in enumerate(words) if word.start >= end), len(words))
        spoken = tuple(words[:count])
        del words[:count]
    return Speech(block, source.rate, spoken, name=source.name, start=float(at), duration=duration)
