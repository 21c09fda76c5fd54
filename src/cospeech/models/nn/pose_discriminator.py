"""A discriminator that knows postures, people and speech, for Mix-StAGE where it is to learn a style in few steps; ours.

The published one sees velocity alone, so that it knows neither where somebody's hands are nor how large all movement of a
batch is, which its batch norms take out; nor does it know in whose style the poses should be, or to what speech. This one sees
poses, velocity, acceleration and the speech, has no norm, and judges by a projection (Miyato and Koyama 2018):
score = f(h) + e(speaker) · h / √C, and likewise of an emotion, where it is told of one. What people did to another speech is to
be told from what they did to this one, as Reed et al. 2016 have pictures told from those of another caption.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ...errors import InputError
from .patch import PATCH_FRAMES, velocity
from .unet1d import SLOPE

__all__ = ["FASTER", "PoseDiscriminator"]

FASTER = 3.0  # ours: by what differences are multiplied, so that they count beside standardised poses at 12 to 15 per second


class PoseDiscriminator(nn.Module):
    """(B, D, T) poses, (B, A, T) speech, (B,) speakers → (B, T / 4 − 4) scores, for T ≥ 20; kernels and strides as published.

    Args:
        pose: D.
        audio: A.
        channels: of the first convolution; twice and four times as many follow.
        speakers: S.
        emotions: E; 0: it is told of none.
    """

    def __init__(self, pose: int, audio: int, channels: int, speakers: int, emotions: int = 0) -> None:
        super().__init__()
        widths = ((3 * pose + audio, channels, 2), (channels, 2 * channels, 2), (2 * channels, 4 * channels, 1))
        self.convs = nn.ModuleList(nn.Conv1d(a, b, 4, stride, padding=1) for a, b, stride in widths)
        self.out = nn.Conv1d(4 * channels, 1, 4)
        self.speakers = nn.Embedding(speakers, 4 * channels)
        self.emotions = nn.Embedding(emotions + 1, 4 * channels, padding_idx=0) if emotions else None

    def forward(self, pose: Tensor, audio: Tensor, speaker: Tensor, emotion: Tensor | None = None) -> Tensor:
        """``emotion``: (B,) of 0 … E − 1, −1: not known."""
        if pose.shape[-1] < PATCH_FRAMES:
            raise InputError(f"{pose.shape[-1]} frames to judge", f"{PATCH_FRAMES} at least")
        moved = FASTER * velocity(pose)
        h = torch.cat([pose, moved, velocity(moved), audio], 1)
        for conv in self.convs:
            h = F.leaky_relu(conv(h), SLOPE)
        scores: Tensor = self.out(h).squeeze(1)
        known = self.speakers(speaker)
        if self.emotions is not None and emotion is not None:
            known = known + self.emotions(emotion + 1)
        own = (h * known.unsqueeze(2)).sum(1) / h.shape[1] ** 0.5
        return scores + own[:, : scores.shape[1]]
