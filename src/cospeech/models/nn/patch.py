"""The patch discriminator of Mix-StAGE: does each stretch of a movement look real? It sees velocity, not pose."""

from __future__ import annotations

from torch import Tensor, nn

from ...errors import InputError
from .norm import BatchNorm1d
from .unet1d import SLOPE, conv_block

__all__ = ["PATCH_FRAMES", "PatchDiscriminator", "velocity"]

PATCH_FRAMES = 20  # the least number of frames of which two halvings and two kernels of 4 leave one score


def velocity(pose: Tensor) -> Tensor:
    """(B, D, T) → (B, D, T): the difference to the frame before, 0 in the first (authors' code)."""
    return pose.diff(dim=-1, prepend=pose[..., :1])


class PatchDiscriminator(nn.Module):
    """(B, D, T) movement → (B, T / 4 − 4) scores, for T ≥ 20: 12 for 64 frames; kernels 4, strides 2, 2, 1, 1.

    Args:
        pose: D.
        channels: of the first convolution; twice and four times as many follow. Not stated, authors' code 64.
    """

    def __init__(self, pose: int, channels: int) -> None:
        super().__init__()
        self.first = nn.Conv1d(pose, channels, 4, 2, padding=1)
        self.blocks = nn.Sequential(
            nn.LeakyReLU(SLOPE),
            conv_block(channels, 2 * channels, down=True),
            nn.Conv1d(2 * channels, 4 * channels, 4, padding=1), BatchNorm1d(4 * channels), nn.LeakyReLU(SLOPE),
            nn.Conv1d(4 * channels, 1, 4),
        )  # fmt: skip

    def forward(self, movement: Tensor) -> Tensor:
        if movement.shape[-1] < PATCH_FRAMES:
            raise InputError(f"{movement.shape[-1]} frames to judge", f"{PATCH_FRAMES} at least")
        scores: Tensor = self.blocks(self.first(movement)).squeeze(1)
        return scores
