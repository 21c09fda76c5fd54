"""A window that an autoregressive flow plays by itself from its recorded history, as a loss needs it: with gradients."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from .flow import State

__all__ = ["play_window"]

_FAR = 8.0  # standard deviations [ours]: no recorded pose is as far; the first networks of a training run can be

Step = Callable[[Tensor, Tensor, Tensor, list[State] | None], tuple[Tensor, list[State]]]
"""Latents (B, D), history (B, τ, D), speech (B, τ + 1 + l, A), states → pose (B, D), states."""


def play_window(step: Step, latents: Tensor, history: Tensor, heard: Tensor) -> Tensor:
    """Poses that follow a history; each pose is fed back.

    Args:
        step: of the network, for one frame.
        latents: (B, F, D).
        history: (B, τ, D).
        heard: (B, F, τ + 1 + l, A).

    Returns:
        (B, F, D).
    """
    tau, poses, states = history.shape[1], history, None
    for t in range(heard.shape[1]):
        made, states = step(latents[:, t], poses[:, -tau:], heard[:, t], states)
        poses = torch.cat([poses, made[:, None].clamp(-_FAR, _FAR)], 1)
    return poses[:, tau:]
