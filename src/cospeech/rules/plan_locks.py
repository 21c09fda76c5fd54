"""Locked stretches of a plan, and the gestures that they protect."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf

from ..errors import InputError
from .plan_model import SUPERIMPOSED, PlannedGesture, Stretch

__all__ = ["beats_on", "check_free", "find_lock", "start_after_lock"]

_QUICKEST = 0.5  # seconds from the beginning of a gesture to its stroke, at least ([ours]: what the player needs)


def beats_on(gesture: PlannedGesture, gestures: Iterable[PlannedGesture]) -> list[PlannedGesture]:
    """The superimposed beats that need a gesture, or a beat, before them, because it keeps the hand up."""
    later = [each for each in gestures if each.stroke > gesture.stroke and each.shares_hand(gesture)]
    until = min((each.stroke for each in later if each.form != SUPERIMPOSED), default=inf)
    return [each for each in later if each.stroke < until]


def find_lock(gesture: PlannedGesture, locked: Sequence[Stretch], gestures: Iterable[PlannedGesture] = ()) -> Stretch | None:
    """The first lock in which a part of a gesture lies, from its preparation to the end of its hold or of its last beat.

    Args:
        gesture: is looked up.
        locked: stretches.
        gestures: those around it, some of which may be beats on it.
    """
    over = _over(gesture, gestures) if locked else 0.0
    return next((each for each in locked if each.start < over and gesture.begins < each.end), None)


def check_free(gesture: PlannedGesture, locked: Sequence[Stretch], gestures: Iterable[PlannedGesture]) -> None:
    """No part of a gesture is locked; see `find_lock`.

    Raises:
        InputError: one is.
    """
    lock = find_lock(gesture, locked, gestures)
    if lock is not None:
        times = f"{gesture.begins:.4g} to {_over(gesture, gestures):.4g} s"
        problem = f"gesture {gesture.id!r}, {times}, reaches into a locked stretch, {lock.start:g} to {lock.end:g} s"
        entry = f"locked[{locked.index(lock)}]"
        raise InputError(problem, f"the lock is the entry {entry} of the plan: take it out, or leave this gesture as it is")


def start_after_lock(gesture: PlannedGesture, locked: Sequence[Stretch]) -> PlannedGesture:
    """A gesture without a start that begins when a lock before it ends, if there is time."""
    ends = [each.end for each in locked if gesture.begins < each.end <= gesture.stroke - _QUICKEST]
    return gesture.model_copy(update={"start": max(ends)}) if ends and gesture.start is None else gesture


def _over(gesture: PlannedGesture, gestures: Iterable[PlannedGesture]) -> float:
    """Seconds at which the last of its hold and of the beats on it ends; a gesture that takes all its hands ends the hold."""
    around = list(gestures)
    takes = [
        each.begins
        for each in around
        if each.stroke > gesture.stroke and each.form != SUPERIMPOSED and each.hands in (gesture.hands, "both")
    ]
    stroke_end = gesture.over - (gesture.hold or 0.0)
    own = max(stroke_end, min([gesture.over, *takes]))
    return max([own, *(each.over for each in beats_on(gesture, around))])
