"""Seq2seq: Yoon et al. 2019, "Robots Learn Social Skills: End-to-End Learning of Co-Speech Gesture Generation for Humanoid
Robots": words in, poses out, one after the other, each made of the pose before and of the words that it attends to.

    words (B, T, W) ─► GRU × 2, both directions, summed ─► e₁ … e_T ──────────┐ last states begin the decoder
                                                                              ▼
    ŷₜ₋₁ ──────────────────────────► [ŷₜ₋₁, c] ─► linear, norm, ReLU ─► GRU × 2 ─► linear ─► ŷₜ
                                          ▲                               │
              c = Σ aₛ eₛ,  a = softmax_s v · tanh(W [hₜ₋₁, eₛ]) ◄────────┘

The first four poses are given; each is fed back for the next. Minimised, in the form of the authors' later code:

    L = 250 E (ŷ − y)² + 0.1 E |ŷₜ − ŷₜ₋₁| − 25 E ‖ŷ_d‖₂ / T,     ŷ_d a number of the pose over the T frames of a window

Followed, changed, not said in the paper: docs/models/seq2seq.md, by number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..errors import InputError
from .nn.configuration import SMALL_RECURRENT, ModelConfig
from .nn.modalities import SEEDS
from .nn.norm import BatchNorm1d
from .nn.objective import Batch, Objective
from .nn.seeded_windows import SeededWindows, WindowInputs
from .nn.settings import check_least
from .nn.speed_distance import timing_term
from .nn.words import word_embedding

__all__ = ["Seq2Seq", "Seq2SeqConfig"]


@dataclass(frozen=True)
class Seq2SeqConfig(ModelConfig):
    """Sizes and weights; those of the authors' later code (of Yoon et al. 2020, who compare with it)."""

    TINY: ClassVar[Mapping[str, Any]] = {"hidden": 8, "word_width": 5}
    SMALL: ClassVar[Mapping[str, Any]] = {"hidden": 64, "word_width": 32}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_RECURRENT

    frames: int = 34
    """T of a training window; later code 34 at 15 per second, of which 4 are given."""
    hidden: int = 200
    """Of each GRU; later code 200."""
    layers: int = 2
    """Of each GRU; later code 2."""
    dropout: float = 0.1
    """Between layers; later code 0.1."""
    word_width: int = 300
    """Of a word where the network learns it; later code 300."""
    regression: float = 250.0
    """Weight of the squared distance; later code 250."""
    continuity: float = 0.1
    """Weight of the distance of poses from the one before; later code 0.1."""
    variance: float = 25.0
    """Weight of how much they move over a window; later code 25."""
    stroke_timing: float = 0.0
    """Weight of the distance in time of rises and falls of the speed from the recorded ones; ours, as published 0."""

    def __post_init__(self) -> None:
        low = {"frames": SEEDS + 1, "hidden": 1, "layers": 1, "word_width": 1, "dropout": 0}
        check_least(self, "a seq2seq network", low | {"regression": 0, "continuity": 0, "variance": 0, "stroke_timing": 0})
        if not self.dropout < 1:
            raise InputError(f"dropout of a seq2seq network is {self.dropout}", "a share")


class _Attention(nn.Module):
    """Attention of a state (B, H) to the encoded words (B, T, H): their weighted sum (B, H)."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.of_state, self.of_read = nn.Linear(hidden, hidden), nn.Linear(hidden, hidden, bias=False)  # W in two halves
        self.v = nn.Parameter(torch.randn(hidden) / hidden**0.5)

    def forward(self, state: Tensor, encoding: Tensor) -> Tensor:
        fit = F.linear(torch.tanh(self.of_state(state).unsqueeze(1) + self.of_read(encoding)), self.v.unsqueeze(0))
        return (torch.softmax(fit, 1) * encoding).mean(1) * encoding.shape[1]  # a sum, as a bundle may compute it


class Seq2Seq(SeededWindows):
    """Poses of words, one by one, in windows as in training. Poses are standardised vectors.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech, which is part of a bundle; the network does not use it.
        text: width of the store's word vectors; 0: it has ids of subwords.
    """

    arrays = ("pose", "text")
    dimensions = ("pose", "audio", "text")
    Config = Seq2SeqConfig
    config: Seq2SeqConfig
    cut = True

    def __init__(self, config: Seq2SeqConfig, *, pose: int, audio: int = 0, text: int = 0) -> None:
        super().__init__()
        if pose < 1:
            raise InputError(f"a seq2seq network of {pose} numbers of a pose", "one at least")
        self.config, embedding = config, word_embedding(text, config.word_width)
        self.measure(pose, audio, embedding)
        self.multiple = self.shortest = config.frames
        hidden, layers, dropout = config.hidden, config.layers, config.dropout * (config.layers > 1)
        self.reader = nn.GRU(embedding.width, hidden, layers, batch_first=True, dropout=dropout, bidirectional=True)
        self.attention = _Attention(hidden)
        self.entry = nn.Sequential(nn.Linear(pose + hidden, hidden), BatchNorm1d(hidden), nn.ReLU())
        self.decoder = nn.GRU(hidden, hidden, layers, batch_first=True, dropout=dropout)
        self.out = nn.Linear(hidden, pose)

    def poses(self, inputs: WindowInputs, noise: Tensor) -> Tensor:
        """See `SeededWindows`: T frames one after the other, the first as given; there is no noise.

        A known pose is fed back as it is; otherwise the generated one is.
        """
        words, flag = inputs.words, inputs.seed[..., -1:]
        encoding, states = self.reader(words)
        ahead, back = encoding.chunk(2, -1)
        takes = 0 * inputs.seed[:, :1, :1].permute(1, 0, 2)  # all takes read the same words, but each has poses of its own
        encoding, state = ahead + back, states[: self.config.layers] + takes
        poses = [inputs.seed[:, 0, :-1]]
        for t in range(1, words.shape[1]):
            before = poses[-1]
            if t <= SEEDS:
                before = before + flag[:, t - 1] * (inputs.seed[:, t - 1, :-1] - before)
            features = self.entry(torch.cat([before, self.attention(state[-1], encoding)], 1))
            after, state = self.decoder(features.unsqueeze(1), state)
            poses.append(self.out(after.squeeze(1)))
        return torch.stack(poses, 1)

    # what is optimised -----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """One."""
        return {"gestures": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L of the module's docstring."""
        c, pose = self.config, batch["pose"]
        output = self.poses(self.collect_inputs(batch.arrays), pose[:, :0])
        return {
            "regression": c.regression * (output - pose).square().mean(),
            "continuity": c.continuity * output.diff(dim=1).abs().sum() / output.numel(),
            "variance": -c.variance * output.norm(dim=1).sum() / output.numel(),
            **timing_term(c.stroke_timing, output.mT, pose.mT),
        }
