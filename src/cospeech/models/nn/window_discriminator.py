"""The discriminator of whole windows of Yoon et al. 2020: three convolutions, a recurrent network both ways, one number."""

from __future__ import annotations

from torch import Tensor, nn

from .norm import BatchNorm1d
from .recurrent import BothWaysGru

__all__ = ["GruDiscriminator", "WindowDiscriminator"]

_CHANNELS = (16, 8, 8)  # of the convolutions; authors' code
_HIDDEN, _LAYERS, _DROPOUT = 64, 4, 0.3  # of the GRU; authors' code


class GruDiscriminator(nn.Module):
    """(B, inputs, T) of a window of T frames → (B,) logits that it was recorded."""

    def __init__(self, inputs: int, frames: int) -> None:
        super().__init__()
        self.both_ways = BothWaysGru(inputs, _HIDDEN, _LAYERS, _DROPOUT)
        self.of_frames, self.of_all = nn.Conv1d(_HIDDEN, 1, 1), nn.Linear(frames, 1)

    def forward(self, encoded: Tensor) -> Tensor:
        scores: Tensor = self.of_all(self.of_frames(self.both_ways(encoded)).squeeze(1)).squeeze(1)
        return scores


class WindowDiscriminator(GruDiscriminator):
    """(B, T, D) windows of the configuration's length → (B,) logits that a window was recorded."""

    def __init__(self, pose: int, frames: int, slope: float) -> None:
        first, second, third = _CHANNELS
        super().__init__(third, frames - 6)
        self.convolutions = nn.Sequential(
            nn.Conv1d(pose, first, 3), BatchNorm1d(first), nn.LeakyReLU(slope),
            nn.Conv1d(first, second, 3), BatchNorm1d(second), nn.LeakyReLU(slope),
            nn.Conv1d(second, third, 3),
        )  # fmt: skip

    def forward(self, poses: Tensor) -> Tensor:
        """See the class."""
        return super().forward(self.convolutions(poses.mT))
