"""Inception score: does a classifier recognise the style of each window, and are all styles there?

    IS = exp(mean KL(p ‖ p̄))                                                        (Salimans et al. 2016)

between 1 and the number of classes. Mix-StAGE takes all windows at once with ε = 1e-6 in the logarithms; `inception_score`
takes random parts, as Salimans does, so that there is a spread to print, and needs no ε (0 log 0 = 0).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from .interval import SCORE_DRAWS, bootstrap
from .metric import metric
from .sample import Sample, Score, Tools

__all__ = ["inception_score", "inception_score_published", "score_of_classes"]

EPS = 1e-6  # Mix-StAGE metrics.py
PARTS = 10  # Salimans et al. 2016
SPREAD = 1.96  # 95 % of a normal distribution, for the mean over parts


def score_of_classes(classes: Array, eps: float = 0.0) -> float:
    """exp(Σ mean p log(p + ε) − Σ p̄ log(p̄ + ε)) of class probabilities (N, C).

    Raises:
        InputError: a row is not a distribution.
    """
    classes = np.asarray(classes, np.float64)
    if classes.ndim != 2 or not len(classes) or classes.min() < 0 or not np.allclose(classes.sum(1), 1, atol=1e-4):
        raise InputError(f"class probabilities of shape {classes.shape}", "rows that are not negative and sum to 1 (softmax)")
    mean = classes.mean(0)
    tiny = max(eps, np.finfo(float).tiny)
    return float(np.exp((classes * np.log(classes + tiny)).mean(0).sum() - (mean * np.log(mean + tiny)).sum()))


def _classes(generated: Sequence[Sample], tools: Tools) -> tuple[Array, list[str]]:
    """(N, C) class probabilities of all windows, and the group of each."""
    assert tools.classifier is not None
    probabilities = [tools.classifier.windows(sample) for sample in generated]
    groups = [sample.group for sample, rows in zip(generated, probabilities, strict=True) for _ in rows]
    if not groups:
        raise InputError(f"no clip has {tools.classifier.frames} frames", "longer clips")
    return np.concatenate([rows for rows in probabilities if len(rows)]), groups


@metric("classifier", better="higher", same=("rate", "joints"))
def inception_score(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mean of the score over 10 random parts of the windows, with its 95 % interval."""
    assert tools.classifier is not None
    classes, _ = _classes(generated, tools)
    order = np.random.default_rng(tools.seed).permutation(len(classes))
    parts = min(PARTS, max(1, len(classes) // (2 * classes.shape[1])))  # ours: a part has twice as many windows as classes
    scores = [score_of_classes(classes[part]) for part in np.array_split(order, parts)]
    value = float(np.mean(scores))
    half = SPREAD * float(np.std(scores, ddof=1)) / np.sqrt(parts) if parts > 1 else 0.0
    interval = (value - half, value + half) if parts > 1 else None
    return Score(value, interval, len(classes), f"{tools.classifier.name}, {parts} parts")


@metric("classifier", better="higher", same=("rate", "joints"))
def inception_score_published(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mix-StAGE's IS: all windows at once, ε = 1e-6."""
    assert tools.classifier is not None
    classes, groups = _classes(generated, tools)
    resamples = bootstrap(lambda k: score_of_classes(classes[k], EPS), groups, draws=SCORE_DRAWS, seed=tools.seed)
    return Score(score_of_classes(classes, EPS), resamples.interval, len(classes), tools.classifier.name, resamples.draws)
