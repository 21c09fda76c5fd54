"""From time stamps to a constant frame rate, for files with a time in each row."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

import numpy as np

from ..errors import InputError
from ..limits import MOTION_RATES
from ..motion.rotations import Array

__all__ = ["are_frames", "fraction_of_rate", "frame_rate", "frames_of", "on_grid", "rate_of_step"]

_RATES = (10, 12, 15, 20, 24, 25, 30, 48, 50, 60, 72, 90, 100, 120, 144, 150, 180, 200, 240)
_NTSC_FRACTIONS = tuple(Fraction(f * 1000, 1001) for f in (24, 30, 48, 60, 120))
_NTSC = tuple(float(rate) for rate in _NTSC_FRACTIONS)
_SOME, _OFF_GRID = 8, 0.01  # keys, and share of the time between two: keys set by hand are not so regular by accident; ours
_NEAR = 2e-4  # of a rate: 29.97 is 30000/1001


def frame_rate(times: Array, fallback: float) -> float:
    """Frames per second of ascending time stamps ``(T,)`` in seconds, snapped to a common rate within 0.2 %.

    ``fallback`` is the answer for fewer than two rows. The step is the lower quartile of the file's own steps: gaps and dropped
    frames give longer steps, and rounded stamps jitter about it.

    Raises:
        InputError: time goes backwards, or no frame rate that motion has.
    """
    if len(times) < 2:
        return fallback
    steps = np.diff(times)
    if np.any(steps < 0):
        raise InputError(f"time goes backwards at row {int(np.argmax(steps < 0)) + 2}", "is the recording damaged?")
    moving = np.sort(steps[steps > 0])
    step = float(moving[(len(moving) - 1) // 4]) if len(moving) else 0.0
    if not 1e-4 <= step <= 1:  # ours: 10,000 … 1 frames per second
        raise InputError(f"the time stamps are spread {step:g} s apart", "is the clock of the recording damaged?")
    regular = np.abs(steps - step) < 0.25 * step  # without gaps; the step itself is always among them
    rate = 1 / float(np.mean(steps[regular]))
    for common in (float(round(rate)), *_NTSC):
        if common > 0 and abs(rate - common) < _NEAR * common:
            return common
    whole = float(round(rate))
    return whole if whole > 0 and abs(rate - whole) < 2e-3 * whole else rate


def fraction_of_rate(fps: float) -> Fraction:
    """The fraction that editors know by this rate: 30000/1001 for 29.97."""
    for common in (Fraction(round(fps)), *_NTSC_FRACTIONS):
        if abs(fps - common) < (_NEAR * common if common.denominator > 1 else 1e-9):
            return common
    return Fraction(fps).limit_denominator(1001)


def _even(times: Array, fps: float) -> bool:
    """Whether every stamp lies within a quarter of a frame of its place on the grid."""
    return bool(np.abs(times - times[0] - np.arange(len(times)) / fps).max() * fps < 0.25)


def frames_of(times: Array, fps: float) -> int:
    """How many frames `on_grid` gives for rows at ``times (T,)`` seconds, in ascending order."""
    if len(times) < 2 or _even(times, fps):
        return len(times)
    return int(np.floor(float(times[-1] - times[0]) * fps + 0.5)) + 1


def on_grid(times: Array, values: Array, fps: float) -> Array:
    """Put rows ``values (T, D)`` at ``times (T,)`` seconds on a constant rate, by linear interpolation.

    The caller checks `frames_of` first: stamps that are far apart give many frames.

    Returns:
        (T', D) rows at ``fps`` from the first stamp to the last; the same rows where the clock is even.
    """
    count = frames_of(times, fps)
    if len(times) < 2 or _even(times, fps):
        return values
    grid = times[0] + np.arange(count) / fps
    return np.stack([np.interp(grid, times, column) for column in values.T], 1)


def rate_of_step(frame_time: float, precision: float) -> float:
    """The frame rate of a rounded ``Frame Time``: 0.033333 is 30, 0.008342 is 119.88, 0.03 is 30 too.

    If a whole rate and one of NTSC have the same digits, it is the whole one: 0.0167 is 60, not 59.94.

    Raises:
        InputError: no frame rate that motion has.
    """
    if not 1 / MOTION_RATES[1] <= frame_time <= 1 / MOTION_RATES[0]:
        raise InputError(f"Frame Time {frame_time:g}", "give the frame rate: fps=30")
    rate = 1 / frame_time
    near = float(round(rate) or 1)
    if abs(rate - near) > 1e-9 * rate:
        whole = min(_RATES, key=lambda common: abs(1 / common - frame_time))
        is_rounded = abs(1 / whole - frame_time) <= 0.501 * precision
        near = whole if is_rounded else min((*_RATES, *_NTSC), key=lambda common: abs(1 / common - frame_time))
    if abs(1 / near - frame_time) <= 1.001 * precision:
        return near
    return next((r for r in (round(rate, k) for k in range(7)) if r and abs(1 / r - frame_time) <= precision), rate)


def are_frames(keys: Iterable[Array], longest: Array, step: float) -> bool:
    """Whether keys far apart are frames at a low rate, not keys set by hand: there are at least `_SOME`, all on one grid of
    time.

    Args:
        keys: times of the keys of each curve, seconds.
        longest: those of the curve with the most keys.
        step: seconds between two of them.
    """
    if len(longest) < _SOME or not 0 < step <= 1:
        return False
    grids = [(times - longest[0]) / step for times in keys]
    return all(np.abs(grid - np.round(grid)).max(initial=0) < _OFF_GRID for grid in grids)
