"""Statistics of ratings: raters and clips are both drawn from many, and each rater has rated several clips.

A mean over (rater, clip) cells has the variance of Cameron, Gelbach and Miller 2011, clustered by both,

    V = V_raters + V_clips − V_cells,

each with its correction G / (G − 1) for G clusters. A difference between systems is tested by t = mean / √V with
min(raters, clips) − 1 degrees of freedom (Cameron and Miller 2015). Its interval is the percentile interval of a bootstrap that
draws raters and clips, each with replacement (Owen 2007).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

from ...metrics._scipy import scipy
from ...motion.rotations import Array

__all__ = ["Estimate", "alpha", "estimate", "grid"]

DRAWS = 1000  # ours: as of `cospeech.metrics.interval`
INTERVAL = (2.5, 97.5)


class Estimate(NamedTuple):
    """A mean over raters and clips.

    Args:
        mean: over cells; nan where there is none.
        low, high: 95 % interval.
        error: standard error, clustered by rater and by clip.
        p: two-sided, of the mean that chance gives; nan where fewer than two raters or clips were seen, or where chance gives
            none.
        wilcoxon: p value of the signed-rank test over the means of raters, which takes the clips as given.
        cells, raters, clips: how many.
    """

    mean: float
    low: float
    high: float
    error: float
    p: float
    wilcoxon: float
    cells: int
    raters: int
    clips: int


def grid(values: Sequence[tuple[str, str, float]]) -> Array:
    """(rater, clip, value) as an array (raters, clips); a cell with several values has their mean, one without has nan."""
    raters = {name: k for k, name in enumerate(sorted({rater for rater, _, _ in values}))}
    clips = {name: k for k, name in enumerate(sorted({clip for _, clip, _ in values}))}
    total, count = np.zeros((len(raters), len(clips))), np.zeros((len(raters), len(clips)))
    for rater, clip, value in values:
        total[raters[rater], clips[clip]] += value
        count[raters[rater], clips[clip]] += 1
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def estimate(cells: Array, *, chance: float | None = 0.0, seed: int = 0) -> Estimate:
    """Mean, interval and test of an array (raters, clips) with nan where nothing was answered.

    Args:
        cells: (raters, clips).
        chance: the mean that is tested against; None: there is no test, as of ratings.
        seed: of the bootstrap.

    Raises:
        InputError: scipy is not installed.
    """
    seen = np.isfinite(cells)
    count = int(seen.sum())
    raters, clips = int(seen.any(1).sum()), int(seen.any(0).sum())
    if count == 0:
        none = float("nan")
        return Estimate(none, none, none, none, none, none, 0, 0, 0)
    known = np.where(seen, cells, 0.0)
    mean = float(known.sum() / count)
    error = _two_way_error(np.where(seen, cells - mean, 0.0), count, raters, clips)
    low, high = _interval(known, seen, seed)
    p = wilcoxon = float("nan")
    if chance is not None:
        p, wilcoxon = _chance(mean - chance, error, min(raters, clips)), _wilcoxon(cells - chance)
    return Estimate(mean, low, high, error, p, wilcoxon, count, raters, clips)


def _two_way_error(rest: Array, count: int, raters: int, clips: int) -> float:
    """Standard error; where the sum of the parts is below one of them, which chance can do, the larger part."""
    parts = [float((rest.sum(axis) ** 2).sum()) for axis in (1, 0)]
    scaled = [part * g / (g - 1) if g > 1 else 0.0 for part, g in zip(parts, (raters, clips), strict=True)]
    single = float((rest**2).sum()) * (count / (count - 1) if count > 1 else 0.0)
    return sqrt(max(sum(scaled) - single, *scaled, 0.0)) / count


def _chance(mean: float, error: float, clusters: int) -> float:
    if clusters < 2:
        return float("nan")
    if error == 0:  # all said the same: the test knows no variance, and a few such answers prove little
        return 1.0 if mean == 0 else float("nan")
    return float(2 * scipy("stats").t.sf(abs(mean) / error, clusters - 1))


def _wilcoxon(cells: Array) -> float:
    """p value over the means of raters; nan for fewer than two."""
    means = [float(np.nanmean(row)) for row in cells if np.isfinite(row).any()]
    if len(means) < 2:
        return float("nan")
    if not any(means):
        return 1.0
    return float(scipy("stats").wilcoxon(means, zero_method="pratt", method="asymptotic").pvalue)


def _interval(known: Array, seen: Array, seed: int) -> tuple[float, float]:
    """Ends of the 95 % interval: raters and clips are drawn."""
    raters, clips = seen.shape
    draw = np.random.default_rng(seed)
    rows = draw.multinomial(raters, np.full(raters, 1 / raters), DRAWS).astype(np.float64)
    columns = draw.multinomial(clips, np.full(clips, 1 / clips), DRAWS).astype(np.float64)
    counts = ((rows @ seen) * columns).sum(1)
    sums = ((rows @ known) * columns).sum(1)
    low, high = np.percentile(sums[counts > 0] / counts[counts > 0], INTERVAL)
    return float(low), float(high)


def alpha(cells: Array, distance: Callable[[Array, Array], Array] | None = None) -> float:
    """Krippendorff's alpha (Krippendorff 2011): 1 is perfect agreement, 0 what chance gives.

    Args:
        cells: values (raters, units); nan where a rater has not seen a unit.
        distance: squared difference of two values; of an interval scale, (a − b)², where not given.

    Returns:
        nan where no two raters saw the same unit, or all values are the same.
    """
    difference = distance or (lambda a, b: (a - b) ** 2)
    values = np.unique(cells[np.isfinite(cells)])
    counts = np.stack([(cells == value).sum(0) for value in values], 1) if len(values) else np.zeros((0, 0))
    counts = counts[counts.sum(1) >= 2].astype(np.float64)
    if not len(counts):
        return float("nan")
    size = counts.sum(1)[:, None, None]
    pairs = counts[:, :, None] * counts[:, None, :] - counts[:, :, None] * np.eye(len(values))
    together = (pairs / (size - 1)).sum(0)
    each = together.sum(0)
    apart = difference(values[:, None], values[None, :])
    expected = (np.outer(each, each) - np.diag(each)) / (each.sum() - 1)
    if not (expected * apart).sum():
        return float("nan")
    return float(1 - (together * apart).sum() / (expected * apart).sum())
