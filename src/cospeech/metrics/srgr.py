"""SRGR, semantic-relevance gesture recall (BEAT): the share of joints that are right, weighted by how much the words mean.

As coded: a joint is right where |Δx| + |Δy| + |Δz| of its Euler angles is below 4° (359° against 1° is wrong); the weight of a
frame is its semantic score ÷ 0.165, the mean of BEAT, so that a perfect score is 1 only for clips with that mean; frames that
were given count. `srgr` takes the angle of the rotation between the two, weights that sum to 1, and no given frames. Joints
that stand still in all recordings (legs that a representation leaves out) are in neither: they would always be right. BEAT's
code has only the 47 joints that move.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array, quat_angle, quat_to_euler
from .interval import mean_score
from .metric import metric, pair_samples
from .sample import Sample, Score, Tools

__all__ = ["right_joints", "srgr", "srgr_beat"]

NEAR = 4.0  # degrees (BEAT 2022 test.py)
MEAN_SCORE = 0.165  # mean semantic score of BEAT (utils/metric.py)
STILL = 1e-3  # degrees; ours: rounding of what does not move


def right_joints(motion: Array, true: Array) -> Array:
    """(T, J) whether two local rotations (T, J, 4) differ by less than 4°."""
    return np.degrees(quat_angle(motion, true)) < NEAR


def _moving(pairs: Sequence[tuple[Sample, Sample, Array, Array]]) -> dict[int, Array]:
    """Number of joints → (J,) whether each moves in any recording with so many joints; all joints where none moves."""
    masks: dict[int, Array] = {}
    first: dict[int, Array] = {}
    for *_, true in pairs:
        count = true.shape[1]
        moves = np.degrees(quat_angle(true, first.setdefault(count, true[:1]))).max(0, initial=0) > STILL
        masks[count] = masks.get(count, np.zeros(count, bool)) | moves
    return {count: moves if moves.any() else ~moves for count, moves in masks.items()}


def _semantics(sample: Sample) -> Array:
    scores = np.asarray(sample.semantics, np.float64)
    if scores.min(initial=0) < 0 or scores.max(initial=0) > 1:
        raise InputError(f"semantic scores of {sample.name!r} from {scores.min():g} to {scores.max():g}", "0 … 1")
    return scores


@metric("rotations", "semantics", better="higher", paired=True)
def srgr(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Share of joints within 4° of the recording; the semantic score weights the frames; 1 is perfect."""
    values, weights, groups, pairs = [], [], [], pair_samples(generated, reference, "rotations")
    moving = _moving(pairs)
    for sample, truth, motion, true in pairs:
        scores, moves = _semantics(truth)[sample.seed_frames :], moving[true.shape[1]]
        if scores.sum() > 0:
            right = right_joints(motion[:, moves], true[:, moves])[sample.seed_frames :].mean(1)
            values.append(float(right @ scores / scores.sum()))
            weights.append(float(scores.sum()))
            groups.append(sample.group)
    if not values:
        raise InputError("no frame has a semantic score above 0", "annotated recordings, such as BEAT's")
    return mean_score(values, weights, groups=groups, seed=tools.seed)


@metric("rotations", "semantics", better="higher", paired=True)
def srgr_beat(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """SRGR as coded for BEAT: sum of Euler differences below 4°, weights ÷ 0.165; may exceed 1."""
    values, weights, groups, pairs = [], [], [], pair_samples(generated, reference, "rotations")
    moving = _moving(pairs)
    for sample, truth, *both in pairs:
        motion, true = (joints[:, moving[joints.shape[1]]] for joints in both)
        gap = np.abs(np.degrees(quat_to_euler(motion, "XYZ") - quat_to_euler(true, "XYZ"))).sum(-1)
        values.append(float(((gap < NEAR).mean(1) * _semantics(truth) / MEAN_SCORE).mean()))
        weights.append(float(len(motion)))
        groups.append(sample.group)
    return mean_score(values, weights, groups=groups, seed=tools.seed)
