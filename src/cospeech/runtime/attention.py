"""Where a person in a group looks: at the person who speaks, and in own speech at one listener after another.

In conversations of four, a listener looks at the speaker for most of the time (Vertegaal et al. 2001), and a speaker divides
the gaze among the others. Eyes go first, and the head follows.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from random import Random
from typing import NamedTuple

import numpy as np

from ..audio.conversation import HeardSpeaker
from ..motion.curves import smoothstep
from ..motion.rotations import Array

__all__ = ["Attention", "AttentionShift", "find_row", "find_seats", "plan_attention"]

_SHORTEST_TURN = 0.5  # s; a person who speaks for less is not looked at [ours: "mhm" takes no turn]
_AFTER = (0.20, 0.50)  # s after the first sound at which the others look [ours: a reaction, and less than a word]
_HOLDS = 0.9  # s for which somebody is looked at, at least [ours]
_SHARES = (2.8, 6.0)  # s for which a speaker looks at the same person [ours]
_EYES = 0.09  # s of a saccade between persons [ours: 25° take 80 ms, Carpenter 1988]
_LATE = 0.06  # s by which the head begins later than the eyes [ours]
_HEAD, _HEAD_PER_DEGREE = 0.42, 0.006  # s of a turn of the head, and more for a large one [ours: below 150° a second]

_WIDEST = 60.0  # degrees to the next one at a table of many; the body would turn further, see `cospeech.runtime.listening`
_NEIGHBOUR, _FURTHER = (
    40.0,
    8.0,
)  # degrees to the neighbour in a row, and more to each further one [ours: 90 would hide the face]


class AttentionShift(NamedTuple):
    """From a moment on, a person looks in another direction."""

    time: float
    """Seconds."""
    angle: float
    """Degrees to the character's left."""


class Attention:
    """The direction of a person's attention, as a function of time.

    Args:
        shifts: in the order of their times; before the first one, its angle holds.
    """

    def __init__(self, shifts: Sequence[AttentionShift]) -> None:
        self._times = np.array([shift.time for shift in shifts])
        angles = np.radians([shift.angle for shift in shifts])
        self._first, self._steps = float(angles[0]), np.diff(angles, prepend=angles[0])
        self._lasts = _HEAD + _HEAD_PER_DEGREE * np.abs(np.degrees(self._steps))  # s of each turn of the head

    def find_angles(self, times: Array) -> tuple[Array, Array]:
        """(n,) radians to the left each: where the eyes aim, and where the head would turn to if it turned all the way."""
        eyes, head = np.full(len(times), self._first), np.full(len(times), self._first)
        longest = _LATE + (float(self._lasts.max()))
        over = int(np.searchsorted(self._times, times[0] - longest)) if len(times) else 0
        total = float(self._steps[:over].sum())
        for k in range(over, int(np.searchsorted(self._times, times[-1], "right")) if len(times) else 0):
            since = times - self._times[k]
            eyes += self._steps[k] * smoothstep(since / _EYES)
            head += self._steps[k] * smoothstep((since - _LATE) / self._lasts[k])
        return eyes + total, head + total


def find_seats(count: int) -> list[list[float]]:
    """Bearings of persons around a table, who all face its middle, one beside the other clockwise as seen from above.

    Returns:
        For each of ``count`` persons, degrees to the left of every person; 0 for oneself.
    """

    def look(k: int, j: int) -> float:
        return max(min(90.0 - 180.0 * ((j - k) % count) / count, _WIDEST), -_WIDEST) if j != k else 0.0

    return [[look(k, j) for j in range(count)] for k in range(count)]


def find_row(count: int, side: float) -> list[list[float]]:
    """Bearings of persons who stand side by side in a picture, the outer ones turned to the middle.

    Args:
        count: how many there are; two face each other.
        side: degrees by which the outer ones are turned.

    Returns:
        As of `find_seats`; who stands further to the right in the picture is to the left of the person.
    """
    if count == 2:
        return find_seats(2)
    turns = [side * (1 - 2 * k / (count - 1)) for k in range(count)]

    def look(k: int, j: int) -> float:
        apart = abs(j - k)
        return (1 if j > k else -1) * (_NEIGHBOUR + _FURTHER * (apart - 1)) - turns[k] if apart else 0.0

    return [[look(k, j) for j in range(count)] for k in range(count)]


def plan_attention(
    own: HeardSpeaker, others: Sequence[HeardSpeaker], bearings: Sequence[float], seed: int
) -> list[AttentionShift]:
    """At whom a person looks, and when.

    Args:
        own: this person.
        others: those who can be looked at.
        bearings: degrees to the left, one of each.
        seed: of the take.
    """
    draw = Random(seed * 2 + 9)
    candidates = [
        (phrase.start + draw.uniform(*_AFTER), k)
        for k, other in enumerate(others)
        for phrase in other.phrases
        if phrase.end - phrase.start >= _SHORTEST_TURN
    ]
    for phrase in own.phrases:
        at = phrase.start + draw.uniform(*_SHARES)
        while len(others) > 1 and at < phrase.end - _HOLDS:
            candidates.append((at, -1))  # somebody else
            at += draw.uniform(*_SHARES)
    candidates.sort()
    at, shifts = (candidates[0][1] if candidates and candidates[0][1] >= 0 else 0), list[AttentionShift]()
    shifts.append(AttentionShift(0.0, bearings[at]))
    for time, who in candidates:
        last = bisect_right(own.phrases, time, key=lambda phrase: phrase.start) - 1
        speaks = last >= 0 and time < own.phrases[last].end
        if who == at or (speaks and who >= 0) or time < shifts[-1].time + _HOLDS:
            continue
        at = who if who >= 0 else draw.choice([k for k in range(len(others)) if k != at])
        shifts.append(AttentionShift(time, bearings[at]))
    return shifts
