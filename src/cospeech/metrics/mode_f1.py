"""Mode F1 of Mix-StAGE: are the modes of pose and movement (the nearest of 8 k-means centres) those of the recording?

A frame is pose ⊕ velocity ⊕ speed of 48 key points of PATS: x₀…x₄₇ y₀…y₄₇, their differences to the frame before, and the
lengths of these, in pixels per frame: 96 + 96 + 48 = 240 numbers, shoulders 2 × 167 px apart, y *down*, relative to the neck.
As published, clips lie end to end and the velocity jumps across their borders; `mode_f1` starts every clip at velocity 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from .interval import bootstrap, groups_of
from .metric import metric, pair_samples
from .sample import Sample, Score, Tools

__all__ = ["average_f1", "confusion", "mode_f1", "mode_f1_published", "mode_features", "nearest_centre"]

POINTS, MASKED = 52, (0, 7, 8, 9)  # of PATS; neck, nose and eyes are left out (Mix-StAGE transform.py)
DRAWS = 200  # ours


def mode_features(points: Array) -> Array:
    """(T, 52, 2) key points with y up → (T, 240) pose ⊕ velocity ⊕ speed as the published centres have them (y down).

    Raises:
        InputError: not 52 points, or no frame.
    """
    points = np.asarray(points, np.float64)
    if points.ndim != 3 or points.shape[1:] != (POINTS, 2) or not len(points):
        raise InputError(f"key points of shape {points.shape}", f"(T, {POINTS}, 2), as PATS has them")
    keep = [k for k in range(POINTS) if k not in MASKED]
    pose = (points - points[:, :1])[:, keep] * np.array([1.0, -1.0])
    velocity = np.diff(pose, axis=0, prepend=pose[:1])
    return np.concatenate(
        [x.transpose(0, 2, 1).reshape(len(x), -1) for x in (pose, velocity)] + [np.linalg.norm(velocity, axis=-1)], axis=1
    )


def nearest_centre(features: Array, centres: Array) -> Array:
    """(T,) index of the nearest of (K, 240) centres; the first of equals.

    Raises:
        InputError: the centres are not of this many dimensions.
    """
    centres = np.asarray(centres, np.float64)
    if centres.ndim != 2 or centres.shape[1] != features.shape[1] or not np.isfinite(centres).all():
        raise InputError(f"centres of shape {centres.shape}", f"(K, {features.shape[1]})")
    return np.argmin(np.square(centres).sum(1) - 2 * features @ centres.T, axis=1)


def confusion(true: Array, predictions: Array, modes: int) -> Array:
    """(K, K) counts: rows are the modes of the recording, columns those of the generated motion."""
    return np.bincount(true * modes + predictions, minlength=modes**2).reshape(modes, modes)


def average_f1(counts: Array) -> float:
    """F1 of each mode, weighted by how often the recording has it; modes that never occur count 0."""
    hit = np.diag(counts).astype(np.float64)
    support, predictions = counts.sum(1), counts.sum(0)
    f1 = 2 * hit / np.maximum(support + predictions, 1)
    return float(f1 @ support / support.sum())


def _score(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools, end_to_end: bool) -> Score:
    pairs = pair_samples(generated, reference, "points")
    centres = np.asarray(tools.centres, np.float64)
    sides = [[true for *_, true in pairs], [points for _, _, points, _ in pairs]]
    if end_to_end:
        ends = np.cumsum([len(true) for true in sides[0]])[:-1]
        modes = [np.split(nearest_centre(mode_features(np.concatenate(side)), centres), ends) for side in sides]
    else:
        modes = [[nearest_centre(mode_features(points), centres) for points in side] for side in sides]
    counts = [confusion(true, own, len(centres)) for true, own in zip(*modes, strict=True)]
    groups = groups_of(generated)
    resamples = bootstrap(lambda k: average_f1(np.sum([counts[i] for i in k], 0)), groups, draws=DRAWS, seed=tools.seed)
    total = np.sum(counts, 0)
    return Score(average_f1(total), resamples.interval, int(total.sum()), f"{len(centres)} centres", resamples.draws)


@metric("points", "centres", better="higher", paired=True)
def mode_f1(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Support-weighted F1 of the nearest centres, velocity 0 at the start of every clip."""
    return _score(generated, reference, tools, end_to_end=False)


@metric("points", "centres", better="higher", paired=True)
def mode_f1_published(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mix-StAGE's F1 as coded: the same with clips laid end to end, velocity jumping across their borders."""
    return _score(generated, reference, tools, end_to_end=True)
