"""Where a hand is in the plan: at rest, or up with a gesture."""

from __future__ import annotations

from dataclasses import dataclass
from random import Random

from ..motion.rotations import Array
from .minimum_jerk import MinimumJerkTrack
from .repertoire import FORMS

__all__ = ["HandState", "effort_of"]


_AT_EASE = 0.7  # effort up to which a hand beats where it is (ours)


@dataclass
class HandState:
    """One hand of a planner."""

    track: MinimumJerkTrack
    home: Array
    """Where it rests."""
    busy: float = -9.0
    """No new preparation before this time."""
    up_until: float = 0.0
    """When the hand goes back to rest if nothing else is asked of it."""
    place: str = "idle"
    """"idle", "rest" or "up"."""
    form: str = ""
    last_stroke: float = -9.0
    gesture_end: float = -9.0
    """When the last stroke of its last gesture ended, beats left out."""
    pose: Array | None = None
    keeps: bool = False
    """Whether it stays up until then, even if the speaker falls silent."""
    has_eased: bool = False
    """Whether it has gone a part of the way back since its last stroke."""
    effort: float = 0.0
    """Of its last gesture, as of `effort_of`."""
    chance: float = 0.0
    """Drawn with its last stroke."""

    def dice(self) -> Random:
        """Random numbers for what the hand does next.

        They depend on its last stroke and not on the tick, so a change before that stroke does not change them.
        """
        return Random(f"{self.chance}/{self.place}/{self.has_eased}")

    def can_beat(self) -> bool:
        """Whether it is up with a form that beats, and at ease there."""
        return self.place == "up" and self.form in FORMS and FORMS[self.form].beats and effort_of(self.track.target) < _AT_EASE


def effort_of(pose: Array) -> float:
    """How tiring a place is for a hand, 0 (in front of the belly) … 1 (wide out or above the shoulder); ours."""
    return float(min(max(pose[0] - 0.18, 0.0) / 0.25 + max(pose[1] + 0.40, 0.0) / 0.55, 1.0))
