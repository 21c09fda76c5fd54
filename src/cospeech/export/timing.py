"""From time stamps to a constant frame rate: what files with a clock per row need."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..rotations import Array

__all__ = ["frame_rate", "on_grid"]

_NTSC = tuple(f * 1000 / 1001 for f in (24, 30, 60, 120))
_MAX_GAP_FRAMES = 10_000_000  # ours: 38 h at 72 fps; more rows than that come from a broken clock


def frame_rate(times: Array, fallback: float) -> float:
    """Frames per second of increasing time stamps ``(T,)`` in seconds, snapped to a common rate within 0.2 %.

    ``fallback`` is the answer for fewer than two rows. The median step counts, so that dropped frames do not.
    """
    if len(times) < 2:
        return fallback
    steps = np.diff(times)
    median = float(np.median(steps))
    if not 1e-4 <= median <= 1:  # ours: 10,000 … 1 frames per second
        raise InputError(f"the time stamps are spread {median:g} s apart", "is the clock of the recording damaged?")
    regular = np.abs(steps - median) < 0.25 * median  # without the dropped frames
    rate = 1 / float(np.mean(steps[regular]))
    for common in (float(round(rate)), *_NTSC):
        if common > 0 and abs(rate - common) < 2e-4 * common:
            return common
    rounded = float(round(rate))
    return rounded if rounded > 0 and abs(rate - rounded) < 2e-3 * rounded else rate


def on_grid(times: Array, values: Array, fps: float) -> Array:
    """Rows ``values (T, D)`` at ``times (T,)`` seconds, linearly interpolated where the clock is not even.

    Returns:
        (T', D) rows at ``fps`` from the first stamp to the last; the same rows where the clock is even.

    Raises:
        InputError: stamps go backwards, or they span far more than the rows can fill.
    """
    if len(times) < 2:
        return values
    if np.any(np.diff(times) < 0):
        row = int(np.argmax(np.diff(times) < 0)) + 2
        raise InputError(f"time goes backwards at row {row}", "is the recording damaged?")
    span = (times[-1] - times[0]) * fps
    if np.abs(times - times[0] - np.arange(len(times)) / fps).max() * fps < 0.25:
        return values
    if span > min(_MAX_GAP_FRAMES, 100 * len(times) + 1000):
        raise InputError(f"{len(times)} rows are spread over {span / fps:.0f} s", "is the clock of the recording damaged?")
    grid = times[0] + np.arange(int(np.floor(span + 0.5)) + 1) / fps
    return np.stack([np.interp(grid, times, column) for column in values.T], 1)
