"""InfoNCE: between two sequences whose frames belong together, as in the rhythmic identification loss (Xu et al. 2024, equation
6), and between vectors and those of labels."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

__all__ = ["RhythmIdentity", "choice_nce", "info_nce", "unit"]

LEAST = 1e-6  # of a mean square


def info_nce(queries: Tensor, keys: Tensor, temperature: float) -> Tensor:
    """−log of the softmax weight of frame i of the keys, among all frames of its clip, by similarity to frame i of the queries.

    Args:
        queries, keys: (B, C, T).
        temperature: τ, by which cosines are divided.

    Returns:
        the mean over frames and clips, ().
    """
    likeness = torch.einsum("bci,bcj->bij", F.normalize(queries, dim=1), F.normalize(keys, dim=1)) / temperature
    own = torch.arange(likeness.shape[1], device=likeness.device).expand(likeness.shape[:2])
    return F.cross_entropy(likeness.mT, own)  # classes are dimension 1: the keys


def unit(x: Tensor) -> Tensor:
    """(…, C) vectors brought to the length √C."""
    return x / ((x * x).mean(-1, keepdim=True) + LEAST).sqrt()


def choice_nce(queries: Tensor, keys: Tensor, labels: Tensor, temperature: float) -> Tensor:
    """−log of the softmax weight of the key of the own label, among the keys of all labels, by similarity to each query.

    Args:
        queries: (B, C).
        keys: (K, C), of all labels.
        labels: (B,) number of each query's label; −1: unknown, it counts as 0.
        temperature: τ, by which cosines are divided.

    Returns:
        the mean, ().
    """
    likeness = unit(queries) @ unit(keys).mT / keys.shape[1] / temperature
    each = F.cross_entropy(likeness, labels.clamp_min(0), reduction="none")
    return torch.where(labels >= 0, each, 0.0).mean()


class RhythmIdentity(nn.Module):
    """Equation 6 with its encoders f and g, which the paper does not describe: linear, ReLU, linear, per frame.

    Args:
        channels: of both sequences, and of their codes; 128.
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
