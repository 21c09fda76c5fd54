"""Distances of the speed of generated motion from that of recorded motion: frame by frame, and in its timing; ours."""

from __future__ import annotations

from torch import Tensor
from torch.nn import functional as F

__all__ = ["SMOOTH", "SPAN", "pose_speed", "speed_distance", "timing_distance", "timing_term"]

SMOOTH = 3  # frames, 0.2 s at 15 a second [ours]: a stroke that comes a frame late is not wrong
SPAN = 31  # frames, 2 s at 15 a second [ours]: slower changes are the amplitude of a clip and its pauses, not its strokes
_REST = 0.02  # standard deviations a frame [ours]: a fifth of the mean speed; hands that are slower rest
_TINY = 1e-6  # [ours] a square whose root has a slope


def pose_speed(pose: Tensor) -> Tensor:
    """(B, D, T) → (B, T − 1 − 2) root mean square by which standardised poses change in a frame, over `SMOOTH` frames."""
    speed = (pose.diff(dim=-1).square().mean(1) + _TINY).sqrt()
    return F.avg_pool1d(speed.unsqueeze(1), SMOOTH, 1).squeeze(1)


def speed_distance(motion: Tensor, recording: Tensor) -> Tensor:
    """Mean square of the difference of the speeds of (B, D, T) poses, by the mean square of the recorded ones."""
    target = pose_speed(recording)
    return (pose_speed(motion) - target).square().mean() / target.square().mean().clamp_min(_TINY)


def timing_distance(motion: Tensor, recording: Tensor) -> Tensor:
    """1 − r of two speeds of (B, D, T) poses; r is the correlation of their logarithms less the mean over `SPAN` frames around.

    Strokes of another size or form have the distance 0, if they come at the same time.
    """
    one, other = (_strokes(pose_speed(pose)) for pose in (motion, recording))
    r = (one * other).sum(1) / (one.square().sum(1) * other.square().sum(1) + _TINY).sqrt()
    return (1 - r).mean()


def timing_term(weight: float, motion: Tensor, recording: Tensor) -> dict[str, Tensor]:
    """``stroke_timing``, the weighted `timing_distance` of (B, D, T) poses, as a term of a loss; of weight 0, no term."""
    return {"stroke_timing": weight * timing_distance(motion, recording)} if weight else {}


def _strokes(speed: Tensor) -> Tensor:
    """(B, T) logarithms of speeds without what changes slowly; the mean of each row is 0."""
    logs = (speed + _REST).log()
    slow = F.avg_pool1d(logs.unsqueeze(1), SPAN, 1, SPAN // 2, count_include_pad=False).squeeze(1)
    fast = logs - slow
    return fast - fast.mean(1, keepdim=True)
