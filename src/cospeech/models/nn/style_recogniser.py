"""A network that recognises the manner of motion: motion must have the style of its code; ours."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.func import functional_call
from torch.nn import functional as F

__all__ = ["StyleRecogniser"]

SPREAD = 0.1  # of poses standardised over a recording [ours]: a number that varies less within a window is nearly still
PER_STEP = 3.0  # [ours] velocities have a third of the size of poses that are standardised within their window
DROPOUT = 0.3  # [ours] a few hours of motion are soon known by heart


class StyleRecogniser(nn.Module):
    """Poses → logits of the speakers: velocities, three convolutions, then mean and size over time.

    It sees neither mean pose nor amplitude: each number of a pose is standardised within its window. Both are set in play.

    Args:
        pose: D, numbers of a pose.
        channels: of the convolutions.
        speakers: S.
    """

    def __init__(self, pose: int, *, channels: int, speakers: int) -> None:
        super().__init__()
        self.convolutions = nn.Sequential(
            nn.Conv1d(pose, channels, 5, padding=2), nn.ReLU(),
            nn.Conv1d(channels, channels, 5, padding=2, stride=2), nn.ReLU(),
            nn.Conv1d(channels, channels, 5, padding=2), nn.ReLU(),
        )  # fmt: skip
        self.dropout, self.full = nn.Dropout(DROPOUT), nn.Linear(2 * channels, speakers)

    def forward(self, motion: Tensor) -> Tensor:
        """(B, F, D) poses → (B, S)."""
        manner = motion / (motion.std(1, keepdim=True) + SPREAD)
        x = self.convolutions(PER_STEP * manner.diff(dim=1).mT)
        moments = torch.cat([x.mean(-1), (x.square().mean(-1) + 1e-6).sqrt()], -1)
        logits: Tensor = self.full(self.dropout(moments))
        return logits

    def of_self_play(self, motion: Tensor, speaker: Tensor) -> Tensor:
        """The mean cross-entropy of motion that was played in the style of speakers, (); the motion learns alone."""
        constants = {name: value.detach() for name, value in self.named_parameters()}
        return F.cross_entropy(functional_call(self, constants, (motion,)), speaker)
