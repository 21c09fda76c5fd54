"""A discriminator that knows postures and people, for Mix-StAGE where it is to learn a style in few steps; ours.

The published one sees velocity alone, so that it knows neither where somebody's hands are nor how large all movement of a
batch is, which its batch norms take out; nor does it know in whose style the poses should be. This one sees poses beside
velocity, has no norm, and judges by a projection (Miyato and Koyama 2018): score = f(h) + e(speaker) · h / √C.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..errors import InputError
from .patch import PATCH_FRAMES, velocity
from .unet1d import SLOPE

__all__ = ["PoseJudge"]

FASTER = 3.0  # ours: by what velocity is multiplied, so that it counts beside standardised poses at 12 to 15 frames per second


class PoseJudge(nn.Module):
    """(B, D, T) poses, (B,) speakers → (B, T / 4 − 4) scores, for T ≥ 20; kernels 4, strides 2, 2, 1, 1 as the published one.

    Args:
        pose: D.
        channels: of the first convolution; twice and four times as many follow.
        speakers: S.
    """

    def __init__(self, pose: int, channels: int, speakers: int) -> None:
        super().__init__()
        widths = ((2 * pose, channels, 2), (channels, 2 * channels, 2), (2 * channels, 4 * channels, 1))
        self.convs = nn.ModuleList(nn.Conv1d(a, b, 4, stride, padding=1) for a, b, stride in widths)
        self.out = nn.Conv1d(4 * channels, 1, 4)
        self.speakers = nn.Embedding(speakers, 4 * channels)

    def forward(self, pose: Tensor, speaker: Tensor) -> Tensor:
        if pose.shape[-1] < PATCH_FRAMES:
            raise InputError(f"{pose.shape[-1]} frames to judge", f"{PATCH_FRAMES} at least")
        h = torch.cat([pose, FASTER * velocity(pose)], 1)
        for conv in self.convs:
            h = F.leaky_relu(conv(h), SLOPE)
        scores: Tensor = self.out(h).squeeze(1)
        own = (h * self.speakers(speaker).unsqueeze(2)).sum(1) / h.shape[1] ** 0.5
        return scores + own[:, : scores.shape[1]]
