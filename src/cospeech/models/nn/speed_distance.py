"""How far the speed of made motion is from that of recorded motion, frame by frame; ours."""

from __future__ import annotations

from torch import Tensor
from torch.nn import functional as F

__all__ = ["SMOOTH", "pose_speed", "speed_distance"]

SMOOTH = 3  # frames, 0.2 s at 15 a second [ours]: a stroke that comes a frame late is not wrong
_TINY = 1e-6  # [ours] a square whose root has a slope


def pose_speed(pose: Tensor) -> Tensor:
    """(B, D, T) → (B, T − 1 − 2) root mean square by which standardised poses change in a frame, over `SMOOTH` frames."""
    speed = (pose.diff(dim=-1).square().mean(1) + _TINY).sqrt()
    return F.avg_pool1d(speed.unsqueeze(1), SMOOTH, 1).squeeze(1)


def speed_distance(made: Tensor, recorded: Tensor) -> Tensor:
    """Mean square of the difference of the speeds of (B, D, T) poses, by the mean square of the recorded ones."""
    wanted = pose_speed(recorded)
    return (pose_speed(made) - wanted).square().mean() / wanted.square().mean().clamp_min(_TINY)
