"""What the papers leave out: windows in which nobody moves, or the pose estimator failed.

Windows are tried every ``hop`` frames; what no window that passes covers is dropped from the store.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from ...motion.poses import direction_vectors
from ...motion.rotations import Array

__all__ = ["FILTERS", "Check", "Filters", "Loss", "keep"]


class Check(NamedTuple):
    """A reason, and the function from windows of vectors (W, F, D) to which of them it throws out (W,)."""

    reason: str
    fails: Callable[[Array], Array]


class Filters(NamedTuple):
    """Checks of a corpus on windows of so many frames."""

    window: int
    hop: int
    checks: tuple[Check, ...]


class Loss(NamedTuple):
    """Frames ``start`` … ``end`` of a clip that were dropped, and why."""

    start: int
    end: int
    reason: str


def _near_mean(vectors: Array) -> Array:
    """Mean absolute difference of the 10 points from the mean pose below .02 m."""
    points, mean = direction_vectors.to_points(vectors), direction_vectors.to_points(direction_vectors.MEAN)
    return np.abs(points - mean).mean((1, 2, 3)) < 0.02


def _is_bent(vectors: Array) -> Array:
    """The spine off the vertical by more than 30° at worst, or 20° in the mean."""
    angle = np.degrees(np.arccos(np.clip(-vectors[..., 1], -1, 1)))  # the first vector is spine to neck, y down
    return (angle.max(1) > 30) | (angle.mean(1) > 20)


def _still_wrists(vectors: Array) -> Array:
    """Both wrists' position has a variance, summed over x, y, z, below .0014 m²."""
    points = direction_vectors.to_points(vectors)
    return np.all([points[:, :, wrist].var(1).sum(-1) < 0.0014 for wrist in (6, 9)], axis=0)


def _still(vectors: Array) -> Array:
    """Mean absolute deviation from the window's mean below .02. The authors' code takes the data set's mean, from which even a
    frozen pose is far: ours is what their comment says, "static"."""
    return np.abs(vectors - vectors.mean(1, keepdims=True)).mean((1, 2)) < 0.02


FILTERS: dict[str, Filters] = {
    # Yoon et al. 2020, authors' code, on windows of 34 · 1.25 frames; the same data serve Ye et al. 2022
    "ted": Filters(
        42,
        10,
        (
            Check("pose within .02 m of the mean pose", _near_mean),
            Check("spine over 30° (mean over 20°) off the vertical", _is_bent),
            Check("both wrists still (variance < .0014 m²)", _still_wrists),
        ),
    ),
    # Liu et al. 2022, authors' code, on the degrees of windows of 34 frames
    "beat": Filters(34, 10, (Check("static (mean deviation < .02°)", _still),)),
}
"""Corpus → its filters; the papers on the others have none."""


def keep(vectors: Array, filters: Filters | None) -> tuple[list[tuple[int, int]], list[Loss]]:
    """The stretches of a clip that at least one passing window covers, and what lies between.

    Args:
        vectors: (T, D), encoded, not normalised. A clip shorter than a window is one window.

    Returns:
        ``(first, end)`` of every kept stretch, and the losses.
    """
    frames = len(vectors)
    if filters is None or not filters.checks or not frames:
        return [(0, frames)], []
    size = min(filters.window, frames)
    starts = sorted({*range(0, frames - size + 1, filters.hop), frames - size})
    good = np.zeros(frames, bool)
    reasons: list[tuple[int, str]] = []
    for begin in range(0, len(starts), 256):  # ours: some MB of windows at once
        batch = starts[begin : begin + 256]
        windows = np.stack([vectors[s : s + size] for s in batch])
        failures = [check.fails(windows) for check in filters.checks]
        for k, start in enumerate(batch):
            why = [check.reason for check, bad in zip(filters.checks, failures, strict=True) if bad[k]]
            reasons += [(start, reason) for reason in why]
            good[start : start + size] |= not why
    runs = list(_runs(good))
    losses = []
    for start, end in _runs(~good):
        near = sorted({reason for at, reason in reasons if at < end and at + size > start})
        losses.append(Loss(start, end, "; ".join(near)))
    return runs, losses


def _runs(mask: Array) -> Iterable[tuple[int, int]]:
    """``(first, end)`` of every stretch of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return ((int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True))
