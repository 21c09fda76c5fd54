"""95 % intervals by drawing clips with replacement (percentile bootstrap, Efron 1979)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..errors import InputError, say_count
from ..motion.rotations import Array
from .sample import Score

__all__ = ["Resampled", "bootstrap", "mean_score"]

DRAWS = 1000  # ours: the ends of the interval are then known to some 5 % of its width
LEVEL = (2.5, 97.5)  # 95 %
KEPT = 200  # ours: draws that a score keeps; the variance of a difference is then known to 10 %


class Resampled(NamedTuple):
    """What drawing clips with replacement gives: the interval (None for one clip), and the first `KEPT` values."""

    interval: tuple[float, float] | None = None
    draws: tuple[float, ...] = ()

    @classmethod
    def of(cls, values: Array) -> Resampled:
        """The percentile interval of values that were drawn; those that are not finite are left out of it."""
        low, high = np.percentile([v for v in values if np.isfinite(v)] or [np.nan], LEVEL)
        return cls((float(low), float(high)), tuple(map(float, values[:KEPT])))


def mean_score(values: Sequence[float], weights: Sequence[float] | None = None, *, seed: int = 0, note: str = "") -> Score:
    """Weighted mean of one value per clip, with its interval over clips.

    Raises:
        InputError: there is no clip, or a value is not finite.
    """
    x = np.asarray(values, np.float64)
    w = np.ones(len(x)) if weights is None else np.asarray(weights, np.float64)
    lost = np.flatnonzero(~np.isfinite(x))
    if len(lost):
        raise InputError(f"{len(lost)} of {len(x)} values are no numbers; the first is that of clip {lost[0] + 1}")
    if not len(x) or not w.sum() > 0:
        raise InputError(f"a mean over {say_count(len(x), 'clip')}", "at least one clip that is long enough")
    value = float(x @ w / w.sum())
    if len(x) < 2:
        return Score(value, None, 1, note)
    counts = np.random.default_rng(seed).multinomial(len(x), np.full(len(x), 1 / len(x)), DRAWS) * w
    with np.errstate(all="ignore"):
        drawn = Resampled.of((counts @ x) / counts.sum(1))
    return Score(value, drawn.interval, len(x), note, drawn.draws)


def bootstrap(statistic: Callable[[Array], float], count: int, *, draws: int, seed: int = 0) -> Resampled:
    """``statistic(indices)`` with ``count`` clips drawn ``draws`` times; nothing where there is one clip only."""
    if count < 2:
        return Resampled()
    rng = np.random.default_rng(seed)
    return Resampled.of(np.array([statistic(rng.integers(0, count, count)) for _ in range(draws)]))
