"""Encoder and decoder of motion or speech at a quarter of the frame rate (Yi et al. 2023, authors' code): convolutions with
batch norm, residual stacks, two halvings of the rate on the way down and two doublings on the way up.

    Down   (B, inputs, T) ─► H/4 ─► stack ─► half the rate, H/2 ─► stack ─► a quarter of the rate, H ─► stack ─► (B, H, T / 4)
    Up     (B, inputs, T / 4) ─► H ─► stack ─► H/2 ─► stack ─► H/4 ─► stack ─► (B, outputs, T)
"""

from __future__ import annotations

from collections.abc import Callable

from torch import Tensor, nn
from torch.nn import functional as F

from .norm import BatchNorm1d

__all__ = ["STRIDE", "Down", "Up"]

STRIDE = 4
"""Frames of a step: two halvings."""
SLOPE = 0.2  # of LeakyReLU; authors' code
DEEP = 2  # convolutions of a stack, before its last; authors' code

Layer = Callable[[int, int], nn.Module]


def _same(inputs: int, outputs: int) -> nn.Module:
    return nn.Conv1d(inputs, outputs, 3, padding=1)


def _half(inputs: int, outputs: int) -> nn.Module:
    return nn.Conv1d(inputs, outputs, 4, stride=2, padding=1)


def _double(inputs: int, outputs: int) -> nn.Module:
    return nn.ConvTranspose1d(inputs, outputs, 4, stride=2, padding=1)


class _ConvNorm(nn.Module):
    """Convolution, batch norm, leaky ReLU; where the rate changes, another convolution is added before the leaky ReLU."""

    def __init__(self, layer: Layer, inputs: int, outputs: int) -> None:
        super().__init__()
        self.main = nn.Sequential(layer(inputs, outputs), BatchNorm1d(outputs))
        self.beside = None if layer is _same else layer(inputs, outputs)

    def forward(self, x: Tensor) -> Tensor:
        y = self.main(x)
        return F.leaky_relu(y if self.beside is None else y + self.beside(x), SLOPE)


class _Stack(nn.Module):
    """Convolutions of one width; the input is added."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            *(_ConvNorm(_same, channels, channels) for _ in range(DEEP)), _same(channels, channels), BatchNorm1d(channels)
        )

    def forward(self, x: Tensor) -> Tensor:
        return F.relu(x + self.layers(x))


class Down(nn.Sequential):
    """(B, inputs, T) → (B, hidden, T / 4)."""

    def __init__(self, inputs: int, hidden: int) -> None:
        low, half = hidden // 4, hidden // 2
        super().__init__(
            _ConvNorm(_same, inputs, low), _Stack(low), _ConvNorm(_half, low, half), _Stack(half),
            _ConvNorm(_half, half, hidden), _Stack(hidden),
        )  # fmt: skip


class Up(nn.Sequential):
    """(B, inputs, T / 4) → (B, outputs, T)."""

    def __init__(self, inputs: int, hidden: int, outputs: int) -> None:
        low, half = hidden // 4, hidden // 2
        super().__init__(
            nn.Conv1d(inputs, hidden, 1), _Stack(hidden), _ConvNorm(_double, hidden, half), _Stack(half),
            _ConvNorm(_double, half, low), _Stack(low), nn.Conv1d(low, outputs, 1),
        )  # fmt: skip
