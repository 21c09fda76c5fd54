"""Normalising flows over sequences of poses: Glow (Kingma & Dhariwal 2018) as MoGlow (Henter et al. 2020) uses it.

x (B, T, D) are poses, z (B, T, D) latents, c (B, T, C) the conditioning of every frame. ``forward`` is the normalising
direction x → z and gives log |det ∂z/∂x| per frame; ``inverse`` generates. Recurrent couplings keep a state from frame to
frame, so that a sequence may be processed in pieces.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import lgamma, log, pi
from typing import Any

import torch
from torch import Tensor, nn

from ...errors import InputError
from .norm import global_moments

__all__ = ["ActNorm", "Coupling", "Flow", "FlowStep", "InvertibleLinear", "Latent", "RecurrentNet"]

State = Any
"""The state of a recurrent net from frame to frame; None at the beginning."""

STD_FLOOR = 1e-6  # authors' code, glow/modules.py
SCALE_SHIFT, SCALE_FLOOR = 2.0, 1e-6  # authors' code, glow/models.py: sigmoid(s + 2) + 1e-6, near 1 at the start


class ActNorm(nn.Module):
    """z = (x + b) · exp(s), per channel; set by the first training batch so that z has mean 0 and deviation 1."""

    initialised: Tensor

    def __init__(self, dim: int) -> None:
        super().__init__()
        self.bias = nn.Parameter(torch.zeros(dim))
        self.logs = nn.Parameter(torch.zeros(dim))
        self.register_buffer("initialised", torch.tensor(False))

    @torch.no_grad()
    def initialise(self, x: Tensor) -> None:
        """Take mean and deviation of a batch, the global one where several processes train."""
        mean, std = global_moments(x, (0, 1))
        self.bias.copy_(-mean)
        self.logs.copy_(-torch.log(std + STD_FLOOR))
        self.initialised.fill_(True)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        if self.training and not self.initialised:
            self.initialise(x.detach())
        return (x + self.bias) * torch.exp(self.logs), self.logs.sum()

    def inverse(self, z: Tensor) -> Tensor:
        return z * torch.exp(-self.logs) - self.bias


class InvertibleLinear(nn.Module):
    """z = W x with W = P L (U + diag(sign · exp s)): Glow's 1×1 convolution, by its LU parts; log |det W| = Σ s.

    It starts as a random rotation, drawn from PyTorch's generator.
    """

    permutation: Tensor
    sign: Tensor

    def __init__(self, dim: int) -> None:
        super().__init__()
        rotation = torch.linalg.qr(torch.randn(dim, dim, dtype=torch.float64))[0]
        permutation, lower, upper = torch.linalg.lu(rotation)
        diagonal = upper.diagonal()
        self.register_buffer("permutation", permutation.float())
        self.register_buffer("sign", diagonal.sign().float())
        self.lower = nn.Parameter(lower.tril(-1).float())
        self.upper = nn.Parameter(upper.triu(1).float())
        self.log_s = nn.Parameter(diagonal.abs().log().float())

    def weight(self) -> Tensor:
        """(D, D) the matrix W; only the strict triangles of ``lower`` and ``upper`` count."""
        eye = torch.eye(len(self.log_s), device=self.log_s.device, dtype=self.log_s.dtype)
        upper = self.upper.triu(1) + torch.diag(self.sign * torch.exp(self.log_s))
        return self.permutation @ (self.lower.tril(-1) + eye) @ upper

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        return x @ self.weight().T, self.log_s.sum()

    def inverse(self, z: Tensor) -> Tensor:
        return z @ torch.linalg.inv(self.weight()).T


class RecurrentNet(nn.Module):
    """Recurrent layers and a linear one that begins at zero: (B, T, in) → (B, T, out), and a state.

    Args:
        cell: `torch.nn.GRU` or `torch.nn.LSTM`.
        inputs, hidden, outputs: widths.
        layers: of the recurrent part.
    """

    def __init__(self, cell: type[nn.GRU] | type[nn.LSTM], inputs: int, hidden: int, outputs: int, layers: int) -> None:
        super().__init__()
        self.rnn = cell(inputs, hidden, layers, batch_first=True)
        self.out = nn.Linear(hidden, outputs)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)

    def forward(self, x: Tensor, state: State = None) -> tuple[Tensor, State]:
        hidden, state = self.rnn(x, state)
        return self.out(hidden), state


class Coupling(nn.Module):
    """Affine coupling: z₁ = x₁, z₂ = (x₂ + b) · s with (b, s) = net(x₁, c) (flow paper, equations 7–9).

    x₁ are the first ⌊D/2⌋ channels. Shifts are the even outputs of the net, scales the odd ones, s = σ(· + 2) + 1e-6.

    Args:
        dim: D.
        context: C.
        net: (inputs, outputs) → a module (B, T, inputs), state → (B, T, outputs), state.
    """

    def __init__(self, dim: int, context: int, net: Callable[[int, int], nn.Module]) -> None:
        super().__init__()
        self.first_half = dim // 2
        self.net = net(self.first_half + context, 2 * (dim - self.first_half))

    def _shift_scale(self, first: Tensor, c: Tensor, state: State) -> tuple[Tensor, Tensor, State]:
        out, state = self.net(torch.cat([first, c], -1), state)
        return out[..., 0::2], torch.sigmoid(out[..., 1::2] + SCALE_SHIFT) + SCALE_FLOOR, state

    def forward(self, x: Tensor, c: Tensor, state: State = None) -> tuple[Tensor, Tensor, State]:
        first, second = x[..., : self.first_half], x[..., self.first_half :]
        shift, scale, state = self._shift_scale(first, c, state)
        return torch.cat([first, (second + shift) * scale], -1), torch.log(scale).sum(-1), state

    def inverse(self, z: Tensor, c: Tensor, state: State = None) -> tuple[Tensor, State]:
        first, second = z[..., : self.first_half], z[..., self.first_half :]
        shift, scale, state = self._shift_scale(first, c, state)
        return torch.cat([first, second / scale - shift], -1), state


class FlowStep(nn.Module):
    """ActNorm → invertible linear map → coupling."""

    def __init__(self, dim: int, context: int, net: Callable[[int, int], nn.Module]) -> None:
        super().__init__()
        self.norm, self.mix = ActNorm(dim), InvertibleLinear(dim)
        self.coupling = Coupling(dim, context, net)

    def forward(self, x: Tensor, c: Tensor, state: State = None) -> tuple[Tensor, Tensor, State]:
        x, first = self.norm(x)
        x, second = self.mix(x)
        x, third, state = self.coupling(x, c, state)
        return x, third + first + second, state

    def inverse(self, z: Tensor, c: Tensor, state: State = None) -> tuple[Tensor, State]:
        z, state = self.coupling.inverse(z, c, state)
        return self.norm.inverse(self.mix.inverse(z)), state


class Latent(nn.Module):
    """The fixed density of one frame's latents: Student's t with ν degrees of freedom, or the normal one where ν is infinite.

    ln p(z) = ln Γ((ν+D)/2) − ln Γ(ν/2) − D/2 ln(νπ) − (ν+D)/2 ln(1 + |z|²/ν); a sample is N(0, 1) / √(χ²_ν / ν), with
    one χ² per frame.
    """

    def __init__(self, dim: int, nu: float) -> None:
        super().__init__()
        if nu != float("inf") and (nu < 1 or nu != int(nu)):
            raise InputError(f"{nu} degrees of freedom", "a whole number from 1 on, or inf")
        self.dim, self.nu = dim, nu

    def log_prob(self, z: Tensor) -> Tensor:
        """(…, D) → (…) nats."""
        square = z.square().sum(-1)
        if self.nu == float("inf"):
            return -0.5 * (square + self.dim * log(2 * pi))
        constant = lgamma((self.nu + self.dim) / 2) - lgamma(self.nu / 2) - self.dim / 2 * log(self.nu * pi)
        return constant - (self.nu + self.dim) / 2 * torch.log1p(square / self.nu)

    def sample(self, normal: Callable[..., Tensor], rows: int, frames: int) -> Tensor:
        """(rows, frames, D) latents.

        Args:
            normal: (rows, …) → that many draws of N(0, 1), such as `cospeech.models.nn.objective.StepRandom.normal`.
        """
        z = normal(rows, frames, self.dim)
        if self.nu == float("inf"):
            return z
        return z / normal(rows, frames, int(self.nu)).square().mean(-1, keepdim=True).sqrt()


class Flow(nn.Module):
    """K steps one after the other, and the latent density at their end.

    Args:
        dim, context: D, C.
        steps: K.
        net: see `Coupling`.
        nu: see `Latent`.
    """

    def __init__(self, dim: int, context: int, steps: int, net: Callable[[int, int], nn.Module], nu: float) -> None:
        super().__init__()
        self.steps = nn.ModuleList(FlowStep(dim, context, net) for _ in range(steps))
        self.latent = Latent(dim, nu)

    def forward(self, x: Tensor, c: Tensor, states: Sequence[State] | None = None) -> tuple[Tensor, Tensor, list[State]]:
        """Poses (B, T, D) → latents (B, T, D), log-determinants (B, T), states."""
        total = x.new_zeros(x.shape[:-1])
        new_states: list[State] = []
        for k, step in enumerate(self.steps):
            x, ladj, state = step(x, c, None if states is None else states[k])
            total, new_states = total + ladj, [*new_states, state]
        return x, total, new_states

    def inverse(self, z: Tensor, c: Tensor, states: Sequence[State] | None = None) -> tuple[Tensor, list[State]]:
        """Latents (B, T, D) → poses (B, T, D), states."""
        new_states: list[State] = [None] * len(self.steps)
        for k in reversed(range(len(self.steps))):
            z, new_states[k] = self.steps[k].inverse(z, c, None if states is None else states[k])  # type: ignore[operator]
        return z, new_states

    def log_prob(self, x: Tensor, c: Tensor) -> Tensor:
        """(B, T) exact ln p(x_t | c_t, frames before), in nats (flow paper, equation 5)."""
        z, ladj, _ = self(x, c)
        return self.latent.log_prob(z) + ladj
