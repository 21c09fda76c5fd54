"""A discriminator that sees postures, speakers and speech, so that Mix-StAGE learns a style in few steps; ours.

The published one sees velocity alone. It does not know where the hands are. Its batch norms remove how large all movement of a
batch is. It knows neither the speaker in whose style the poses should be, nor the speech. This one sees poses, velocity,
acceleration and the speech, has no norm, and scores by a projection (Miyato and Koyama 2018):
score = f(h) + e(speaker) · h / √C, and likewise of an emotion, where one is given. It also has to tell recordings with another
speech from those with their own, as Reed et al. 2016 do for pictures and captions.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ...errors import InputError
from .patch import PATCH_FRAMES, velocity
from .unet1d import SLOPE

__all__ = ["FASTER", "PoseDiscriminator"]

FASTER = 3.0  # ours: factor of differences, so that they count beside standardised poses at 12 to 15 per second


class PoseDiscriminator(nn.Module):
    """(B, D, T) poses, (B, A, T) speech, (B,) speakers → (B, T / 4 − 4) scores, for T ≥ 20; kernels and strides as published.

    Args:
        pose: D.
        audio: A.
        channels: of the first convolution; twice and four times as many follow.
        speakers: S.
        emotions: E; 0: it is given none.
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
        movement = FASTER * velocity(pose)
        h = torch.cat([pose, movement, velocity(movement), audio], 1)
        for conv in self.convs:
            h = F.leaky_relu(conv(h), SLOPE)
        scores: Tensor = self.out(h).squeeze(1)
        condition = self.speakers(speaker)
        if self.emotions is not None and emotion is not None:
            condition = condition + self.emotions(emotion + 1)
        own = (h * condition.unsqueeze(2)).sum(1) / h.shape[1] ** 0.5
        return scores + own[:, : scores.shape[1]]
