"""In whose manner poses move, whatever their mean and their size: a classifier for Mix-StAGE, extended; ours.

The style encoder of the paper sees poses, so the mean pose and the amplitude are enough for it to name a speaker. Both are set
by the calibration of a bundle as well. What is left of a style is its manner: which parts move together and when, how long
they rest, how quick they are for their size. This classifier sees each number of a window by its own mean and deviation.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.func import functional_call
from torch.nn import functional as F

from .patch import velocity
from .pose_discriminator import FASTER
from .unet1d import SLOPE

__all__ = ["MannerClassifier", "standardise_windows"]

_STILL = 0.02  # [ours] standard deviations of the corpus: a number that varies by less in a window counts as still
_AVERAGED = 3  # frames [ours]: bundles average their poses over as many, so what is quicker is not seen
_TINY = 1e-6  # [ours] a variance whose root has a slope


def standardise_windows(pose: Tensor) -> Tensor:
    """(B, D, T) → (B, D, T): each number of a window less its mean, by its deviation; numbers that are still become small."""
    spread = (pose.var(-1, correction=0, keepdim=True) + _STILL**2).sqrt()
    return (pose - pose.mean(-1, keepdim=True)) / spread


class MannerClassifier(nn.Module):
    """(B, D, T) poses → (B, S) logits of the speakers; four convolutions with stride 2, and the mean over time.

    It has no batch norm, which would hide what all generated windows have in common.

    Args:
        pose: D.
        channels: of the last two convolutions; half as many of the first two.
        speakers: S.
    """

    def __init__(self, pose: int, channels: int, speakers: int) -> None:
        super().__init__()
        widths = ((2 * pose, channels // 2), (channels // 2, channels // 2), (channels // 2, channels), (channels, channels))
        self.convs = nn.ModuleList(nn.Conv1d(a, b, 4, 2, padding=1) for a, b in widths)
        self.out = nn.Linear(2 * channels, speakers)

    def forward(self, pose: Tensor) -> Tensor:
        h = standardise_windows(F.avg_pool1d(pose, _AVERAGED, 1))
        h = torch.cat([h, FASTER * velocity(h)], 1)
        for conv in self.convs:
            h = F.leaky_relu(conv(h), SLOPE)
        logits: Tensor = self.out(torch.cat([h.mean(-1), (h.var(-1, correction=0) + _TINY).sqrt()], 1))
        return logits

    def terms(self, weight: float, recorded: Tensor, made: Tensor, speaker: Tensor) -> dict[str, Tensor]:
        """Of a loss: how little it knows the speakers of recorded poses (B, D, T), by which it learns, and ``weight`` times
        that of generated ones, which does not move it."""
        frozen = {name: value.detach() for name, value in self.named_parameters()}
        named: Tensor = functional_call(self, frozen, (made,))
        known = F.cross_entropy(self(recorded), speaker)
        return {"manner_recorded": known, "manner": weight * F.cross_entropy(named, speaker)}
