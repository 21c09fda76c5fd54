"""Smooth noise, as `cospeech.runtime.mode_noise` has it when a network plays; here in batches, for training."""

from __future__ import annotations

import torch
from torch import Tensor

from .objective import StepRandom

__all__ = ["smooth_noise"]

JITTER = 1e-6  # ours: on the diagonal of the covariance, which neighbouring frames make nearly singular
EDGE = 1e-6  # ours: probabilities stay so far from 0 and 1, so that noise is finite in float32


def smooth_noise(chance: StepRandom, rows: int, width: int, frames: int, persistence: float, *, normal: bool = False) -> Tensor:
    """Noise that is of a standard Gumbel distribution at every frame, independent along ``width``: (rows, width, frames).

    A Gaussian process of the correlation (1 + λτ) e^(−λτ), λ = 2 / ``persistence``, through both distribution functions.

    Args:
        chance: of the batch.
        rows: B.
        width: M.
        frames: T.
        persistence: frames over which the noise correlates (the integral of its correlation).
        normal: whether the distribution is the standard normal one instead.
    """
    plain = chance.normal(rows, width, frames)
    lag = 2 / persistence * (torch.arange(frames)[:, None] - torch.arange(frames)).abs().double()
    covariance = (1 + lag) * torch.exp(-lag) + JITTER * torch.eye(frames, dtype=torch.float64)
    root = torch.linalg.cholesky(covariance).to(plain)
    smooth = plain @ root.mT
    if normal:
        return smooth
    share = torch.special.ndtr(smooth).clamp(EDGE, 1 - EDGE)
    return -torch.log(-torch.log(share))
