"""GENEA's numbers: mean jerk, mean acceleration, and the Hellinger distance of speed histograms.

Jerk and acceleration are means over joints and frames of a clip, then over clips. They say nothing by themselves (a still body
has none): they are best where they equal the reference's. GENEA multiplies by 30 whatever the frame rate is, and drops speeds
above 49 cm/s from its histogram; ours use the rate of the motion and a last bin without an end. Everything is relative to the
root.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from .interval import bootstrap, groups_of, mean_score
from .metric import metric
from .sample import Sample, Score, Tools
from .wasserstein import rates

__all__ = ["acceleration", "hellinger", "hellinger_speed", "hellinger_speed_genea", "jerk", "jerk_genea"]

FPS = 30.0  # calk_jerk_or_acceleration.py: "frame rate was 30 fps"
EDGES = np.arange(0, 0.50, 0.01)  # m/s; calc_histogram.py: bins of 1 cm/s from 0 to 49
DRAWS = 200  # ours
_ROUNDING = 1e-12  # a difference of two sums below this is a rounding error, whose root would look like a distance


def hellinger(a: Array, b: Array) -> float:
    """√(1 − Σ √(p q)) of two histograms, 0 … 1; with an empty one it is 1.

    >>> hellinger(np.array([1, 1]), np.array([5, 5])), hellinger(np.array([1, 0]), np.array([0, 1]))
    (0.0, 1.0)
    """
    if a.shape != b.shape or min(a.min(), b.min()) < 0:
        raise InputError(f"histograms of shape {a.shape} and {b.shape}", "counts in the same bins")
    if not (a.sum() and b.sum()):
        return 1.0
    rest = 1 - np.sqrt((a / a.sum()) * (b / b.sum())).sum()
    return float(np.sqrt(rest)) if rest > _ROUNDING else 0.0


@metric("positions", better="reference", unit="m/s³")
def jerk(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mean jerk of the joints, m/s³; every clip counts the same; best where it equals the reference's."""
    return mean_score([float(rates(sample, 3).mean()) for sample in generated], groups=groups_of(generated), seed=tools.seed)


@metric("positions", better="reference", unit="m/s²")
def acceleration(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mean acceleration of the joints, m/s²; every clip counts the same; best where it equals the reference's."""
    return mean_score([float(rates(sample, 2).mean()) for sample in generated], groups=groups_of(generated), seed=tools.seed)


@metric("positions", better="reference", unit="m/s³ at 30 fps")
def jerk_genea(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """GENEA's average jerk: × 30³ whatever the frame rate is."""
    values = [float(rates(sample, 3).mean() * (FPS / sample.fps) ** 3) for sample in generated]
    return mean_score(values, groups=groups_of(generated), seed=tools.seed)


def _histograms(samples: Sequence[Sample], *, end: bool) -> list[Array]:
    edges = np.append(EDGES, np.inf) if end else EDGES
    return [np.histogram(rates(sample, 1), edges)[0] for sample in samples]


def _score(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools, end: bool) -> Score:
    if not reference:
        raise InputError("no reference clips")
    histograms, true = _histograms(generated, end=end), np.sum(_histograms(reference, end=end), 0)
    resamples = bootstrap(
        lambda k: hellinger(np.sum([histograms[i] for i in k], 0), true), groups_of(generated), draws=DRAWS, seed=tools.seed
    )
    return Score(hellinger(np.sum(histograms, 0), true), resamples.interval, len(histograms), draws=resamples.draws)


@metric("positions", better="lower")
def hellinger_speed(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Hellinger distance of speed histograms (1 cm/s to 49, and all that is faster), 0 … 1."""
    return _score(generated, reference, tools, end=True)


@metric("positions", better="lower")
def hellinger_speed_genea(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """GENEA's Hellinger distance: speeds above 49 cm/s are not counted."""
    return _score(generated, reference, tools, end=False)
