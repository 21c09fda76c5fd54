"""Bouts: gestures of a speaker come in bursts, with stretches between them in which the hands hold still or rest.

Two recorded speakers hold their hands still less often than chance, but for longer: with as much movement, their hands stop
half as often as hands that leave out accents one by one (docs/models/rules.md). So whole stretches of accents are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from ..audio.prosodic_events import Phrase

__all__ = ["Bouts"]

_BUSY, _QUIET = (4.0, 9.5), (2.2, 4.4)
"""Seconds of a stretch with gestures, and of one without. [ours: stillness of two recorded speakers]"""
_AFTER_PAUSE = 0.75  # how often a phrase that follows a pause begins a bout with gestures [ours]
_REST_PAUSE, _LONGER = 1.2, 1.5
"""Seconds of a pause in which hands have rested; and how much longer the bout after it is. [ours]"""
_SHORTER = -0.4  # power of the style's stillness: bouts of one who is often still are also shorter [ours]
_EAGER = {True: 1.55, False: 0.04}  # factor on the share of accents with a stroke, in a bout and between bouts [ours]


class Bouts:
    """When a speaker is in the middle of gestures, and when not.

    Args:
        random: drawn from in tick order.
    """

    def __init__(self, random: Random) -> None:
        self._random = random
        self.busy = True
        """Whether gestures are to be made now."""
        self._until, self._phrase = random.uniform(*_BUSY), -1.0

    def decide(self, now: float, phrases: Sequence[Phrase], stillness: float) -> None:
        """One tick, at ``now`` seconds, with the phrases that are known.

        Args:
            now: seconds.
            phrases: that are known.
            stillness: of the style and the mood, as `cospeech.rules.styles.Style.stillness`.
        """
        phrase = next((p for p in phrases if self._phrase < p.start <= now + 0.6), None)
        if phrase is not None:
            self._phrase = phrase.start
            before = max((p.end for p in phrases if p.end <= phrase.start), default=-1.0)
            if phrase.start - before > _REST_PAUSE:
                self._begin(now, stillness, busy=True, longer=_LONGER)
            elif not self.busy and self._random.random() < _AFTER_PAUSE:
                self._begin(now, stillness, busy=True)
        if now >= self._until:
            self._begin(now, stillness, busy=not self.busy)

    def willingness(self, rate: float, strength: float, size: float) -> float:
        """How likely an accent gets a stroke of hands that are free, 0 … 1 and above.

        Args:
            rate: of the style and the mood, as `cospeech.rules.styles.Style.rate`.
            strength: of the accent, 0 … 1.
            size: intensity of the take; small movers also move less often.
        """
        return rate * _EAGER[self.busy] * (0.62 + 0.75 * strength) * (0.2 + 0.8 * min(size, 1.0))

    def _begin(self, now: float, stillness: float, *, busy: bool, longer: float = 1.0) -> None:
        self.busy = busy
        length = self._random.uniform(*(_BUSY if busy else _QUIET))
        self._until = now + longer * length * stillness ** (_SHORTER if busy else 1.0)
