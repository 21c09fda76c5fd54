"""How the parts of a body share their speed out: how much of the time each rests or hurries, and when; ours.

A network that is told of the speed of a whole pose moves head, arms and hands all together and all the time: its hands never
rest. In people, and in the rules, arms rest for a fifth of the time between quick strokes, and the head goes its own way.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from .speed_distance import pose_speed, timing_distance

__all__ = ["Parts", "distribution_distance", "part_timing_distance", "part_terms"]

_REST = 0.02  # standard deviations a frame [ours]: hands that are slower rest; the same as of `timing_distance`

Parts = Sequence[Sequence[int]]
"""Columns of a pose for each part of a body."""


def distribution_distance(made: Tensor, recorded: Tensor, parts: Parts) -> Tensor:
    """W₁ of the distributions of the logarithms of each part's speeds in a window; the mean over parts and windows.

    It says how much of the time a part rests and how quick its strokes are, and nothing of when.

    Args:
        made, recorded: (B, D, T) poses.
        parts: P lists of columns.
    """

    def spread(pose: Tensor) -> Tensor:
        logs = torch.stack([(pose_speed(pose[:, list(part)]) + _REST).log() for part in parts], 1)
        return logs.sort(-1).values

    return (spread(made) - spread(recorded)).abs().mean()


def part_timing_distance(made: Tensor, recorded: Tensor, parts: Parts) -> Tensor:
    """The mean over the parts of `timing_distance`: each moves when the same part moves in the recording."""
    return torch.stack([timing_distance(made[:, list(part)], recorded[:, list(part)]) for part in parts]).mean()


def part_terms(distribution: float, timing: float, made: Tensor, recorded: Tensor, parts: Parts) -> dict[str, Tensor]:
    """``speed_distribution`` and ``part_timing``, weighted, as terms of a loss; of weight 0, no term."""
    terms = {"speed_distribution": distribution * distribution_distance(made, recorded, parts)} if distribution else {}
    return terms | ({"part_timing": timing * part_timing_distance(made, recorded, parts)} if timing else {})
