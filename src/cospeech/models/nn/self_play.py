"""Self-play of an autoregressive flow: each pose is fed back, when it generates and, with gradients, in a loss."""

from __future__ import annotations

from collections.abc import Callable
from math import inf

import torch
from torch import Tensor

from .flow import State

__all__ = ["FAR", "play_window"]

FAR = 8.0  # standard deviations [ours]: no recorded pose is so far away; poses of a network at the start of training can be

Step = Callable[[Tensor, Tensor, Tensor, list[State] | None], tuple[Tensor, list[State]]]
"""Latents (B, D), history (B, τ, D), speech (B, τ + 1 + l, A), states → pose (B, D), states."""


def play_window(step: Step, latents: Tensor, history: Tensor, speech: Tensor, limit: float = inf) -> Tensor:
    """Poses that follow a history; each pose is fed back.

    Args:
        step: of the network, for one frame.
        latents: (B, F, D).
        history: (B, τ, D).
        speech: (B, F, τ + 1 + l, A).
        limit: standard deviations to which poses are limited; `FAR` in a loss.

    Returns:
        (B, F, D).
    """
    tau, poses, states = history.shape[1], history, None
    for t in range(latents.shape[1]):
        pose, states = step(latents[:, t], poses[:, -tau:], speech[:, t], states)
        poses = torch.cat([poses, pose[:, None].clamp(-limit, limit)], 1)
    return poses[:, tau:]
