"""Statistics of ratings. Raters and clips are both samples, and each rater has rated several clips.

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

DRAWS = 1000  # ours: as in `cospeech.metrics.interval`
INTERVAL = (2.5, 97.5)


class Estimate(NamedTuple):
    """A mean over raters and clips.

    Args:
        mean: over cells; nan if there is none.
        low, high: 95 % interval.
        error: standard error, clustered by rater and by clip.
        p: two-sided p value against the mean by chance; nan for fewer than two raters or clips, or if there is no such mean.
        wilcoxon: p value of the signed-rank test over the means of raters; it treats the clips as fixed.
        cells, raters, clips: their numbers.
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
    """Make an array (raters, clips) of (rater, clip, value). A cell with several values has their mean, one without has nan."""
    raters = {name: k for k, name in enumerate(sorted({rater for rater, _, _ in values}))}
    clips = {name: k for k, name in enumerate(sorted({clip for _, clip, _ in values}))}
    total, count = np.zeros((len(raters), len(clips))), np.zeros((len(raters), len(clips)))
    for rater, clip, value in values:
        total[raters[rater], clips[clip]] += value
        count[raters[rater], clips[clip]] += 1
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def estimate(cells: Array, *, chance: float | None = 0.0, seed: int = 0) -> Estimate:
    """Mean, interval and test of an array (raters, clips).

    Args:
        cells: (raters, clips); nan where there is no answer.
        chance: the mean by chance, for the test; None: no test, as for ratings.
        seed: of the bootstrap.

    Raises:
        InputError: scipy is not installed.
    """
    mask = np.isfinite(cells)
    count = int(mask.sum())
    raters, clips = int(mask.any(1).sum()), int(mask.any(0).sum())
    if count == 0:
        none = float("nan")
        return Estimate(none, none, none, none, none, none, 0, 0, 0)
    values = np.where(mask, cells, 0.0)
    mean = float(values.sum() / count)
    error = _two_way_error(np.where(mask, cells - mean, 0.0), count, raters, clips)
    low, high = _interval(values, mask, seed)
    p = wilcoxon = float("nan")
    if chance is not None:
        p, wilcoxon = _chance(mean - chance, error, min(raters, clips)), _wilcoxon(cells - chance)
    return Estimate(mean, low, high, error, p, wilcoxon, count, raters, clips)


def _two_way_error(rest: Array, count: int, raters: int, clips: int) -> float:
    """Standard error. If the sum is below one of its parts, which can happen by chance, it is that of the larger part."""
    parts = [float((rest.sum(axis) ** 2).sum()) for axis in (1, 0)]
    variances = [part * g / (g - 1) if g > 1 else 0.0 for part, g in zip(parts, (raters, clips), strict=True)]
    single = float((rest**2).sum()) * (count / (count - 1) if count > 1 else 0.0)
    return sqrt(max(sum(variances) - single, *variances, 0.0)) / count


def _chance(mean: float, error: float, clusters: int) -> float:
    if clusters < 2:
        return float("nan")
    if error == 0:  # all answers are the same: the test has no variance, and a few such answers prove little
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


def _interval(values: Array, mask: Array, seed: int) -> tuple[float, float]:
    """Ends of the 95 % interval by a bootstrap over raters and clips."""
    raters, clips = mask.shape
    draw = np.random.default_rng(seed)
    rows = draw.multinomial(raters, np.full(raters, 1 / raters), DRAWS).astype(np.float64)
    columns = draw.multinomial(clips, np.full(clips, 1 / clips), DRAWS).astype(np.float64)
    counts = ((rows @ mask) * columns).sum(1)
    sums = ((rows @ values) * columns).sum(1)
    low, high = np.percentile(sums[counts > 0] / counts[counts > 0], INTERVAL)
    return float(low), float(high)


def alpha(cells: Array, distance: Callable[[Array, Array], Array] | None = None) -> float:
    """Krippendorff's alpha (Krippendorff 2011): 1 is perfect agreement, 0 is agreement by chance.

    Args:
        cells: values (raters, units); nan where a rater has not seen a unit.
        distance: squared difference of two values; the default is that of an interval scale, (a − b)².

    Returns:
        Alpha; nan if no two raters saw the same unit, or all values are the same.
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
