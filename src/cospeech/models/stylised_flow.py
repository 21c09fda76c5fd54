"""The stylised flow: Ye et al. 2022, "Audio-Driven Stylized Gesture Generation with Flow-Based Model".

A normalising flow gives the exact density of the next pose, given the poses before it and the speech around it:

    p(x | a) = ∏ₜ p(xₜ | xₜ₋τ…ₜ₋₁, aₜ₋τ…ₜ₊ₗ)                                          (6)
    ln p(xₜ | …) = ln p_Z(zₜ) + Σₖ ln |det ∂hₖ/∂hₖ₋₁|,  z = f(x), p_Z Student's t          (5)

         poses t−τ … t−1 ──TCN──┐
                                ├─ fully connected ─ f_t (32) ─┐
         speech t−τ … t+l ──TCN─┘                               │   the global encoder
         poses, speech ─────────────────────────────────────────┴─► c_t
                                                                     │
      x_t ─►[ ActNorm ─ 1×1 convolution ─ affine coupling(GRU(x₁, c_t)) ] × K ─► z_t

Objective (11): L = NLL + λ₁ |x̂ − x|₁ + λ₂ |ω(x̂) − ω(x)|₁, where x̂ is the output for random latents with the same c, and ω the
fourth layer of a gesture autoencoder (`cospeech.models.gesture_autoencoder`).

Followed, changed, not said in the paper: docs/models/stylised_flow.md, by number. This file is the paper; what we add to it
is in `cospeech.models.stylised_flow_extended`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from ..errors import InputError
from .gesture_autoencoder import GestureAutoencoder
from .nn.conditioning import GlobalEncoder, drop_history, frame_windows
from .nn.configuration import SMALL_FLOW, ModelConfig
from .nn.flow import Flow, RecurrentNet, State
from .nn.objective import Batch, Objective, StepRandom
from .nn.self_play import play_window
from .nn.settings import check_least
from .nn.trainable import Trainable

__all__ = ["FlowConfig", "StylisedFlow"]

SHORTEST = 4  # the least number of frames for two convolutions with kernel 4 and stride 2


@dataclass(frozen=True)
class FlowConfig(ModelConfig):
    """Sizes and weights; the defaults are the paper's for TED."""

    TINY: ClassVar[Mapping[str, Any]] = {"steps": 2, "hidden": 16, "encoder_channels": 8, "encoder_blocks": 2}
    SMALL: ClassVar[Mapping[str, Any]] = {
        "name": "stylised-flow-extended", "steps": 4, "hidden": 64, "frames": 30, "residual": True, "pose_noise": 0.005,
        "encoder_channels": 16, "encoder_blocks": 2, "reconstruct_every": 5,
    }  # fmt: skip
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_FLOW

    steps: int = 16
    """K; not stated, authors' code 16."""
    hidden: int = 800
    """Units of a GRU layer; not stated, authors' code 800."""
    layers: int = 2
    """GRU layers of a coupling; not stated, authors' code 2."""
    history: int = 12
    """τ, poses that condition a frame; section 4.1 (Trinity: 5)."""
    look_ahead: int = 0
    """l, frames of speech after the generated frame; section 3.2 (Trinity: 20, section 4.1)."""
    frames: int = 30
    """Frames trained in a window, after the history; section 4.1 (Trinity: 120 in all)."""
    nu: int = 50
    """Degrees of freedom of the latent; not stated, authors' code 50."""
    encoder: bool = True
    """Whether there is a global encoder; without one: the ablation of table 2."""
    feature: int = 32
    """Width of f_t; not stated, authors' code 32."""
    encoder_channels: int = 256
    """Of the encoder's convolutions and linear layers; not stated, authors' code 256."""
    encoder_blocks: int = 5
    """Residual blocks of a TCN; not stated, authors' code 5."""
    encoder_relu: bool = True
    """Whether a TCN ends in a ReLU, after its last batch norm; section 3.2 (blocks of convolution, batch norm, ReLU), authors'
    code. Runs of earlier versions were trained without."""
    encoder_oldest: bool = False
    """Whether a TCN's output at its oldest position counts, not the mean, as in the authors' interpolation to length 1."""
    history_dropout: float = 0.4
    """Probability that a pose of the history is blanked; not stated, authors' code 0.4 (as MoGlow)."""
    reconstruction: float = 1.0
    """λ₁; section 3.3."""
    perceptual: float = 0.1
    """λ₂; section 3.3."""
    reconstruct_every: int = 1
    """Every how many steps there are the terms of λ₁ and λ₂; in the paper in all, in the authors' code in every fifth."""
    nll_unit: float = 1.0
    """Nats of the unit in which the NLL of a frame is summed with the other terms; the authors' code has bits (0.6931)."""


