"""Random loudness of speech: a network shall not depend on the level, so it is drawn anew for every clip."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from ...errors import InputError
from .objective import StepRandom

__all__ = ["GainAugmentation"]

_STEP = 10.0  # dB that ``louder`` is given for


class GainAugmentation(nn.Module):
    """(B, T, A) standardised speech → the same, each clip louder or softer throughout; in training alone.

    Args:
        decibels: by how much at most, either way; 0: not at all.
        inputs: A.
        louder: (A,) by how much each number grows with 10 dB (`cospeech.audio.features.reduce.louder`, standardised).

    Raises:
        InputError: the loudness shall change, but ``louder`` is missing.
    """

    louder: Tensor

    def __init__(self, decibels: float, inputs: int, louder: Sequence[float]) -> None:
        super().__init__()
        if decibels < 0 or (decibels > 0 and len(louder) != inputs):
            raise InputError(f"speech louder by {decibels} dB", "0 or more, with a data.audio that has logarithms")
        self.decibels = decibels
        self.register_buffer("louder", torch.tensor(tuple(louder)), persistent=False)

    def forward(self, audio: Tensor, chance: StepRandom) -> Tensor:
        if not self.training or not self.decibels:
            return audio
        steps = (2 * chance.uniform(len(audio), 1, 1) - 1) * (self.decibels / _STEP)
        return audio + steps * self.louder
