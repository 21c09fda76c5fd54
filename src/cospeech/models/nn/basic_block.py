"""The residual block that BEAT's encoders of sound and face are made of (Liu et al. 2022), after ResNet's; (B, C, T)."""

from __future__ import annotations

from itertools import pairwise

from torch import Tensor, nn

from .norm import BatchNorm1d

__all__ = ["BasicBlock", "basic_blocks"]

SLOPE = 0.01  # of LeakyReLU; not stated, authors' code: PyTorch's own


class BasicBlock(nn.Module):
    """Convolution, norm, leaky ReLU, convolution, norm; then the input is added, and a last leaky ReLU follows.

    Args:
        inputs, outputs: channels.
        kernel: of the convolutions, odd.
        short: whether the input is added as it is; else it goes through a convolution and a norm first.
    """

    def __init__(self, inputs: int, outputs: int, kernel: int, *, short: bool = False) -> None:
        super().__init__()
        self.first = _make_convolution(inputs, outputs, kernel)
        self.second = _make_convolution(outputs, outputs, kernel)
        self.shortcut = nn.Identity() if short else _make_convolution(inputs, outputs, kernel)
        self.bend = nn.LeakyReLU(SLOPE)

    def forward(self, x: Tensor) -> Tensor:
        """(B, inputs, T) → (B, outputs, T)."""
        y: Tensor = self.bend(self.second(self.bend(self.first(x))) + self.shortcut(x))
        return y


def _make_convolution(inputs: int, outputs: int, kernel: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv1d(inputs, outputs, kernel, padding=kernel // 2), BatchNorm1d(outputs))


def basic_blocks(widths: tuple[int, ...], kernel: int) -> nn.Sequential:
    """Blocks from each width to the next."""
    return nn.Sequential(*(BasicBlock(a, b, kernel) for a, b in pairwise(widths)))
