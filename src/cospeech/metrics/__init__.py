"""Metrics: one file each, numpy and scipy only, no model is ever imported here.

`movement` says how people move, in numbers, and within which ranges; `beat_lift` says how far motion follows the accents
of its speech, corrected for chance.
"""

from .beat_lift import BeatLift, beat_lift
from .movement import Track, movement_statistics
from .movement_reference import REFERENCE, Row

__all__ = ["METRICS", "REFERENCE", "BeatLift", "Row", "Track", "beat_lift", "movement_statistics"]

METRICS: dict[str, str] = {
    "movement": "cospeech.metrics.movement:movement_statistics",
    "beat_lift": "cospeech.metrics.beat_lift:beat_lift",
}
"""Name → ``module:function``; `cospeech list metrics` and the documentation iterate over it."""
