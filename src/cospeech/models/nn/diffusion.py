"""Gaussian diffusion as a rotation: data and noise are the two sides of an angle φ (Salimans and Ho 2022, section 4).

    x_φ = cos φ · z + sin φ · ε,     v = cos φ · ε − sin φ · z,     0 ≤ φ ≤ π / 2
    z = cos φ · x − sin φ · v,       ε = sin φ · x + cos φ · v

With φ proportional to time this is the cosine schedule (Nichol and Dhariwal 2021). A network estimates the velocity v; steps of
the deterministic sampler (DDIM, Song et al. 2021) turn x by the estimate from φ to a smaller angle.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import torch
from torch import Tensor

__all__ = ["add_noise", "angles", "denoise", "level_features", "velocity"]


def add_noise(z: Tensor, noise: Tensor, angle: Tensor) -> Tensor:
    """x_φ of (B, …) data and noise at angles (B,)."""
    angle = angle.view(-1, *[1] * (z.dim() - 1))
    return angle.cos() * z + angle.sin() * noise


def velocity(z: Tensor, noise: Tensor, angle: Tensor) -> Tensor:
    """v of (B, …) data and noise at angles (B,)."""
    angle = angle.view(-1, *[1] * (z.dim() - 1))
    return angle.cos() * noise - angle.sin() * z


def angles(steps: int) -> list[float]:
    """The angles of so many steps, from noise to data; after the last it is 0."""
    return [pi / 2 * (1 - k / steps) for k in range(steps)]


def level_features(angle: Tensor, count: int) -> Tensor:
    """(B,) angles → (B, 2 · count): cosines and sines of their multiples, which tell a network how much noise there is."""
    times = angle.unsqueeze(-1) * torch.arange(1, count + 1, device=angle.device)
    return torch.cat([times.cos(), times.sin()], -1)


def denoise(estimate: Callable[[Tensor, float], Tensor], noise: Tensor, steps: int, prefix: Tensor | None = None) -> Tensor:
    """Data from noise.

    Args:
        estimate: (x, φ) → v, of x's shape.
        noise: (B, T, L), the start.
        steps: how many.
        prefix: (B, k, L) known data of the first steps in time, which do not change (Lugmayr et al. 2022, but without their
            returns to more noise).

    Returns:
        (B, T, L).
    """
    length = 0 if prefix is None else prefix.shape[1]

    def hold(x: Tensor, angle: float) -> Tensor:
        if prefix is None:
            return x
        at = torch.full((len(x),), angle, device=x.device)
        return torch.cat([add_noise(prefix, noise[:, :length], at), x[:, length:]], 1)

    x, turns = noise, torch.tensor([*angles(steps), 0.0])
    for now, after in zip(turns[:-1].tolist(), turns[1:], strict=True):
        x = hold(x, now)
        v, here = estimate(x, now), torch.tensor(now)
        x = (here - after).cos() * x - (here - after).sin() * v
    return hold(x, 0.0)
