"""Stacked LSTMs and GRUs as BEAT's systems have them (Liu et al. 2022, authors' code): two directions are summed at the end."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from .temporal import Memory

__all__ = ["BothWays", "BothWaysGru", "Forwards"]


def _sum_directions(states: Tensor) -> Tensor:
    """(B, T, 2 · hidden) of both directions → (B, hidden, T)."""
    ahead, back = states.chunk(2, -1)
    return (ahead + back).mT


class BothWays(nn.Module):
    """(B, inputs, T) → (B, hidden, T): an LSTM both ways, the outputs of its last layer summed.

    Args:
        inputs: numbers of a frame.
        hidden: of each direction.
        layers: each sees both directions of the one below.
        dropout: between layers.
    """

    def __init__(self, inputs: int, hidden: int, layers: int, dropout: float) -> None:
        super().__init__()
        self.lstm = nn.LSTM(inputs, hidden, layers, batch_first=True, dropout=dropout * (layers > 1), bidirectional=True)

    def forward(self, x: Tensor, memory: Memory) -> Tensor:
        return _sum_directions(self.lstm(x.mT)[0])


class BothWaysGru(nn.Module):
    """The same of a GRU."""

    def __init__(self, inputs: int, hidden: int, layers: int, dropout: float) -> None:
        super().__init__()
        self.gru = nn.GRU(inputs, hidden, layers, batch_first=True, dropout=dropout * (layers > 1), bidirectional=True)

    def forward(self, x: Tensor) -> Tensor:
        return _sum_directions(self.gru(x.mT)[0])


class Forwards(nn.Module):
    """An LSTM one way: it plays frame by frame; its state is all layers' outputs and cells, (B, 2 · layers · hidden, 1)."""

    def __init__(self, inputs: int, hidden: int, layers: int, dropout: float) -> None:
        super().__init__()
        self.lstm = nn.LSTM(inputs, hidden, layers, batch_first=True, dropout=dropout * (layers > 1))

    def forward(self, x: Tensor, memory: Memory) -> Tensor:
        rows, layers, hidden = x.shape[0], self.lstm.num_layers, self.lstm.hidden_size
        state = memory.take(lambda: x.new_zeros(rows, 2 * layers * hidden, 1))
        both = state.reshape(rows, 2, layers, hidden).permute(1, 2, 0, 3).contiguous()
        out, after = self.lstm(x.mT, (both[0], both[1]))
        memory.keep(torch.stack(after).permute(2, 0, 1, 3).reshape(rows, -1, 1))
        return out.mT  # type: ignore[no-any-return]
