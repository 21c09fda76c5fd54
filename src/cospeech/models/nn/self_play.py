"""What an autoregressive flow plays by itself: each pose is fed back, when it generates and, with gradients, in a loss."""

from __future__ import annotations

from collections.abc import Callable
from math import inf

import torch
from torch import Tensor

from .flow import State

__all__ = ["FAR", "play_window"]

FAR = 8.0  # standard deviations [ours]: no recorded pose is as far; the first networks of a training run can be

Step = Callable[[Tensor, Tensor, Tensor, list[State] | None], tuple[Tensor, list[State]]]
"""Latents (B, D), history (B, τ, D), speech (B, τ + 1 + l, A), states → pose (B, D), states."""


def play_window(step: Step, latents: Tensor, history: Tensor, heard: Tensor, limit: float = inf) -> Tensor:
    """Poses that follow a history; each pose is fed back.

    Args:
        step: of the network, for one frame.
        latents: (B, F, D).
        history: (B, τ, D).
        heard: (B, F, τ + 1 + l, A).
        limit: standard deviations beyond which no pose is; `FAR` in a loss.

    Returns:
        (B, F, D).
    """
    tau, poses, states = history.shape[1], history, None
    for t in range(latents.shape[1]):
        made, states = step(latents[:, t], poses[:, -tau:], heard[:, t], states)
        poses = torch.cat([poses, made[:, None].clamp(-limit, limit)], 1)
    return poses[:, tau:]
