"""Convolutions over time, (B, C, T) throughout: same-padded ones, which see past and future, and causal ones, which play live.

All take a `Memory`, in which causal layers keep their states from one call to the next. So a signal gives the same output in
pieces of any size as in one. Same-padded layers have no state. A whole signal begins with a blank memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional as F
from torch.nn.utils.parametrizations import weight_norm

__all__ = ["SLOPE", "CausalConv", "Conv", "ConvStack", "Memory", "SameConv", "TextTcn"]

SLOPE = 0.1  # of LeakyReLU; Xu et al. 2024 do not say, CaMN's code has 0.1 in its heads


class Memory:
    """States of causal layers, in the order in which they run.

    Args:
        states: `new_states` after the piece before; none: the signal begins, after zeros.
    """

    def __init__(self, states: Iterable[Tensor] = ()) -> None:
        self._before = iter(tuple(states))
        self.new_states: list[Tensor] = []
        """The states after this piece."""

    def take(self, blank: Callable[[], Tensor]) -> Tensor:
        """The next layer's state; at the beginning of a signal ``blank()``."""
        state = next(self._before, None)
        return blank() if state is None else state

    def keep(self, state: Tensor) -> None:
        """Keep the new state of this layer."""
        self.new_states.append(state)

    def behind(self, x: Tensor, frames: int) -> Tensor:
        """(B, C, T) → (B, C, frames + T): the frames before it, then its own."""
        whole = torch.cat([self.take(lambda: x.new_zeros(*x.shape[:2], frames)), x], -1)
        self.keep(whole[..., whole.shape[-1] - frames :])
        return whole


class SameConv(nn.Conv1d):
    """(B, inputs, T) → (B, outputs, T); zeros beyond both ends. The kernel is odd."""

    def __init__(self, inputs: int, outputs: int, kernel: int) -> None:
        super().__init__(inputs, outputs, kernel, padding=kernel // 2)

    def forward(self, x: Tensor, memory: Memory) -> Tensor:  # type: ignore[override]  # a memory besides
        return super().forward(x)


class CausalConv(nn.Conv1d):
    """(B, inputs, T) → (B, outputs, T); a frame sees itself and the (kernel − 1) · dilation before it."""

    def __init__(self, inputs: int, outputs: int, kernel: int, dilation: int = 1) -> None:
        super().__init__(inputs, outputs, kernel, dilation=dilation)
        self.past = (kernel - 1) * dilation

    def forward(self, x: Tensor, memory: Memory) -> Tensor:  # type: ignore[override]  # a memory besides
        return super().forward(memory.behind(x, self.past) if self.past else x)


Conv = Callable[[int, int, int], SameConv | CausalConv]
"""(inputs, outputs, kernel) → the layer."""


class ConvStack(nn.Module):
    """Convolutions with LeakyReLU between them, none behind the last.

    Args:
        conv: makes each.
        widths: of the input, and of the output of each.
        kernel: of all of them.
    """

    def __init__(self, conv: Conv, widths: Iterable[int], kernel: int) -> None:
        super().__init__()
        self.convs = nn.ModuleList(conv(a, b, kernel) for a, b in pairwise(widths))

    def forward(self, x: Tensor, memory: Memory) -> Tensor:
        for k, conv in enumerate(self.convs):
            x = conv(F.leaky_relu(x, SLOPE) if k else x, memory)
        return x


class _Block(nn.Module):
    """Two causal convolutions of one dilation, each with weight norm, ReLU and dropout; and a skip."""

    def __init__(self, inputs: int, outputs: int, kernel: int, dilation: int, dropout: float) -> None:
        super().__init__()
        layers = [CausalConv(inputs, outputs, kernel, dilation), CausalConv(outputs, outputs, kernel, dilation)]
        self.convs = nn.ModuleList(map(weight_norm, layers))
        self.skip = nn.Conv1d(inputs, outputs, 1) if inputs != outputs else nn.Identity()
        self.dropout = nn.Dropout(dropout)

    def forward(self, x: Tensor, memory: Memory) -> Tensor:
        y = x
        for conv in self.convs:
            y = self.dropout(F.relu(conv(y, memory)))
        return F.relu(y + self.skip(x))


class TextTcn(nn.Module):
    """The temporal convolution network of 8 layers with skips that reads words (Bai et al. 2018; CaMN's code): causal.

    (B, inputs, T) → (B, outputs, T).

    Args:
        inputs: numbers of a word.
        channels: of every layer; CaMN's code 256.
        outputs: of the linear layer at its end.
        dropout: in the blocks; CaMN's code 0.3.
        input_dropout: dropout of the input; CaMN's code 0.1.
    """

    KERNEL, DILATIONS = 2, (1, 2, 4, 8)  # CaMN's code: 4 blocks of 2

    def __init__(self, inputs: int, channels: int, outputs: int, dropout: float, input_dropout: float = 0.1) -> None:
        super().__init__()
        widths = (inputs, *[channels] * len(self.DILATIONS))
        self.input_dropout = nn.Dropout(input_dropout)
        self.blocks = nn.ModuleList(
            _Block(a, b, self.KERNEL, dilation, dropout)
            for (a, b), dilation in zip(pairwise(widths), self.DILATIONS, strict=True)
        )
        self.out = nn.Conv1d(channels, outputs, 1)

    def forward(self, x: Tensor, memory: Memory) -> Tensor:
        x = self.input_dropout(x)
        for block in self.blocks:
            x = block(x, memory)
        out: Tensor = self.out(x)
        return out
