"""Words that come beside live sound. They wait until the piece of sound in which they start is heard."""

from __future__ import annotations

import threading
from bisect import insort
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace

from ..errors import InputError
from ..limits import WORDS
from .speech import Speech, Word
from .transcripts import cut_overlaps
from .waiting_sound import WaitingSound

__all__ = ["WaitingWords"]

_LATE = 0.4  # seconds after its sound within which a word costs no gesture (docs/guides/python.md, "Words")
_PIECES = 100  # in memory, for words that come after their sound [ours: two seconds of pieces of 0.02 s]


class WaitingWords:
    """Words in order of their starts in the sound that was sent. Silence that is put between pieces of sound does not count.

    Args:
        sound: in which they are spoken; its places are samples.
        rate: samples per second of the sound.
        tell: called once, when a word came so late that its gesture may be lost.
        language: of words that bring none, see `cospeech.audio.languages`.
    """

    def __init__(self, sound: WaitingSound, rate: int, tell: Callable[[str], object], language: str = "") -> None:
        self._sound, self._rate, self._tell, self._language = sound, rate, tell, language
        self._lock, self._words = threading.Lock(), list[Word]()
        self._pieces = deque[tuple[float, float]](maxlen=_PIECES)  # where each begins: in the sound, and on the clock; seconds
        self._has_warned = False

    def put(self, words: Iterable[Word], place: int = 0) -> None:
        """Add words; any thread may.

        Args:
            words: their times count from ``place``.
            place: of a sample of the sound, as `WaitingSound` counts them.

        Raises:
            InputError: too many words wait.
        """
        origin = place / self._rate
        with self._lock:
            for word in words:
                if len(self._words) >= WORDS:
                    raise InputError(f"more than {WORDS:,} words wait for their sound", "do their times belong to it?")
                language = word.language or self._language
                own = replace(word, start=word.start + origin, end=word.end + origin, language=language)
                insort(self._words, own, key=lambda each: each.start)

    def join(self, piece: Speech) -> Speech:
        """Add words to the piece that is heard now: those that start in it, and late ones from before; their times are on its
        clock.

        Words of sound that was dropped are forgotten.
        """
        begin, loss = self._sound.piece / self._rate, self._sound.dropped / self._rate
        end = min(begin + float(piece.duration), self._sound.taken / self._rate)  # the rest of a piece is silence
        self._pieces.append((begin, piece.start))
        with self._lock:
            count = next((k for k, word in enumerate(self._words) if word.start >= end), len(self._words))
            words = cut_overlaps(self._words[: count + 1])[:count]
            del self._words[:count]
        words = [self._on_clock(word) for word in words if word.start >= loss]
        late = next((word for word in words if word.start < piece.start - _LATE), None)
        if late is not None and not self._has_warned:
            self._has_warned = True
            self._tell(
                f"{late.text[:40]!r} came {piece.start - late.start:.1f} s after its sound: send words before their sound"
            )
        return replace(piece, words=tuple(words))

    def _on_clock(self, word: Word) -> Word:
        """The word where its sound was heard."""
        start, clock = next((each for each in reversed(self._pieces) if each[0] <= word.start), self._pieces[0])
        return replace(word, start=word.start + clock - start, end=word.end + clock - start)
