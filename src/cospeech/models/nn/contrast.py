"""The rhythmic identification loss (Xu et al. 2024, equation 6): InfoNCE between two sequences that belong frame to frame."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

__all__ = ["RhythmIdentity", "info_nce"]


def info_nce(queries: Tensor, keys: Tensor, temperature: float) -> Tensor:
    """−log of the share that frame i of the keys has, among all frames of its clip, in likeness to frame i of the queries.

    Args:
        queries, keys: (B, C, T).
        temperature: τ, by which cosines are divided.

    Returns:
        the mean over frames and clips, ().
    """
    likeness = torch.einsum("bci,bcj->bij", F.normalize(queries, dim=1), F.normalize(keys, dim=1)) / temperature
    own = torch.arange(likeness.shape[1], device=likeness.device).expand(likeness.shape[:2])
    return F.cross_entropy(likeness.mT, own)  # classes are dimension 1: the keys


class RhythmIdentity(nn.Module):
    """Equation 6 with its encoders f and g, which the paper does not describe: linear, ReLU, linear, per frame.

    Args:
        channels: of both sequences and of what they are encoded as; 128.
        temperature: τ; 0.1.
    """

    def __init__(self, channels: int, temperature: float) -> None:
        super().__init__()
        self.face, self.speech = (
            nn.Sequential(nn.Conv1d(channels, channels, 1), nn.ReLU(), nn.Conv1d(channels, channels, 1)) for _ in range(2)
        )
        self.temperature = temperature

    def forward(self, face: Tensor, speech: Tensor) -> Tensor:
        """(B, C, T) facial features F̂ and (B, C, T) audio features Â → ()."""
        return info_nce(self.face(face), self.speech(speech), self.temperature)
