"""Words of a plan that is played: they stand in for the words of a speech that has none."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

from ..audio.speech import Word

__all__ = ["PlannedWords", "describe_length"]

_SAME_LENGTH = 0.1  # seconds by which a speech may be longer or shorter in another file [ours: what MP3 adds]
_SAME_TIME = 1e-3  # seconds by which a word may be elsewhere [ours: SRT and WebVTT give milliseconds]


class PlannedWords:
    """Gives each piece of a speech its words, and notes them.

    >>> words = PlannedWords([Word("so", 0.1, 0.3), Word("big", 0.3, 0.6)])
    >>> [word.text for word in words.hear(None, 0.2)], [word.text for word in words.hear(None, 0.4)]
    (['so'], ['big'])

    Args:
        words: of the plan.
    """

    def __init__(self, words: Iterable[Word]) -> None:
        self._plan_words = sorted(words, key=lambda word: word.start)
        self._waiting = deque(self._plan_words)
        self._has_own_words = False
        self.heard = list[Word]()
        """Words of the speech so far."""

    def hear(self, own_words: Sequence[Word] | None, until: float) -> Sequence[Word] | None:
        """Words of the next piece: its own, else those of the plan that start in it; None where there are none.

        Args:
            own_words: of the piece itself; None where it has no transcript.
            until: seconds from the start of the speech to the end of the piece.
        """
        plan_words = list[Word]()
        while self._waiting and self._waiting[0].start < until:
            plan_words.append(self._waiting.popleft())
        self._has_own_words = self._has_own_words or own_words is not None
        words = own_words if own_words is not None or not self._plan_words else plan_words
        self.heard += words or ()
        return words

    def describe_difference(self, seconds: float) -> str:
        """The note if the speech brought other words than the plan has; else "".

        Args:
            seconds: length of the speech.
        """
        plan_words = [word for word in self._plan_words if word.start < seconds]
        if not self._has_own_words or not plan_words or _same(plan_words, self.heard):
            return ""
        return "the words of the speech are not those of the plan, and are played in their place"


def describe_length(plan_seconds: float | None, seconds: float) -> str:
    """The note if a plan is of a speech of another length; else "".

    Args:
        plan_seconds: of the speech of the plan; None where not known.
        seconds: of the speech that is there.
    """
    if plan_seconds is None or abs(plan_seconds - seconds) <= _SAME_LENGTH:
        return ""
    return f"the plan is of a speech of {plan_seconds:.4g} s, and this one has {seconds:.4g} s"


def _same(some: Sequence[Word], others: Sequence[Word]) -> bool:
    return len(some) == len(others) and all(
        a.text == b.text and abs(a.start - b.start) < _SAME_TIME and abs(a.end - b.end) < _SAME_TIME
        for a, b in zip(some, others, strict=True)
    )
