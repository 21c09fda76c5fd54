"""Channels moved by overlapping minimum-jerk displacements: the clay that plans are modelled in.

A point-to-point reach of the human arm follows the minimum-jerk polynomial (Flash & Hogan 1985), and longer movements
look like sums of such *submovements* that overlap in time (Flash & Henis 1991). So a track is a base value plus
displacements, each with its own onset and duration: a new goal may be set in mid-flight, corners round off by
themselves, and the value at any instant is a pure function of time.
"""

from __future__ import annotations

import numpy as np

from ..rotations import Array

__all__ = ["Track", "minimum_jerk"]


def minimum_jerk(u: Array) -> Array:
    """Progress 0 … 1 of a minimum-jerk reach at relative time ``u`` (clipped to 0 … 1)."""
    u = np.clip(u, 0.0, 1.0)
    return u * u * u * (10.0 + u * (6.0 * u - 15.0))


class Track:
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
        return self._base + np.einsum("nmc,mc->nc", minimum_jerk(u), np.array(self._deltas))

    def forget(self, before: float) -> None:
        """Fold moves that ended before this time into the base, so that memory stays constant."""
        last = before - float(self.lags.max(initial=0.0))
        keep = [k for k, (t, d) in enumerate(zip(self._onsets, self._lengths, strict=True)) if t + d >= last]
        if len(keep) == len(self._deltas):
            return
        done = set(range(len(self._deltas))) - set(keep)
        self._base = self._base + sum(self._deltas[k] for k in sorted(done))
        self._onsets = [self._onsets[k] for k in keep]
        self._lengths = [self._lengths[k] for k in keep]
        self._deltas = [self._deltas[k] for k in keep]