class StylisedFlow(Trainable):
    """The stylised flow (Ye et al. 2022): many motions for one speech, in the style of an example.

    Poses and audio are standardised vectors.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech.
        omega: (B, T, D) → features of the gesture perceptual loss, frozen; None: a loss without it (ablation).
    """

    Config = FlowConfig
    config: FlowConfig

    def __init__(self, config: FlowConfig, *, pose: int, audio: int, omega: nn.Module | None = None) -> None:
        super().__init__()
        sizes = dict.fromkeys(("steps", "hidden", "layers", "history", "frames"), 1)
        check_least(config, "a stylised flow", sizes | {"look_ahead": 0})
        if config.encoder and config.history < SHORTEST:
            raise InputError(f"a history of {config.history} frames", f"{SHORTEST} at least, for the global encoder")
        self.config, self.pose, self.audio = config, pose, audio
        self.encoder: GlobalEncoder | None = None
        if config.encoder:
            self.encoder = GlobalEncoder(
                pose, audio, channels=config.encoder_channels, blocks=config.encoder_blocks, feature=config.feature,
                oldest=config.encoder_oldest, relu=config.encoder_relu,
            )  # fmt: skip
        context = config.history * pose + self.speech_frames * audio + (config.feature if config.encoder else 0)
        context += self._add_encoders()
        self.flow = Flow(pose, context, config.steps, self._net, float(config.nu))
        extractor = omega.omega if isinstance(omega, GestureAutoencoder) else omega  # its fourth layer
        self.omega = [extractor.eval().requires_grad_(False)] if extractor is not None else []  # a list: no part of this model

    def _add_encoders(self) -> int:
        """Make further encoders that condition a frame; returns how many numbers they give. The paper has none."""
        return 0

    def _net(self, inputs: int, outputs: int) -> RecurrentNet:
        return RecurrentNet(nn.GRU, inputs, self.config.hidden, outputs, self.config.layers)

    @property
    def speech_frames(self) -> int:
        """Frames of speech that condition a frame: τ + 1 + l."""
        return self.config.history + 1 + self.config.look_ahead

    @property
    def window(self) -> int:
        """Frames of a training window: history, trained frames, look-ahead."""
        return self.config.history + self.config.frames + self.config.look_ahead

    # the density ----------------------------------------------------------------------------------------------------

    def condition(self, poses: Tensor, audio: Tensor) -> Tensor:
        """c_t of equation 8.

        Args:
            poses: (B, F, τ, D), oldest first.
            audio: (B, F, τ + 1 + l, A).

        Returns:
            (B, F, C).
        """
        parts = [poses.flatten(2), audio.flatten(2)]
        if self.encoder is not None:
            parts.append(self.encoder(poses, audio))
        return torch.cat(parts, -1)

    def _windows(self, pose: Tensor, audio: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Trained poses (B, F, D), their histories (B, F, τ, D) and the speech about them (B, F, τ + 1 + l, A)."""
        tau, frames = self.config.history, pose.shape[1] - self.config.history - self.config.look_ahead
        if frames < 1 or audio.shape[1] != pose.shape[1]:
            raise InputError(f"{pose.shape[1]} poses and {audio.shape[1]} frames of speech", f"both {self.window}")
        x = pose[:, tau : tau + frames]
        return x, frame_windows(pose[:, : tau + frames - 1], tau), frame_windows(audio, self.speech_frames)

    def log_prob(self, pose: Tensor, audio: Tensor) -> Tensor:
        """Exact log-likelihood (equation 5) of each frame after the history.

        Args:
            pose: (B, τ + F + l, D); the first τ are given, the last l are not used.
            audio: (B, τ + F + l, A).

        Returns:
            (B, F) nats, of standardised poses.
        """
        x, histories, speech = self._windows(pose, audio)
        return self.flow.log_prob(x, self.condition(histories, speech))

    def latents(self, pose: Tensor, audio: Tensor) -> Tensor:
        """(B, F, D): the z of each frame after the history; arguments as in `log_prob`."""
        x, histories, speech = self._windows(pose, audio)
        return self.flow(x, self.condition(histories, speech))[0]

    # what is optimised ----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """One: equation 11."""
        return {"flow": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """The terms of equation 11, weighted."""
        x, histories, speech = self._windows(batch["pose"], batch["audio"])
        if self.training:
            histories = drop_history(histories, self.config.history_dropout, batch.chance)
        return self.losses(x, self.condition(histories, speech), batch.chance, step)

    def losses(self, x: Tensor, c: Tensor, chance: StepRandom, step: int, base: Tensor | float = 0.0) -> dict[str, Tensor]:
        """The terms of equation 11, weighted.

        Args:
            x: (B, F, D) poses.
            c: (B, F, C) their conditioning.
            chance: draws of the latents of x̂.
            step: of the loop.
            base: it is added to the flow's output; in the paper 0.
        """
        terms = {"nll": -self.flow.log_prob(x - base, c).mean() / self.config.nll_unit}
        if step % self.config.reconstruct_every == 0 and (self.config.reconstruction or self.omega):
            z = self.flow.latent.sample(chance.normal, len(x), x.shape[1])
            poses = base + self.flow.inverse(z, c)[0]
            terms["reconstruction"] = self.config.reconstruction * (poses - x).abs().mean()
            if self.omega:
                terms["perceptual"] = self.config.perceptual * (self.omega[0](poses) - self.omega[0](x)).abs().mean()
        return terms

    # generation -----------------------------------------------------------------------------------------------------

    @torch.no_grad()
    def step(
        self, z: Tensor, history: Tensor, audio: Tensor, states: list[State] | None, style: Tensor | None = None
    ) -> tuple[Tensor, list[State]]:
        """One frame: latents (B, D), history (B, τ, D), speech (B, τ + 1 + l, A), states → pose (B, D), states.

        ``style`` is for networks that have style codes; the paper has none.
        """
        poses, states = self.flow.inverse(z[:, None], self.condition(history[:, None], audio[:, None]), states)
        return poses[:, 0], states

    @torch.no_grad()
    def sample(self, z: Tensor, history: Tensor, audio: Tensor, style: Tensor | None = None) -> Tensor:
        """Poses that follow a history, each fed back (equation 6).

        Args:
            z: (B, F, D) latents, drawn (`Latent.sample`) or those of an example.
            history: (B, τ, D).
            audio: (B, τ + F + l, A).
            style: see `step`.

        Returns:
            (B, F, D).
        """
        return play_window(partial(self.step, style=style), z, history, frame_windows(audio, self.speech_frames))

    # the runtime bundle ---------------------------------------------------------------------------------------------

    def runtime_sizes(self) -> dict[str, Any]:
        """The fields of `cospeech.runtime.flow.weights.FlowSizes`."""
        c = self.config
        return {
            "pose": self.pose, "audio": self.audio, "steps": c.steps, "hidden": c.hidden, "layers": c.layers,
            "history": c.history, "speech_frames": self.speech_frames, "cell": "gru", "nu": float(c.nu),
            "residual": False, "inertia": 0.0, "feature": c.feature if c.encoder else 0,
            "blocks": c.encoder_blocks if c.encoder else 0, "channels": c.encoder_channels if c.encoder else 0,
            "oldest": c.encoder_oldest, "encoder_relu": c.encoder and c.encoder_relu, "style": 0, "steps_seen": False,
            "latent_scale": 1.0,
        }  # fmt: skip

    def export(self) -> dict[str, Any]:
        """Arrays by name, as `cospeech.runtime.flow.graph` needs them."""
        return {name: np.asarray(value.detach().cpu().numpy()) for name, value in self.state_dict().items()}
