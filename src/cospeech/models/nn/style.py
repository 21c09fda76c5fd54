"""Style of a speaker: encoder and matrix of Mix-StAGE (Ahuja et al. 2020, section 4.3); for one speaker, nothing."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.func import functional_call
from torch.nn import functional as F

from .content import StyleLogits

__all__ = ["NoStyle", "SpeakerStyle", "StyleReading"]


class StyleReading(NamedTuple):
    """Output of a style encoder for poses."""

    logits: Tensor
    """(B, S) of Eˢₚ."""
    weights: Tensor
    """(B, 1, S) one-hot of the greatest, by which S is multiplied; no gradient passes."""


class SpeakerStyle(nn.Module):
    """Eˢₚ and S: an encoder that recognises speakers by their poses, and a row of numbers for each speaker.

    Args:
        pose: D.
        channels: of the encoder.
        speakers: S, rows of the matrix.
        width: numbers of an embedding.
        freezes: whether the encoder is frozen for generated poses.
    """

    def __init__(self, pose: int, channels: int, speakers: int, width: int, *, freezes: bool) -> None:
        super().__init__()
        self.speakers, self.width, self.freezes = speakers, width, freezes
        self.encoder = StyleLogits(pose, channels, speakers)
        self.matrix = nn.Parameter(torch.randn(speakers, width))

    def forward(self, weights: Tensor) -> Tensor:
        """(B, T or 1, S) weights of the speakers → (B, width, T or 1) weights · S."""
        return (weights @ self.matrix).mT

    def see(self, pose: Tensor) -> StyleReading:
        """Of (B, D, T) poses, T ≥ 64."""
        logits = self.encoder(pose)
        return StyleReading(logits, F.one_hot(logits.argmax(1), self.speakers).to(logits).unsqueeze(1))

    def identity(self, reading: StyleReading, poses: Tensor, speaker: Tensor) -> dict[str, Tensor]:
        """Equation 6: CCE of the reading of recorded poses, and of the reading of generated ones (B, D, T)."""
        return {"id": F.cross_entropy(reading.logits, speaker) + F.cross_entropy(self.recognise(poses), speaker)}

    def recognise(self, poses: Tensor) -> Tensor:
        """(B, S) logits of Eˢₚ for generated poses."""
        if not self.freezes:
            logits: Tensor = self.encoder(poses)
            return logits
        parameters = {name: value.detach() for name, value in self.encoder.named_parameters()}
        scores: Tensor = functional_call(self.encoder, parameters, (poses,))
        return scores


class NoStyle(nn.Module):
    """For one speaker: nothing to embed, nothing to recognise."""

    speakers = width = 0

    def forward(self, weights: Tensor) -> Tensor:
        """(B, T or 1, 0) → (B, 0, T or 1)."""
        return weights.mT

    def see(self, pose: Tensor) -> StyleReading:
        """No logits, no weights."""
        return StyleReading(pose.new_zeros(len(pose), 0), pose.new_zeros(len(pose), 1, 0))

    def identity(self, reading: StyleReading, poses: Tensor, speaker: Tensor) -> dict[str, Tensor]:
        """No term."""
        return {}
