"""The speaker as a distribution of latents, and how much motion differs by it (Yoon et al. 2020)."""

from __future__ import annotations

from torch import Tensor, nn
from torch.nn import functional as F

__all__ = ["SpeakerLatent", "kl_divergence", "pose_diversity"]

_CUT = 1000.0  # upper limit of the diversity of a window; authors' code
_NEAR = 1e-5  # added to |z' − z|₁; authors' code


class SpeakerLatent(nn.Module):
    """(B, T, S) weights of the speakers → μ and log σ² of z, (B, width, T) each.

    Args:
        speakers: S.
        width: of z.
        slope: of LeakyReLU after the first linear layer; 1: there is none.
    """

    def __init__(self, speakers: int, width: int, slope: float = 1.0) -> None:
        super().__init__()
        self.embedding = nn.Embedding(speakers, width)
        self.encoder = nn.Sequential(nn.Linear(width, width), nn.LeakyReLU(slope))
        self.mean, self.variance = nn.Linear(width, width), nn.Linear(width, width)

    def forward(self, weights: Tensor) -> tuple[Tensor, Tensor]:
        code = self.encoder(weights @ self.embedding.weight)
        return self.mean(code).mT, self.variance(code).mT


def kl_divergence(mean: Tensor, variance: Tensor) -> Tensor:
    """KL(N(μ, σ) ‖ N(0, 1)), the mean over all numbers; ``variance`` is log σ²."""
    return (variance.exp() + mean.square() - variance - 1).mean() / 2


def pose_diversity(pose: Tensor, other: Tensor, z: Tensor, other_z: Tensor, beta: float) -> Tensor:
    """How much the motion of another speaker differs, relative to the difference of z: min(1000, Σ Huber(ŷ', ŷ) / |z' − z|₁).

    Args:
        pose, other: (B, T, D) made of z and of z'.
        z, other_z: (B, width, T) each; taken as constants.
        beta: of Huber's loss.
    """
    distance = F.smooth_l1_loss(other, pose, beta=beta, reduction="none").sum((1, 2))
    return (distance / ((other_z - z).detach().abs().mean((1, 2)) + _NEAR)).clamp_max(_CUT).mean()
