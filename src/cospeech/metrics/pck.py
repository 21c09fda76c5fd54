"""PCK: the share of joints that are near enough to where they were. Three published definitions, and one without gifts.

As published the root (always right, positions are relative to it) and the frames that the system was *given* count as hits.
`pck` leaves both out. All of them compare with one recording: they reward the mean pose over a plausible other gesture.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from .interval import SCORE_DRAWS, bootstrap, groups_of, mean_score
from .metric import metric, pair_samples
from .sample import Sample, Score, Tools, select_points

__all__ = ["box_thresholds", "hits", "pck", "pck_2d", "pck_gfge", "pck_mix_stage", "pck_s2g"]

NEAR = 0.1  # metres (GFGE cal_metrics.py, "< 0.1" in the unit of its bone lengths)
ALPHAS = (0.1, 0.2)  # of the box (Mix-StAGE metrics.py); Speech2Gesture: .2 alone


def hits(motion: Array, true: Array, threshold: float | Array, *, closed: bool = False) -> Array:
    """(T, J) whether |motion − true| < threshold (≤ where ``closed``), for positions (T, J, D) relative to their own root.

    Raises:
        InputError: the shapes differ.
    """
    if motion.shape != true.shape or motion.ndim != 3:
        raise InputError(f"positions of shape {motion.shape} against {true.shape}")
    gap = np.linalg.norm((motion - motion[:, :1]) - (true - true[:, :1]), axis=-1)
    return gap <= threshold if closed else gap < threshold


def box_thresholds(true: Array, alpha: float) -> Array:
    """(T, 1) α × the longer side of each frame's box around all points (T, K, 2), the masked ones too."""
    return alpha * np.ptp(true, axis=1).max(-1, keepdims=True)


@metric("positions", better="higher", paired=True)
def pck(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Share of joints within 0.1 m of the recording, without root and seed frames."""
    values, weights, groups = [], [], []
    for sample, _, motion, true in pair_samples(generated, reference, "positions"):
        right = hits(motion, true, NEAR)[sample.seed_frames :, 1:]
        if right.size:
            values.append(float(right.mean()))
            weights.append(float(right.size))
            groups.append(sample.group)
    return mean_score(values, weights, groups=groups, seed=tools.seed)


@metric("positions", better="higher", paired=True)
def pck_gfge(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """PCK of the flow paper: within 0.1 m; it counts the root and the seed frames as hits."""
    pairs = pair_samples(generated, reference, "positions")
    values = [float(hits(motion, true, NEAR).mean()) for _, _, motion, true in pairs]
    return mean_score(values, [motion.size for _, _, motion, _ in pairs], groups=groups_of(generated), seed=tools.seed)


def _shares(generated: Sequence[Sample], reference: Sequence[Sample], alpha: float) -> tuple[list[float], list[int]]:
    shares, sizes = [], []
    for _, _, points, true in pair_samples(generated, reference, "points"):
        keep = select_points(points.shape[1])
        right = hits(points, true, box_thresholds(true, alpha))[:, keep]
        shares.append(float(right.mean()))
        sizes.append(right.size)
    return shares, sizes


@metric("points", better="higher", paired=True)
def pck_2d(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Share of key points within α of the frame's box, mean of α = .1 and .2; every frame counts the same."""
    low, high = (_shares(generated, reference, alpha) for alpha in ALPHAS)
    values = [(a + b) / 2 for a, b in zip(low[0], high[0], strict=True)]
    return mean_score(values, low[1], groups=groups_of(generated), seed=tools.seed)


@metric("points", better="higher", paired=True)
def pck_mix_stage(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """PCK of Mix-StAGE: mean of the *running* means over clips, so that early clips count more."""
    runs = [_shares(generated, reference, alpha) for alpha in ALPHAS]
    shares, sizes = np.array([run[0] for run in runs]), np.array(runs[0][1], np.float64)

    def of(order: Array) -> float:
        weights = sizes[order]
        running = np.cumsum(shares[:, order] * weights, 1) / np.cumsum(weights)
        return float((running @ weights).mean() / weights.sum())

    resamples = bootstrap(of, groups_of(generated), draws=SCORE_DRAWS, seed=tools.seed)
    value = of(np.arange(len(sizes)))
    return Score(value, resamples.interval, len(sizes), "depends on the order of clips", resamples.draws)


@metric("points", better="higher", paired=True)
def pck_s2g(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """PCK of Speech2Gesture: α = .2 of the box around the kept points, the threshold itself a hit."""
    values, sizes = [], []
    for _, _, points, true in pair_samples(generated, reference, "points"):
        keep = select_points(points.shape[1])
        threshold = box_thresholds(true[:, keep], ALPHAS[1])
        right = hits(points, true, threshold, closed=True)[:, keep]
        values.append(float(right.mean()))
        sizes.append(right.size)
    return mean_score(values, sizes, groups=groups_of(generated), seed=tools.seed)
