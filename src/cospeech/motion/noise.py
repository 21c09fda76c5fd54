"""Smooth random noise that is a pure function of time: the same seed gives the same value at the same time, in any order.

A lattice of hashed normal values is interpolated by cubic B-splines, and several octaves are added. So the spectrum falls off
smoothly, and a stream needs no state.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .rotations import Array

__all__ = ["hash_normal", "hash_uniform", "smooth_noise"]

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)  # splitmix64 (Steele, Lea & Flood 2014)
_MIX_A, _MIX_B = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_ROUNDS, _LAST = ((_MIX_A, np.uint64(30)), (_MIX_B, np.uint64(27))), np.uint64(31)
_SHIFT = np.uint64(11)


def _hash(seed: int, stream: Array, index: Array) -> NDArray[np.uint64]:
    with np.errstate(over="ignore"):
        x = index.astype(np.int64).astype(np.uint64) * _GOLDEN
        x = x + (stream.astype(np.uint64) * _MIX_A + np.uint64(seed * int(_MIX_B) & 0xFFFFFFFFFFFFFFFF))
        for mix, shift in _ROUNDS:
            x = (x ^ (x >> shift)) * mix
        return x ^ (x >> _LAST)


def hash_uniform(seed: int, stream: ArrayLike, index: ArrayLike) -> Array:
    """Uniform values in (0, 1) that depend on ``(seed, stream, index)`` alone; arguments broadcast."""
    return ((_hash(seed, np.asarray(stream), np.asarray(index)) >> _SHIFT).astype(np.float64) + 0.5) / 2.0**53


def hash_normal(seed: int, stream: ArrayLike, index: ArrayLike) -> Array:
    """Unit normal values (approximate: a sum of three uniforms) from the same hash; |value| < 3."""
    stream, index = np.asarray(stream), np.asarray(index)
    draws = np.arange(1000003, 1000006).reshape(-1, *[1] * max(stream.ndim, index.ndim))
    total = hash_uniform(seed, stream * 3 + draws, index)  # the three at once
    return (total[0] + total[1] + total[2] - 1.5) * 2.0


@lru_cache(64)
def _lattice(seed: int, channels: int, octave: int, low: int, count: int) -> Array:
    """(count, channels) values from the place ``low`` on. They are cached: a stream needs the same ones again and again."""
    lattice = hash_normal(seed, np.arange(channels) + 7919 * octave, (low + np.arange(count))[:, None])
    lattice.setflags(write=False)
    return lattice


@lru_cache(64)
def _lattices(seed: int, channels: int, low: tuple[int, ...], count: tuple[int, ...]) -> Array:
    """(sum of counts, channels) values of all octaves, one after the other."""
    cells = enumerate(zip(low, count, strict=True))
    lattice = np.concatenate([_lattice(seed, channels, octave, *cell) for octave, cell in cells])
    lattice.setflags(write=False)
    return lattice


def smooth_noise(seed: int, channels: int, times: Array, rate: float, *, octaves: int = 3, gain: float = 0.5) -> Array:
    """Band-limited noise of unit variance.

    Args:
        seed: another seed gives other noise.
        channels: C, number of independent channels.
        times: (T,) seconds.
        rate: lattice points per second of the slowest octave; its power lies below about ``rate / 2``.
        octaves: each doubles the rate and multiplies the amplitude by ``gain``.

    Returns:
        (T, C).
    """
    if not len(times):
        return np.zeros((0, channels))
    scales = np.arange(octaves)
    x = np.asarray(times, float) * (rate * 2.0**scales)[:, None]
    first = np.floor(x).astype(np.int64)
    u = x - first
    low = first.min(1) - 1
    count = first.max(1) + 3 - low
    lattice = _lattices(seed, channels, tuple(low.tolist()), tuple(count.tolist()))
    place = first + (np.cumsum(count) - count - low - 1)[:, None]
    square, cube = u**2, u**3
    weights = ((1 - u) ** 3 / 6, (3 * cube - 6 * square + 4) / 6, (-3 * cube + 3 * square + 3 * u + 1) / 6, cube / 6)
    values: Array = weights[0][..., None] * lattice.take(place, 0)  # octaves, times, channels
    for k in (1, 2, 3):
        values += weights[k][..., None] * lattice.take(place + k, 0)
    values *= (gain**scales)[:, None, None]
    power = (gain ** (2 * scales)).sum() * 0.479  # mean of the sum of squared B-spline weights over one cell
    out: Array = np.add.reduce(values, 0) / np.sqrt(power)
    return out
