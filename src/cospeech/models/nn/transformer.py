"""A transformer over some dozen steps, steered by a style in every layer: attention, attention to words, two dense layers.

    x + attend(ada(x, s)),   x + attend(ada(x, s), words),   x + dense(ada(x, s)),     ada(x, s) = (1 + f(s)) · norm(x) + g(s)

The style is injected as by AdaIN (Huang and Belongie 2017): it scales and shifts normalised features. Features are normalised
over the channels of a step, not over time: a window has some ten steps, and their mean would be lost. A convolution over the
steps tells where a step lies, so that windows may have any length. All (B, C, S).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

__all__ = ["StyledTransformer"]

EPSILON = 1e-5  # of the norm; as PyTorch's
WIDER = 4  # factor of the width between the two dense layers; Vaswani et al. 2017
KERNEL = 5  # steps that the convolution for the place of a step sees; ours


class _AdaptiveNorm(nn.Module):
    """Features of each step normalised, then scaled and shifted by the style of the step."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.style = nn.Conv1d(width, 2 * width, 1)

    def forward(self, x: Tensor, style: Tensor) -> Tensor:
        x = x - x.mean(1, keepdim=True)
        x = x / ((x * x).mean(1, keepdim=True) + EPSILON).sqrt()
        scale, shift = self.style(style).chunk(2, 1)
        out: Tensor = (1 + scale) * x + shift
        return out


class _Attention(nn.Module):
    """Every step of ``x`` attends to every step of ``context``."""

    def __init__(self, width: int, inputs: int, heads: int) -> None:
        super().__init__()
        self.heads, self.size = (heads, width // heads), (width // heads) ** -0.5
        self.query, self.key, self.value = nn.Conv1d(width, width, 1), nn.Conv1d(inputs, width, 1), nn.Conv1d(inputs, width, 1)
        self.out = nn.Conv1d(width, width, 1)

    def forward(self, x: Tensor, context: Tensor) -> Tensor:
        query, key, value = (
            each.unflatten(1, self.heads) for each in (self.query(x), self.key(context), self.value(context))
        )  # (B, heads, ·, S)
        weights = torch.softmax((query * self.size).mT @ key, -1)
        out: Tensor = self.out((value @ weights.mT).flatten(1, 2))
        return out


class _Block(nn.Module):
    def __init__(self, width: int, words: int, heads: int) -> None:
        super().__init__()
        self.norms = nn.ModuleList(_AdaptiveNorm(width) for _ in range(3))
        self.attend, self.read = _Attention(width, width, heads), _Attention(width, words, heads)
        self.dense = nn.Sequential(nn.Conv1d(width, WIDER * width, 1), nn.ReLU(), nn.Conv1d(WIDER * width, width, 1))

    def forward(self, x: Tensor, words: Tensor, style: Tensor) -> Tensor:
        y = self.norms[0](x, style)
        x = x + self.attend(y, y)
        x = x + self.read(self.norms[1](x, style), words)
        out: Tensor = x + self.dense(self.norms[2](x, style))
        return out


class StyledTransformer(nn.Module):
    """(B, inputs, S) → (B, outputs, S).

    Args:
        inputs, outputs: numbers of a step.
        width: of every layer, a multiple of ``heads``.
        words: numbers of a step of the words.
        layers, heads: how many.
    """

    def __init__(self, inputs: int, outputs: int, *, width: int, words: int, layers: int, heads: int) -> None:
        super().__init__()
        self.first = nn.Conv1d(inputs, width, 1)
        self.place = nn.Conv1d(width, width, KERNEL, padding=KERNEL // 2)
        self.blocks = nn.ModuleList(_Block(width, words, heads) for _ in range(layers))
        self.norm = _AdaptiveNorm(width)
        self.out = nn.Conv1d(width, outputs, 1)

    def forward(self, x: Tensor, words: Tensor, style: Tensor) -> Tensor:
        """(B, inputs, S), words (B, words, S), style (B, width, S) → (B, outputs, S)."""
        x = self.first(x)
        x = x + F.relu(self.place(x))
        for block in self.blocks:
            x = block(x, words, style)
        out: Tensor = self.out(self.norm(x, style))
        return out
