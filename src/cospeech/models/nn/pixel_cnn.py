"""Gated PixelCNN (van den Oord et al. 2016) over a picture whose rows are steps in time and whose columns are parts of a body,
in the form of Yi et al. 2023.

    y = tanh(W_f * x + V_f s) ⊙ σ(W_g * x + V_g s),     s the speaker

The vertical stack sees the rows above a place, in its own column and the two beside it. The horizontal stack sees what is to
the left in the place's own row, and the vertical stack at the place. So the code at a place depends on all rows before it, on
the columns before it in its row, on the speech and on the speaker:

    p(c) = Π_t Π_j p(c_tj | c_<t, c_t,<j, speech, speaker)

All layers take a `cospeech.models.nn.temporal.Memory`: rows may come one at a time, as they are drawn.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .temporal import Memory

__all__ = ["Columns", "GatedPixelCnn"]

Columns = Sequence[Tensor]
"""(B, width, T) of each column."""
FIRST_ROWS, ROWS = 3, 2  # rows that a layer sees: kernel 7 cut to the rows above; kernel 3 cut to its own row and the one above
OUT = 512  # channels before the logits; authors' code
SPEECH_DROPOUT = 0.1  # share of steps in training without speech; authors' code


def _gate(x: Tensor) -> Tensor:
    a, b = x.chunk(2, 1)
    return a.tanh() * b.sigmoid()


class _GatedLayer(nn.Module):
    """Both stacks of one layer; the first sees nothing of the place itself."""

    def __init__(self, width: int, styles: int, *, first: bool) -> None:
        super().__init__()
        self.past = (FIRST_ROWS if first else ROWS) - 1
        self.own = nn.Conv1d(width, 2 * width, self.past + 1)
        self.left, self.right = (nn.Conv1d(width, 2 * width, self.past + 1, bias=False) for _ in range(2))
        self.style = nn.Conv1d(styles, 2 * width, 1, bias=False)
        self.to_horizontal = nn.Conv1d(2 * width, 2 * width, 1)
        self.before = nn.Conv1d(width, 2 * width, 1, bias=False)
        self.same = None if first else nn.Conv1d(width, 2 * width, 1, bias=False)
        self.out = nn.Conv1d(width, width, 1)

    def forward(self, v: Columns, h: Columns, style: Tensor, memory: Memory) -> tuple[list[Tensor], list[Tensor]]:
        rows, of_style = [memory.behind(x, self.past) for x in v], self.style(style)
        vertical, horizontal = [], []
        for j in range(len(v)):
            x = self.own(rows[j])
            x = x if j == 0 else x + self.left(rows[j - 1])
            x = x if j == len(v) - 1 else x + self.right(rows[j + 1])
            vertical.append(_gate(x + of_style))
            x = self.to_horizontal(x) + of_style
            x = x if j == 0 else x + self.before(h[j - 1])
            x = x if self.same is None else x + self.same(h[j])
            x = self.out(_gate(x))
            horizontal.append(x if self.same is None else x + h[j])
        return vertical, horizontal


class GatedPixelCnn(nn.Module):
    """Logits of the codes at every place.

    Args:
        codes: K, of each column.
        width: of all layers.
        layers: two at least.
        speech: numbers of the speech of a row.
        styles: numbers of the speaker.
    """

    def __init__(self, codes: int, width: int, layers: int, speech: int, styles: int) -> None:
        super().__init__()
        self.embedding = nn.Embedding(codes, width)
        self.layers = nn.ModuleList(_GatedLayer(width, styles, first=k == 0) for k in range(layers))
        self.pasts = [(ROWS if k else FIRST_ROWS) - 1 for k in range(layers)]
        """Rows above a row that each layer keeps."""
        self.heard = nn.Conv1d(speech, width, 1)
        self.to_vertical, self.to_horizontal = (nn.Conv1d(2 * width, width, 1) for _ in range(2))
        self.out = nn.Sequential(nn.Conv1d(width, OUT, 1), nn.ReLU(), nn.Conv1d(OUT, codes, 1))
        for part in self.modules():
            if isinstance(part, nn.Conv1d):
                nn.init.xavier_uniform_(part.weight)
                if part.bias is not None:
                    nn.init.zeros_(part.bias)

    def forward(self, above: Columns, row: Columns, features: Tensor, style: Tensor, memory: Memory) -> list[Tensor]:
        """Logits (B, K, T) of each column.

        Args:
            above: embedded codes of the row before each row; zeros before the first.
            row: embedded codes of each row itself; a column's logits do not depend on it or on those after it.
            features: (B, speech, T) of the speech.
            style: (B, styles, T).
            memory: blank, or as it was after the rows before.
        """
        speech = self.heard(features)
        if self.training:
            speech = speech * F.dropout(torch.ones_like(speech[:, :1]), SPEECH_DROPOUT)
        v, h = list(above), list(row)
        for k, layer in enumerate(self.layers):
            if k == 1:
                v = [self.to_vertical(torch.cat([x, speech], 1)) for x in v]
                h = [self.to_horizontal(torch.cat([x, speech], 1)) for x in h]
            v, h = layer(v, h, style, memory)
        return [self.out(x) for x in h]

    def embed(self, codes: Tensor) -> list[Tensor]:
        """(B, T, columns) numbers of codes → (B, width, T) of each column."""
        return [self.embedding(column).mT for column in codes.unbind(-1)]

    def logits(self, codes: Tensor, features: Tensor, style: Tensor) -> list[Tensor]:
        """(B, K, T) of each column for known codes (B, T, columns), for training."""
        row = self.embed(codes)
        above = [F.pad(x, (1, 0))[..., :-1] for x in row]
        return self(above, row, features, style, Memory())
