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
SCORE_DRAWS = 200  # ours: draws that a score keeps; the variance of a difference is then known to 10 %


class Resampled(NamedTuple):
    """Result of a bootstrap over clips: the interval (None for one clip), and the first `SCORE_DRAWS` values."""

    interval: tuple[float, float] | None = None
    draws: tuple[float, ...] = ()

    @classmethod
    def of(cls, values: Array) -> Resampled:
        """The percentile interval of the drawn values; it leaves out those that are not finite."""
        low, high = np.percentile([v for v in values if np.isfinite(v)] or [np.nan], LEVEL)
        return cls((float(low), float(high)), tuple(map(float, values[:SCORE_DRAWS])))


def mean_score(values: Sequence[float], weights: Sequence[float] | None = None, *, seed: int = 0, note: str = "") -> Score:
    """Weighted mean of one value per clip, with its interval over clips.

    Raises:
        InputError: there is no clip, or a value is not finite.
    """
    x = np.asarray(values, np.float64)
    w = np.ones(len(x)) if weights is None else np.asarray(weights, np.float64)
    invalid = np.flatnonzero(~np.isfinite(x))
    if len(invalid):
        raise InputError(f"{len(invalid)} of {len(x)} values are no numbers; the first is that of clip {invalid[0] + 1}")
    if not len(x) or not w.sum() > 0:
        raise InputError(f"a mean over {say_count(len(x), 'clip')}", "at least one clip that is long enough")
    value = float(x @ w / w.sum())
    if len(x) < 2:
        return Score(value, None, 1, note)
    counts = np.random.default_rng(seed).multinomial(len(x), np.full(len(x), 1 / len(x)), DRAWS) * w
    with np.errstate(all="ignore"):
        resamples = Resampled.of((counts @ x) / counts.sum(1))
    return Score(value, resamples.interval, len(x), note, resamples.draws)


def bootstrap(statistic: Callable[[Array], float], count: int, *, draws: int, seed: int = 0) -> Resampled:
    """The interval of ``statistic(indices)``, where ``count`` clips are drawn ``draws`` times; none for a single clip."""
    if count < 2:
        return Resampled()
    rng = np.random.default_rng(seed)
    return Resampled.of(np.array([statistic(rng.integers(0, count, count)) for _ in range(draws)]))
