"""How late parts of a face come when little of the speech ahead is known."""

from __future__ import annotations

from dataclasses import dataclass

from .blinks import PAUSE_KNOWN
from .expressions import BROWS_EARLY, SWELL_EARLY
from .lips import TALKING_HALF

__all__ = ["FaceDelays"]


@dataclass(frozen=True)
class FaceDelays:
    """Seconds by which parts of the face come later than with the usual look-ahead; with that, all are 0.

    A frame depends on the sound around it, and not on when it is made. So a stream has the same bits as the whole.
    """

    brows: float = 0.0
    swell: float = 0.0
    blinks: float = 0.0
    """Those at the ends of phrases."""
    talking: float = 0.0
    """The slow part of speaking, to which expressions yield."""

    @classmethod
    def for_foresight(cls, *, accents: float, sound: float) -> FaceDelays:
        """The delays of a face that knows accents and sound up to so many seconds after a frame, at least."""
        return cls(
            brows=max(BROWS_EARLY - accents, 0.0),
            swell=max(SWELL_EARLY - accents, 0.0),
            blinks=max(PAUSE_KNOWN - sound, 0.0),
            talking=max(TALKING_HALF - sound, 0.0),
        )
