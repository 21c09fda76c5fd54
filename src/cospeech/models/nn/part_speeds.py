"""Speeds of the parts of a body: how much of the time each part rests or moves fast, and when; ours.

A network whose loss sees only the speed of a whole pose moves head, arms and hands together and all the time: its hands never
rest. In people, and in the rules, arms rest for a fifth of the time between quick strokes, and the head moves independently.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from .speed_distance import SPAN, pose_speed, timing_distance

__all__ = ["PartWeights", "Parts", "correlation_distance", "distribution_distance", "part_terms", "part_timing_distance"]

_REST = 0.02  # standard deviations a frame [ours]: hands that are slower rest; as in `timing_distance`
_TINY = 1e-6  # [ours] a square whose root has a slope

Parts = Sequence[Sequence[int]]
"""Columns of a pose for each part of a body."""


class PartWeights(NamedTuple):
    """Weights of the terms of a loss; a term of weight 0 is left out."""

    speed_distribution: float = 0.0
    part_correlation: float = 0.0
    part_timing: float = 0.0


def distribution_distance(motion: Tensor, recording: Tensor, parts: Parts) -> Tensor:
    """W₁ of the distributions of the logarithms of each part's speeds; the mean over parts and pieces of `SPAN` frames.

    It says how much of a piece a part rests and how quick its strokes are, but not when in the piece. Pieces are short: over a
    whole window it would be enough to rest in the pauses of the speech.

    Args:
        motion, recording: (B, D, T) poses.
        parts: P lists of columns.
    """

    logs = (_log_speeds(pose, parts) for pose in (motion, recording))
    one, other = (rows.unfold(-1, min(SPAN, rows.shape[-1]), SPAN // 2).sort(-1).values for rows in logs)
    return (one - other).abs().mean()


def part_timing_distance(motion: Tensor, recording: Tensor, parts: Parts) -> Tensor:
    """The mean over the parts of `timing_distance`: each moves when the same part moves in the recording."""
    return torch.stack([timing_distance(motion[:, list(part)], recording[:, list(part)]) for part in parts]).mean()


def correlation_distance(motion: Tensor, recording: Tensor, parts: Parts) -> Tensor:
    """How far the correlations of the speeds, of each part with each, are from those of the recorded window.

    It says which parts move together, but not when. For one part alone it is 0.
    """
    if len(parts) < 2:
        return motion.new_zeros(())

    def correlate(pose: Tensor) -> Tensor:
        logs = _log_speeds(pose, parts)
        logs = logs - logs.mean(-1, keepdim=True)
        size = (logs.square().sum(-1) + _TINY).sqrt()
        together: Tensor = logs @ logs.mT / (size.unsqueeze(2) * size.unsqueeze(1))
        return together

    pairs = torch.triu_indices(len(parts), len(parts), 1)
    return (correlate(motion) - correlate(recording))[:, pairs[0], pairs[1]].abs().mean()


def part_terms(weights: PartWeights, motion: Tensor, recording: Tensor, parts: Parts) -> dict[str, Tensor]:
    """The three distances, weighted, as terms of a loss; of weight 0, no term."""
    distances = (distribution_distance, correlation_distance, part_timing_distance)
    pairs = zip(PartWeights._fields, weights, distances, strict=True)
    return {name: weight * distance(motion, recording, parts) for name, weight, distance in pairs if weight}


def _log_speeds(pose: Tensor, parts: Parts) -> Tensor:
    """(B, P, T)."""
    return torch.stack([(pose_speed(pose[:, list(part)]) + _REST).log() for part in parts], 1)
