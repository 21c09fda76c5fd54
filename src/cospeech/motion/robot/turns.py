"""Angles that are the same pose a whole turn further: which of them a joint is asked for."""

from __future__ import annotations

import numpy as np

from ..rotations import Array

__all__ = ["TurnChooser"]

_TURN = 2 * np.pi
_FAR = 0.5
"""Radians by which an angle is beyond a limit before another turn counts; or by which that is nearer to the limits, where none
is within them. [ours: no joint flickers where its range is about a whole turn]"""


class TurnChooser:
    """Keeps angles within the limits of joints by whole turns, where that is possible, and else without jumps.

    A forearm that somebody turns and turns ends where it began, but the sum of its ways does not. An angle stays on the turn of
    the frame before while that is within the limits. Where it is far outside of them, another turn that is within them counts:
    the joint then goes there the long way round, as it cannot go on.

    Args:
        lower, upper: (J,) radians.
        turns: (J,) whether a joint turns; hands and what slides do not.
    """

    def __init__(self, lower: Array, upper: Array, turns: Array) -> None:
        self._lower, self._upper, self._turns = lower, upper, turns
        self._last: Array | None = None

    def push(self, wanted: Array) -> Array:
        """(T, J) → (T, J), the same angles on other turns; pieces of any size give the bits of the whole."""
        chosen = np.empty_like(wanted, float)
        for k, row in enumerate(wanted):
            self._last = chosen[k] = np.where(self._turns, self._choose(row), row)
        return chosen

    def go_on_from(self, place: Array | None) -> None:
        """The next angles come after this (J,) place; None: they are the first."""
        self._last = place

    def _choose(self, row: Array) -> Array:
        near = row if self._last is None else row + _TURN * np.round((self._last - row) / _TURN)
        first = row + _TURN * np.ceil((self._lower - row) / _TURN)  # the first turn from the lower limit on
        last = row + _TURN * np.floor((self._upper - row) / _TURN)  # the last turn up to the upper limit
        within = np.where(near > self._upper, last, first)
        beside = np.where(self._outside(last) < self._outside(first), last, first)  # where none is within them
        far, possible = self._outside(near), first <= self._upper
        flips = (far > _FAR) & possible
        nears = ~possible & (far > self._outside(beside) + _FAR)
        return np.where(flips, within, np.where(nears, beside, near))

    def _outside(self, angles: Array) -> Array:
        return np.maximum(np.maximum(self._lower - angles, angles - self._upper), 0)
