"""The common part of networks that draw motion from a distribution: latents of four frames each are drawn, then decoded.

A bundle holds the parts; `cospeech.runtime.samplers` draws:

    hear                speech → features for the sampler
    prior or denoise    the distribution of the latents, step by step
    make                latents → poses
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
from torch import Tensor, nn

from .coder import STRIDE
from .export import ExportGraph
from .windowed import Windowed

__all__ = ["Sampled", "at_rest", "fill_up", "hold"]

_SEED = 0  # of the noise of tables; ours


@contextmanager
def at_rest(*modules: nn.Module) -> Iterator[None]:
    """Modules of an earlier training stage in evaluation mode, without gradients."""
    modes = [module.training for module in modules]
    for module in modules:
        module.eval()
    try:
        with torch.no_grad():
            yield
    finally:
        for module, mode in zip(modules, modes, strict=True):
            module.train(mode)


def fill_up(x: Tensor) -> Tensor:
    """(B, T, C) with its last frame repeated, up to whole steps."""
    return hold(x, x.shape[1] + -x.shape[1] % STRIDE)


def hold(x: Tensor, frames: int) -> Tensor:
    """(B, T, C) with its last frame repeated → (B, ``frames``, C)."""
    return torch.cat([x, x[:, -1:].expand(-1, frames - x.shape[1], -1)], 1)


class Sampled(Windowed):
    """A network of windows whose motion is drawn; a subclass has `hear`, `decode`, `sampler` and `make`.

    In `make` it draws with ``mode_noise``. Each step has the noise of its first frame; zeros give the most likely motion.
    """

    literal = True
    """Motion that is drawn has the speakers' mean poses and deviations already."""
    multiple = shortest = STRIDE
    heard: int
    """Numbers of a step of the features of speech."""
    latent: int
    """Numbers of a step of the latents."""

    @property
    def preliminary_steps(self) -> int:
        """Those of the stages before that of the distribution."""
        return max(objective.start for objective in self.objectives().values())

    def hear(self, audio: Tensor) -> Tensor:
        """(B, A, T) → (B, heard, T / 4)."""
        raise NotImplementedError

    def decode(self, latent: Tensor) -> Tensor:
        """(B, latent, T / 4) → (B, D, T)."""
        raise NotImplementedError

    def sampler(self) -> dict[str, ExportGraph]:
        """The network that the runtime's sampler runs, step by step, by its name."""
        raise NotImplementedError

    def draw_noise(self, like: Tensor) -> Tensor:
        """(B, T, modes) for (B, T, ·), always the same: the noise of tables."""
        draw = torch.Generator().manual_seed(_SEED)
        return torch.randn(*like.shape[:2], self.modes, generator=draw).to(like)

    def export_module(self) -> dict[str, ExportGraph]:
        """``hear``, the sampler's network, ``make``, and ``style`` where it recognises styles. Half of a window is new, and a
        quarter of it follows the new half."""
        steps = self.window // STRIDE
        common: dict[str, Any] = {"frames": 8 * STRIDE, "multiple": STRIDE, "shortest": STRIDE, "window": self.window}
        rows, features = {"rows": (1, "T", self.audio)}, {"heard": (1, "S", self.heard)}
        latent, poses = {"latent": ("N", "S", self.latent)}, {"poses": ("N", "T", self.pose)}
        layout: dict[str, Any] = {"hop": STRIDE * max(1, steps // 2), "look_ahead": STRIDE * (steps // 4)}
        return {
            "hear": ExportGraph(_OverTime(self, "hear"), rows, features, **common),
            **self.sampler(),
            "make": ExportGraph(_OverTime(self, "decode"), latent, poses, **layout, **common),
            **self.style_graph(),
        }


class _OverTime(nn.Module):
    """A method of a network on (B, C, T) as a module on (B, T, C)."""

    def __init__(self, net: Sampled, method: str) -> None:
        super().__init__()
        self.net, self.method = net, method

    def forward(self, x: Tensor) -> Tensor:
        out: Tensor = getattr(self.net, self.method)(x.mT).mT
        return out
