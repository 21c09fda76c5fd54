"""Channels moved by overlapping minimum-jerk displacements: the tracks on which plans set their moves.

A point-to-point reach of the human arm follows the minimum-jerk polynomial (Flash & Hogan 1985), and longer movements
look like sums of such *submovements* that overlap in time (Flash & Henis 1991). So a track is a base value plus
displacements, each with its own onset and duration: a new goal may be set in mid-flight, corners round off by
themselves, and the value at any instant is a pure function of time.

A displacement may be *skewed*, so that its speed peaks early or late, and *arched*, so that its path leaves the chord and
comes back to it: people's strokes are neither symmetric in time nor straight.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..motion.rotations import Array

__all__ = ["PEAK", "MinimumJerkTrack", "minimum_jerk", "peak_share", "skew_for"]

_AT_ONCE = 24  # frames at once; in each, all moves under way in any of them are added up [ours, the fastest]
_SURELY = 1e-6  # seconds after its end from which a move is over, whatever the rounding [ours]
PEAK = 1.875
"""Peak speed of a minimum-jerk reach to its mean speed."""
MOST_SKEW = 0.85  # [ours]: beyond 1 the progress would run backwards


def minimum_jerk(u: Array, skew: Array | float = 0.0) -> Array:
    """Progress 0 … 1 of a minimum-jerk reach at relative time ``u`` (clipped to 0 … 1).

    Args:
        u: (...) share of the duration.
        skew: −0.85 … 0.85; a positive one brings the peak of the speed forward, a negative one delays it.
    """
    u = np.minimum(np.maximum(u, 0.0), 1.0)
    u = u * (1.0 + skew * (1.0 - u))
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))


@lru_cache(1)
def _peaks() -> tuple[Array, Array]:
    """Skews, and where in the duration the speed of such a reach peaks."""
    skews, u = np.linspace(-MOST_SKEW, MOST_SKEW, 35), np.linspace(0, 1, 1001)
    speeds = np.diff(minimum_jerk(u, skews[:, None]), axis=-1)
    return skews, (speeds.argmax(-1) + 0.5) / 1000


def peak_share(skew: float) -> float:
    """Share of a reach's duration at which its speed peaks; 0.5 without skew."""
    return float(np.interp(skew, *_peaks()))


def skew_for(share: float) -> float:
    """The skew with which the speed peaks at this share of the duration: the inverse of `peak_share`."""
    skews, shares = _peaks()
    return float(np.interp(-share, -shares, skews))


class MinimumJerkTrack:
    """C channels as a function of time.

    Args:
        base: (C,) values before anything moves.
        lags: (C,) seconds by which each channel trails the onset of a move (follow-through of wrist and fingers).
    """

    def __init__(self, base: Array, lags: Array | None = None) -> None:
        self._base = np.array(base, float)
        self.lags = np.zeros(len(self._base)) if lags is None else np.asarray(lags, float)
        self._latest = float(self.lags.max(initial=0.0))
        self._straight = np.zeros_like(self._base)
        self._times: list[tuple[float, float, float]] = []  # onset, duration, skew
        self._deltas: list[Array] = []
        self._arcs: list[Array] = []
        self.target = self._base.copy()
        """Where every channel comes to rest once all moves are over."""

    def move(
        self,
        onset: float,
        duration: float,
        to: Array,
        channels: slice | list[int] | Array = slice(None),
        *,
        skew: float = 0.0,
        arc: Array | None = None,
    ) -> None:
        """Bring ``channels`` to the values ``to``, on top of whatever else is still under way."""
        delta = np.zeros_like(self._base)
        delta[channels] = np.asarray(to) - self.target[channels]
        self.add(onset, duration, delta, skew=skew, arc=arc)

    def add(self, onset: float, duration: float, delta: Array, *, skew: float = 0.0, arc: Array | None = None) -> None:
        """Displace all channels by ``delta (C,)`` during ``duration`` seconds from ``onset``.

        Args:
            skew: see `minimum_jerk`.
            arc: (C,) by how much the path is off its chord halfway; it begins and ends on it.
        """
        self._times.append((onset, duration, min(max(skew, -MOST_SKEW), MOST_SKEW)))
        self._deltas.append(delta)
        self._arcs.append(self._straight if arc is None else arc)
        self.target = self.target + delta

    def at(self, times: Array) -> Array:
        """(N, C) values at ``times (N,)``, which ascend; times before those passed to `forget` are no longer known."""
        out = np.empty((len(times), len(self._base)))
        base, over = self._base, 0
        for first in range(0, len(times), _AT_ONCE):
            near = times[first : first + _AT_ONCE]
            base, over = self._fold(base, over, float(near[0]) - _SURELY)
            out[first : first + _AT_ONCE] = self._add_moves(near, base, over)
        return out

    def _add_moves(self, times: Array, base: Array, over: int) -> Array:
        """(n, C) at times near each other, in which few moves are under way; ``over`` moves are in the base already."""
        indices = [k for k in range(over, len(self._times)) if self._times[k][0] < times[-1]]
        if not indices:
            return base
        onset, length, skew = np.array([self._times[k] for k in indices]).T[..., None]
        deltas = np.array([self._deltas[k] for k in indices])
        u = (times[:, None, None] - onset - (self.lags if self._latest > 0 else 0.0)) / length
        u = np.minimum(np.maximum(u, 0.0), 1.0)
        terms = np.empty((len(times), 1 + len(indices), len(base)))
        terms[:, 0] = base
        np.multiply(minimum_jerk(u, skew), deltas, out=terms[:, 1:])
        arcs = [k for k, index in enumerate(indices) if self._arcs[index] is not self._straight]
        if arcs:
            hump = u[:, arcs] * (1.0 - u[:, arcs])
            terms[:, [k + 1 for k in arcs]] += 64.0 * hump * hump * hump * np.array([self._arcs[indices[k]] for k in arcs])
        return np.add.reduce(terms, axis=1)  # one after the other, as `_fold` adds them

    def forget(self, before: float) -> None:
        """Fold moves that ended before this time into the base, so that memory stays constant.

        They are folded in the order in which they were added, up to the first that is not over: so the base is the sum that
        `at` would have come to, and no bit depends on when they are folded.
        """
        self._base, over = self._fold(self._base, 0, before)
        del self._times[:over], self._deltas[:over], self._arcs[:over]

    def _fold(self, base: Array, over: int, before: float) -> tuple[Array, int]:
        """A base that holds ``over`` moves, and how many; with those that follow and are over before this time."""
        last = before - self._latest
        while over < len(self._deltas) and self._times[over][0] + self._times[over][1] < last:
            base = base + self._deltas[over]
            over += 1
        return base, over
