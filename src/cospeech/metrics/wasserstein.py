"""W1: how far the distributions of speed and acceleration lie apart, in m/s and m/s² (px per frame as published).

Mix-StAGE takes the mean over joints of each frame, in pixels per frame, in a histogram of 0 … 300 by 0.1 (what is beyond is
lost). `w1_speed` and `w1_acceleration` are of every joint and frame, without bins: ∫ |F₁ − F₂|.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from ._scipy import scipy
from .interval import bootstrap, groups_of
from .metric import metric
from .sample import Sample, Score, Tools, pose_vectors

__all__ = ["distance", "rates", "w1_acceleration", "w1_speed", "w1_speed_mix_stage"]

BINS = np.arange(0, 300, 0.1)  # Mix-StAGE metrics.py
MASKED, PATS = (0, 7, 8, 9), 52  # Mix-StAGE metrics.py
DRAWS = 50  # ours: sorting is what takes the time
GRID = 512  # ours: quantiles kept of each clip for the bootstrap


def rates(sample: Sample, order: int) -> Array:
    """(T − order, J) length of the ``order``-th difference of every joint relative to the root, per second ** order."""
    size = 3 if sample.positions is not None else 2
    poses = pose_vectors(sample)
    if len(poses) <= order:
        raise InputError(f"{sample.name!r} has {len(poses)} frames", f"at least {order + 1}")
    change = np.diff(poses, n=order, axis=0) * sample.fps**order
    return np.linalg.norm(change.reshape(len(change), -1, size), axis=-1)


def distance(a: Array, b: Array) -> float:
    """∫ |F₁ − F₂| of two samples of numbers (Wasserstein-1)."""
    return float(scipy("stats").wasserstein_distance(np.ravel(a), np.ravel(b)))


def _score(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools, order: int) -> Score:
    if not reference:
        raise InputError("no reference clips")
    a, b = ([rates(sample, order).ravel() for sample in side] for side in (generated, reference))
    steps = (np.arange(GRID) + 0.5) / GRID
    small = [np.quantile(x, steps) for x in a]
    truth = np.quantile(np.concatenate(b), steps)
    value = distance(np.concatenate(a), np.concatenate(b))
    shift = value - distance(np.concatenate(small), truth)
    resamples = bootstrap(
        lambda k: distance(np.concatenate([small[i] for i in k]), truth), groups_of(generated), draws=DRAWS, seed=tools.seed
    )
    ends = resamples.interval
    interval = None if ends is None else (max(ends[0] + shift, 0.0), max(ends[1] + shift, 0.0))
    return Score(value, interval, len(generated), draws=tuple(draw + shift for draw in resamples.draws))


@metric("positions|points", better="lower", unit="m/s (px/s)")
def w1_speed(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Wasserstein-1 distance of the joint speeds to the reference's, m/s."""
    return _score(generated, reference, tools, 1)


@metric("positions|points", better="lower", unit="m/s² (px/s²)")
def w1_acceleration(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Wasserstein-1 distance of the joint accelerations to the reference's, m/s²."""
    return _score(generated, reference, tools, 2)


def _histogram(samples: Sequence[Sample]) -> Array:
    counts = np.zeros(len(BINS) - 1)
    for sample in samples:
        assert sample.points is not None
        mask = MASKED if sample.points.shape[1] == PATS else (0,)
        keep = [k for k in range(sample.points.shape[1]) if k not in mask]
        speed = np.linalg.norm(np.diff((sample.points - sample.points[:, :1])[:, keep], axis=0), axis=-1).mean(1)
        counts += np.histogram(speed, BINS)[0]
    return counts


@metric("points", better="lower", unit="px per frame", same=("rate",))
def w1_speed_mix_stage(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """W1 of Mix-StAGE: of histograms (0 … 300 px by 0.1) of the joints' mean speed per frame; 1000 where one is empty."""
    counts, true = _histogram(generated), _histogram(reference)
    if not (counts.sum() and true.sum()):
        return Score(1000.0, None, len(generated), "a histogram is empty")
    return Score(float(scipy("stats").wasserstein_distance(BINS[:-1], BINS[:-1], counts, true)), None, len(generated))
