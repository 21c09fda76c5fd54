"""Words → numbers per frame: which word is spoken when, and the subwords that stand for it in a learnt table. NumPy only.

As in fastText (Bojanowski et al. 2017) a word is the mean of rows of a table: its own and those of its character n-grams, which
a hash finds. So every word of every language has numbers, and "gesture" and "gestures" share most of theirs. A word has at most
`GRAMS` rows here: its own, and of its n-grams those with the smallest hashes, which of two words are the same in about the
proportion in which the words' n-grams are (Broder 1997).
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..word import is_spoken

if TYPE_CHECKING:
    from ..speech import Speech, Word

__all__ = ["BUCKETS", "GRAMS", "WordStream", "plain_word", "spans", "subword_rows", "subwords", "word_ids"]

GRAMS = 12
"""Rows of the table per word, itself included; ours: all that words of up to four letters have."""
BUCKETS = 2000
"""Rows of the table, beside that of nothing; ours: a table small enough to learn from hours of speech."""
_LENGTHS = (3, 4, 5)  # of n-grams; fastText's vectors for 157 languages have 5, those of Bojanowski et al. 2017 3 to 6
_LONGEST = 64  # letters of a word that count; ours: no language's words are longer but in jest
_BASIS, _PRIME = 2166136261, 16777619  # FNV-1a of 32 bits (Fowler, Noll, Vo), as in fastText
_WHOLE = "LNM"  # Unicode's letters, numbers and marks: what a word begins and ends with
_SLACK = 1e-6  # frames; ours: far above the rounding of a time, far below what shifts a word


def plain_word(text: str) -> str:
    """A word in lower case and in Unicode's compatible form, without the signs before and behind it; at most 64 characters.

    >>> plain_word("“Don't!”"), plain_word("…"), plain_word("ＦＵＬＬ")
    ("don't", '', 'full')
    """
    word = unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", text[: 4 * _LONGEST]).lower())
    whole = [k for k, character in enumerate(word) if unicodedata.category(character)[0] in _WHOLE]
    return word[whole[0] : whole[-1] + 1][:_LONGEST] if whole else ""


def _hash(text: str) -> int:
    value = _BASIS
    for byte in text.encode("utf-8", "surrogatepass"):
        value = (value ^ byte) * _PRIME & 0xFFFFFFFF
    return value


@lru_cache(4096)
def _buckets(word: str) -> tuple[int, ...]:
    text = f"<{word}>"
    grams = {text[k : k + n] for n in _LENGTHS for k in range(len(text) - n + 1)} - {text}
    hashes = [_hash(text), *sorted(map(_hash, grams))[: GRAMS - 1]]
    return tuple(1 + value % BUCKETS for value in hashes) + (0,) * (GRAMS - len(hashes))


def subwords(word: str | None) -> NDArray[np.int32]:
    """(GRAMS,) rows 1 … BUCKETS of the table that stand for a word: the whole word's first, 0 behind the last; no word: all 0.

    >>> subwords("Hello!")[:3].tolist() == subwords("hello")[:3].tolist(), bool(subwords("...").any()), len(subwords(None))
    (True, False, 12)
    """
    plain = plain_word(word) if word else ""
    return np.array(_buckets(plain) if plain else (0,) * GRAMS, np.int32)


def subword_rows(words: Sequence[str | None]) -> NDArray[np.int32]:
    """(T, GRAMS) of the words of T frames."""
    return np.array([subwords(word) for word in words], np.int32).reshape(-1, GRAMS)


def spans(words: Iterable[Word], fps: float) -> list[tuple[int, int, str]]:
    """(first frame, frame after the last, word) of what is said: the frames nearest to its start and end; one at least."""
    firsts = [(max(0, _frame(word.start, fps)), word) for word in words if is_spoken(word.text)]
    return [(first, max(first + 1, _frame(word.end, fps)), word.text) for first, word in firsts]


def _frame(seconds: float, fps: float) -> int:
    return round(seconds * fps)


def word_ids(words: Iterable[Word], frames: int, fps: float) -> list[str | None]:
    """The word that is spoken at each frame, None in silence; where two overlap, the later one.

    >>> from cospeech.audio.speech import Word
    >>> word_ids([Word("so", 0.1, 0.2), Word("well", 0.2, 0.4)], 5, 10)
    [None, 'so', 'well', 'well', None]
    """
    ids: list[str | None] = [None] * frames
    for first, end, text in spans(words, fps):
        for frame in range(first, min(end, frames)):
            ids[frame] = text
    return ids


class WordStream:
    """`word_ids` of speech in pieces. They do not depend on the pieces, because each word comes with the piece in which it
    starts.

    Args:
        fps: frames per second.

    Raises:
        InputError: fps is not a positive number.
    """

    def __init__(self, fps: float) -> None:
        if not 0 < fps < np.inf:
            raise InputError(f"{fps} frames per second", "a positive number, such as 15")
        self.fps = fps
        self.delay = 0.5 / fps
        """Seconds after a frame's time that must have been heard before its word is certain."""
        self.duration = Fraction(0)
        """Seconds heard so far."""
        self._waiting: list[tuple[int, int, str]] = []
        self._next = 0

    def push(self, chunk: Speech) -> list[str | None]:
        """The frames that this piece makes certain: at each the word, or None."""
        self.duration += chunk.duration
        self._waiting += spans(chunk.words or (), self.fps)
        return self._give(max(self._next, round(float(self.duration) * self.fps - _SLACK)))

    def finish(self, frames: int | None = None) -> list[str | None]:
        """The rest, to so many frames in all; ceil(duration × fps) where not given."""
        from ..speech import count_frames

        total = count_frames(self.duration, self.fps) if frames is None else frames
        return self._give(max(total, self._next))

    def _give(self, until: int) -> list[str | None]:
        ids: list[str | None] = [None] * (until - self._next)
        for first, end, text in self._waiting:
            for frame in range(max(first, self._next), min(end, until)):
                ids[frame - self._next] = text
        self._next = until
        self._waiting = [span for span in self._waiting if span[1] > until]
        return ids
