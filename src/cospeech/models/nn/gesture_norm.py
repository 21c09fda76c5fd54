"""The style injector (Xu et al. 2024, section 3.3, equation 5): a hypernetwork makes a style of speaker and emotion, and
GestureAdaLN scales and shifts features by it:

    S = HyNet(E, I),   X̂ = f(S) · X + g(S)

As in equation 5 nothing is normalised. f(S) = 1 + W S and g(S) = V S without bias, so that a style of zeros changes nothing.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from .temporal import Conv, ConvStack, Memory

__all__ = ["EMBEDDED", "GestureAdaLN", "HyperNetwork"]

EMBEDDED = 8  # numbers of an emotion and of a speaker; section 4.1
_KERNEL = 3  # not stated; ours


class HyperNetwork(nn.Module):
    """(B, S + E, T) weights of speakers and of emotions, each with the sum 1 → (B, width, T) styles.

    Two embeddings and two temporal convolutions (appendix A.5). Weights of several people give the mean of their embeddings.

    Args:
        speakers: S.
        emotions: E.
        width: of a style, 128.
        conv: makes the convolutions.
    """

    def __init__(self, speakers: int, emotions: int, width: int, conv: Conv) -> None:
        super().__init__()
        self.split = (speakers, emotions)
        self.speakers = nn.Parameter(torch.randn(EMBEDDED, speakers))
        self.emotions = nn.Parameter(torch.randn(EMBEDDED, emotions))
        self.convs = ConvStack(conv, (2 * EMBEDDED, width, width), _KERNEL)

    def forward(self, weights: Tensor, memory: Memory) -> Tensor:
        who, how = weights.split(self.split, 1)
        out: Tensor = self.convs(torch.cat([self.speakers @ who, self.emotions @ how], 1), memory)
        return out


class GestureAdaLN(nn.Module):
    """(B, channels, T) features, (B, width, T) styles → (B, channels, T)."""

    def __init__(self, channels: int, width: int) -> None:
        super().__init__()
        self.scale, self.shift = (nn.Conv1d(width, channels, 1, bias=False) for _ in range(2))

    def forward(self, x: Tensor, style: Tensor) -> Tensor:
        out: Tensor = (1 + self.scale(style)) * x + self.shift(style)
        return out
