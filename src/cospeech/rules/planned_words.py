"""Words of a plan that is played: those of the speech, where the speech has none."""

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
        planned: words of the plan.
    """

    def __init__(self, planned: Iterable[Word]) -> None:
        self._planned = sorted(planned, key=lambda word: word.start)
        self._waiting = deque(self._planned)
        self._given = False
        self.heard = list[Word]()
        """Words of the speech so far."""

    def hear(self, given: Sequence[Word] | None, until: float) -> Sequence[Word] | None:
        """Words of the next piece: those that it has, else those of the plan that start in it; None where nobody knows any.

        Args:
            given: words of the piece itself; None where it has no transcript.
            until: seconds from the start of the speech to the end of the piece.
        """
        planned = list[Word]()
        while self._waiting and self._waiting[0].start < until:
            planned.append(self._waiting.popleft())
        self._given = self._given or given is not None
        words = given if given is not None or not self._planned else planned
        self.heard += words or ()
        return words

    def describe_difference(self, seconds: float) -> str:
        """What to say if the speech brought other words than the plan has; else nothing.

        Args:
            seconds: length of the speech.
        """
        known = [word for word in self._planned if word.start < seconds]
        if not self._given or not known or _same(known, self.heard):
            return ""
        return "the words of the speech are not those of the plan, and are played in their place"


def describe_length(planned: float | None, seconds: float) -> str:
    """What to say if a plan is of a speech of another length; else nothing.

    Args:
        planned: seconds of the speech of the plan; None where nobody knows.
        seconds: of the speech that is there.
    """
    if planned is None or abs(planned - seconds) <= _SAME_LENGTH:
        return ""
    return f"the plan is of a speech of {planned:.4g} s, and this one has {seconds:.4g} s"


def _same(some: Sequence[Word], others: Sequence[Word]) -> bool:
    return len(some) == len(others) and all(
        a.text == b.text and abs(a.start - b.start) < _SAME_TIME and abs(a.end - b.end) < _SAME_TIME
        for a, b in zip(some, others, strict=True)
    )
