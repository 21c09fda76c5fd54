"""Choose among angles that differ by whole turns, and so are the same pose of a joint."""

from __future__ import annotations

import numpy as np

from ..rotations import Array

__all__ = ["TurnChooser"]

_TURN = 2 * np.pi
_FAR = 0.5
"""Radians by which an angle must be beyond a limit before another turn is chosen; or by which the other turn must be nearer to
the limits, if no turn is within them. [ours: a joint with a range of about a whole turn does not flicker]"""


class TurnChooser:
    """Keeps angles within the limits of joints by adding whole turns, if possible, and otherwise without jumps.

    A forearm that goes on turning comes back to its pose, but the sum of its turns grows. An angle stays on the turn of the
    frame before while this is within the limits. If it is far outside of them, another turn within them is chosen: the joint
    then goes there the long way round, as it cannot go on.

    Args:
        lower, upper: (J,) radians.
        turns: (J,) whether a joint turns; hands and sliding joints do not.
    """

    def __init__(self, lower: Array, upper: Array, turns: Array) -> None:
        self._lower, self._upper, self._turns = lower, upper, turns
        self._last: Array | None = None

    def push(self, angles: Array) -> Array:
        """(T, J) → (T, J), the same angles with whole turns added; pieces of any size give the bits of the whole."""
        result = np.empty_like(angles, float)
        for k, row in enumerate(angles):
            self._last = result[k] = np.where(self._turns, self._choose(row), row)
        return result

    def go_on_from(self, place: Array | None) -> None:
        """Set the (J,) place before the next angles; None: they are the first."""
        self._last = place

    def _choose(self, row: Array) -> Array:
        near = row if self._last is None else row + _TURN * np.round((self._last - row) / _TURN)
        first = row + _TURN * np.ceil((self._lower - row) / _TURN)  # the first turn from the lower limit on
        last = row + _TURN * np.floor((self._upper - row) / _TURN)  # the last turn up to the upper limit
        within = np.where(near > self._upper, last, first)
        beside = np.where(self._outside(last) < self._outside(first), last, first)  # if no turn is within the limits
        far, possible = self._outside(near), first <= self._upper
        flips = (far > _FAR) & possible
        nears = ~possible & (far > self._outside(beside) + _FAR)
        return np.where(flips, within, np.where(nears, beside, near))

    def _outside(self, angles: Array) -> Array:
        return np.maximum(np.maximum(self._lower - angles, angles - self._upper), 0)
