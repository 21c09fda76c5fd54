"""Convolutions over time of Mix-StAGE, and its U-Net; (B, C, T) throughout.

Ahuja et al. 2020: convolution, batch norm, ReLU, with kernel 3, and kernel 4 with stride 2 to go down; the slope of the ReLU,
the depth and the skips by addition are the authors' code's.
"""

from __future__ import annotations

from torch import Tensor, nn
from torch.nn import functional as F

from ...errors import InputError
from .norm import BatchNorm1d

__all__ = ["SLOPE", "UNet1d", "conv_block"]

SLOPE = 0.2  # of LeakyReLU; not stated, authors' code 0.2


def conv_block(inputs: int, outputs: int, *, down: bool = False, groups: int = 1) -> nn.Sequential:
    """Convolution, batch norm, leaky ReLU: (B, inputs, T) → (B, outputs, T), or with ``down`` (B, outputs, ⌊T / 2⌋)."""
    kernel, stride = (4, 2) if down else (3, 1)
    conv = nn.Conv1d(inputs, outputs, kernel, stride, padding=1, groups=groups)
    return nn.Sequential(conv, BatchNorm1d(outputs), nn.LeakyReLU(SLOPE))


class UNet1d(nn.Module):
    """Two convolutions; ``depth`` halvings of time; as many doublings (nearest), each with a skip from before the halving.

    Args:
        channels: of all layers; the input may have more.
        depth: halvings; T is a multiple of 2 ** depth.
        more: channels of the input beyond ``channels``.
    """

    def __init__(self, channels: int, depth: int, more: int = 0) -> None:
        super().__init__()
        self.first = nn.Sequential(conv_block(channels + more, channels), conv_block(channels, channels))
        self.down = nn.ModuleList(conv_block(channels, channels, down=True) for _ in range(depth))
        self.up = nn.ModuleList(conv_block(channels, channels) for _ in range(depth))

    def forward(self, x: Tensor) -> Tensor:
        """(B, C + more, T) → (B, C, T).

        Raises:
            InputError: T is no multiple of 2 ** depth.
        """
        step = 2 ** len(self.down)
        if not x.shape[-1] or x.shape[-1] % step:
            raise InputError(f"{x.shape[-1]} frames for a U-Net with {len(self.down)} halvings", f"a multiple of {step}")
        x, skips = self.first(x), []
        for block in self.down:
            skips.append(x)
            x = block(x)
        for block, skip in zip(self.up, reversed(skips), strict=True):
            x = block(F.interpolate(x, scale_factor=2.0, mode="nearest") + skip)
        return x
