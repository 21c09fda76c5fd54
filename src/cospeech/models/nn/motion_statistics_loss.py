"""Statistics of the manner of a motion: means and deviations of a clip, which are alike in clips of one manner; ours."""

from __future__ import annotations

import torch
from torch import Tensor

from .pose_discriminator import FASTER

__all__ = ["motion_statistics", "statistics_term"]

_TINY = 1e-6  # ours: a variance whose root has a slope


def motion_statistics(pose: Tensor) -> Tensor:
    """(B, D, T) → (B, 4 D): mean; deviations of pose, velocity and acceleration, scaled as for the discriminator."""
    velocity = FASTER * pose.diff(dim=-1)
    deviations = [(x.var(-1, correction=0) + _TINY).sqrt() for x in (pose, velocity, FASTER * velocity.diff(dim=-1))]
    return torch.cat([pose.mean(-1), *deviations], 1)


def statistics_term(weight: float, motion: Tensor, recording: Tensor) -> dict[str, Tensor]:
    """``motion_statistics``, the weighted L1 distance of the statistics of (B, D, T) poses, as a term; of weight 0, no term."""
    if not weight:
        return {}
    return {"motion_statistics": weight * (motion_statistics(motion) - motion_statistics(recording)).abs().mean()}
