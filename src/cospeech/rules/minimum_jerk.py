"""Channels moved by overlapping minimum-jerk displacements: the clay that plans are modelled in.

A point-to-point reach of the human arm follows the minimum-jerk polynomial (Flash & Hogan 1985), and longer movements
look like sums of such *submovements* that overlap in time (Flash & Henis 1991). So a track is a base value plus
displacements, each with its own onset and duration: a new goal may be set in mid-flight, corners round off by
themselves, and the value at any instant is a pure function of time.
"""

from __future__ import annotations

import numpy as np

from ..motion.rotations import Array

__all__ = ["MinimumJerkTrack", "minimum_jerk"]


def minimum_jerk(u: Array) -> Array:
    """Progress 0 … 1 of a minimum-jerk reach at relative time ``u`` (clipped to 0 … 1)."""
    u = np.clip(u, 0.0, 1.0)
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))


class MinimumJerkTrack:
    """C channels as a function of time.

    Args:
        base: (C,) values before anything moves.
        lags: (C,) seconds by which each channel trails the onset of a move (follow-through of wrist and fingers).
    """

    def __init__(self, base: Array, lags: Array | None = None) -> None:
        self._base = np.array(base, float)
        self.lags = np.zeros(len(self._base)) if lags is None else np.asarray(lags, float)
        self._onsets: list[float] = []
        self._lengths: list[float] = []
        self._deltas: list[Array] = []
        self.target = self._base.copy()
        """Where every channel comes to rest once all moves are over."""

    def move(self, onset: float, duration: float, to: Array, channels: slice | list[int] | Array = slice(None)) -> None:
        """Bring ``channels`` to the values ``to``, on top of whatever else is still under way."""
        delta = np.zeros_like(self._base)
        delta[channels] = np.asarray(to) - self.target[channels]
        self.add(onset, duration, delta)

    def add(self, onset: float, duration: float, delta: Array) -> None:
        """Displace all channels by ``delta (C,)`` during ``duration`` seconds from ``onset``."""
        self._onsets.append(onset)
        self._lengths.append(duration)
        self._deltas.append(delta)
        self.target = self.target + delta

    def at(self, times: Array) -> Array:
        """(N, C) values at ``times (N,)``; times before those passed to `forget` are no longer known."""
        if not self._deltas:
            return np.broadcast_to(self._base, (len(times), len(self._base))).copy()
        u = (times[:, None, None] - np.array(self._onsets)[:, None] - self.lags) / np.array(self._lengths)[:, None]
        terms = np.empty((len(times), 1 + len(self._deltas), len(self._base)))
        terms[:, 0] = self._base
        terms[:, 1:] = minimum_jerk(u) * np.array(self._deltas)
        return np.add.reduce(terms, axis=1)  # one after the other, as `forget` adds them

    def forget(self, before: float) -> None:
        """Fold moves that ended before this time into the base, so that memory stays constant.

        They are folded in the order in which they were added, up to the first that is not over: so the base is the sum that
        `at` would have come to, and no bit depends on when they are folded.
        """
        last = before - float(self.lags.max(initial=0.0))
        over = 0
        while over < len(self._deltas) and self._onsets[over] + self._lengths[over] < last:
            self._base = self._base + self._deltas[over]
            over += 1
        del self._onsets[:over], self._lengths[:over], self._deltas[:over]
