"""95 % intervals by drawing recordings with replacement (percentile bootstrap, Efron 1979).

Windows of one recording, and takes of one speech, are alike. So they are drawn together, as a group (`Sample.group`): drawn one
by one, they would give intervals that are too narrow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ..errors import InputError, say_count
from ..motion.rotations import Array
from .sample import Sample, Score

__all__ = ["Resampled", "bootstrap", "draw_groups", "groups_of", "mean_score", "number_groups"]

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


def groups_of(samples: Sequence[Sample]) -> list[str]:
    """The group of each sample."""
    return [sample.group for sample in samples]


def number_groups(groups: Sequence[str]) -> Array:
    """(N,) the number of each group, in the order in which they first occur."""
    numbers = {name: k for k, name in enumerate(dict.fromkeys(groups))}
    return np.array([numbers[name] for name in groups], np.int64)


def mean_score(
    values: Sequence[float], weights: Sequence[float] | None = None, *, groups: Sequence[str] | None = None, seed: int = 0,
    note: str = "",
) -> Score:  # fmt: skip
    """Weighted mean of one value per clip, with its interval over groups of clips.

    Args:
        values: of the clips.
        weights: of the values; None: 1.
        groups: names; clips of one group are drawn together. None: each clip is one.
        seed: of the draws.
        note: of the score.

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
    place = np.arange(len(x)) if groups is None else number_groups(groups)
    sums, sizes = np.bincount(place, w * x), np.bincount(place, w)
    if len(sizes) < 2:
        return Score(value, None, len(x), note)
    counts = np.random.default_rng(seed).multinomial(len(sizes), np.full(len(sizes), 1 / len(sizes)), DRAWS)
    with np.errstate(all="ignore"):
        resamples = Resampled.of((counts @ sums) / (counts @ sizes))
    return Score(value, resamples.interval, len(x), note, resamples.draws)


def bootstrap(statistic: Callable[[Array], float], groups: Sequence[str], *, draws: int, seed: int = 0) -> Resampled:
    """The interval of a statistic over groups; none for a single group.

    Args:
        statistic: numbers of clips, some of them several times → a value.
        groups: of each clip; the clips of a group are drawn together.
        draws: number of draws, each of as many groups as there are.
        seed: of the draws.
    """
    values = [statistic(clips) for clips in draw_groups(groups, draws=draws, seed=seed)]
    return Resampled.of(np.array(values)) if values else Resampled()


def draw_groups(groups: Sequence[str], *, draws: int, seed: int = 0) -> Iterator[Array]:
    """For each draw, the numbers of the clips of as many groups as there are; nothing for a single group."""
    place, rng = number_groups(groups), np.random.default_rng(seed)
    clips = [np.flatnonzero(place == k) for k in range(place.max(initial=-1) + 1)]
    for _ in range(draws if len(clips) > 1 else 0):
        yield np.concatenate([clips[k] for k in rng.integers(0, len(clips), len(clips))])
