"""95 % intervals by drawing clips with replacement (percentile bootstrap, Efron 1979)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from .sample import Score

__all__ = ["bootstrap", "mean_score"]

DRAWS = 1000  # ours: the ends of the interval are then known to some 5 % of its width
LEVEL = (2.5, 97.5)  # 95 %


def mean_score(values: Sequence[float], weights: Sequence[float] | None = None, *, seed: int = 0, note: str = "") -> Score:
    """Weighted mean of one value per clip, with its interval over clips.

    Raises:
        InputError: there is no clip, or a value is not finite.
    """
    x = np.asarray(values, np.float64)
    w = np.ones(len(x)) if weights is None else np.asarray(weights, np.float64)
    if not len(x) or not np.isfinite(x).all() or not w.sum() > 0:
        raise InputError(f"a mean over {len(x)} clips", "at least one clip that is long enough")
    value = float(x @ w / w.sum())
    if len(x) < 2:
        return Score(value, None, 1, note)
    counts = np.random.default_rng(seed).multinomial(len(x), np.full(len(x), 1 / len(x)), DRAWS) * w
    total = counts.sum(1)
    low, high = np.percentile((counts @ x)[total > 0] / total[total > 0], LEVEL)
    return Score(value, (float(low), float(high)), len(x), note)


def bootstrap(statistic: Callable[[Array], float], count: int, *, draws: int, seed: int = 0) -> tuple[float, float] | None:
    """Interval of ``statistic(indices)`` with ``count`` clips drawn ``draws`` times; None where there is one clip only."""
    if count < 2:
        return None
    rng = np.random.default_rng(seed)
    values = [statistic(rng.integers(0, count, count)) for _ in range(draws)]
    low, high = np.percentile([v for v in values if np.isfinite(v)] or [np.nan], LEVEL)
    return float(low), float(high)
