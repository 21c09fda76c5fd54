"""Channel-wise attention (Xu et al. 2024, section 3.2): each channel is weighted by its salience.

    w = σ(W₂ ReLU(W₁ mean over time) + W₂ ReLU(W₁ maximum over time)),   x ↦ w · x

Pools, convolutions and sigmoid are the paper's; that both pools share W₁ and W₂, and by how much W₁ narrows, is CBAM's (Woo et
al. 2018), after which it is described.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .temporal import Memory

__all__ = ["ChannelAttention", "PastAttention"]


class _Gate(nn.Module):
    """(B, C, T) means and maxima → (B, C, T) of 0 … 1."""

    def __init__(self, channels: int, reduction: int) -> None:
        super().__init__()
        few = max(1, channels // reduction)
        self.narrow, self.wide = nn.Conv1d(channels, few, 1), nn.Conv1d(few, channels, 1)

    def forward(self, mean: Tensor, most: Tensor) -> Tensor:
        return torch.sigmoid(self.wide(F.relu(self.narrow(mean))) + self.wide(F.relu(self.narrow(most))))


class ChannelAttention(nn.Module):
    """Pooled over all frames: (B, C, T) → (B, C, T).

    Args:
        channels: C.
        reduction: by how much they are narrowed.
    """

    def __init__(self, channels: int, reduction: int) -> None:
        super().__init__()
        self.gate = _Gate(channels, reduction)

    def forward(self, x: Tensor, memory: Memory) -> Tensor:
        out: Tensor = x * self.gate(x.mean(-1, keepdim=True), x.amax(-1, keepdim=True))
        return out


class PastAttention(nn.Module):
    """Pooled over a frame and those before it, ``frames`` in all, zeros before the first: a stream may be played with it."""

    def __init__(self, channels: int, reduction: int, frames: int) -> None:
        super().__init__()
        self.gate, self.frames = _Gate(channels, reduction), frames

    def forward(self, x: Tensor, memory: Memory) -> Tensor:
        history = memory.behind(x, self.frames - 1)
        out: Tensor = x * self.gate(F.avg_pool1d(history, self.frames, 1), F.max_pool1d(history, self.frames, 1))
        return out
