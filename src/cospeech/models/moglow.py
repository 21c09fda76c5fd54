"""MoGlow: Henter, Alexanderson and Beskow 2020, "MoGlow: Probabilistic and Controllable Motion Synthesis Using Normalising
Flows", as Alexanderson et al. 2020, "Style-Controllable Speech-Driven Gesture Synthesis Using Normalising Flows", use it.

A normalising flow gives the exact density of the next pose, given the poses before it, the speech around it and style controls:

    p(x | a, s) = ∏ₜ p(xₜ | xₜ₋τ…ₜ₋₁, aₜ₋τ…ₜ₊ₗ, sₜ₋τ…ₜ₊ₗ, hₜ₋₁)      h: states of the LSTMs
    ln p(xₜ | …) = ln p_Z(zₜ) + Σₖ ln |det ∂hₖ/∂hₖ₋₁|,  z = f(x), p_Z normal

         poses t−τ … t−1 ───────────────┐
         speech t−τ … t+l ──────────────┼─► c_t
         controls (hand height, …) ─────┘    │      each pose is blanked with probability 0.4: data dropout
                                             ▼
      x_t ─►[ ActNorm ─ 1×1 convolution ─ affine coupling(LSTM(x₁, c_t)) ] × K ─► z_t

Objective: the negative log-likelihood, L = −(1/T) Σₜ ln p(xₜ | …). ``stroke_timing`` adds a term of ours.

Followed, changed, not said in the papers: docs/models/moglow.md, by number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from ..errors import InputError, nearest
from ..motion.poses.controls import CONTROLS
from .nn.conditioning import drop_history, frame_windows
from .nn.configuration import SMALL_FLOW, ModelConfig
from .nn.flow import Flow, RecurrentNet, State
from .nn.objective import Batch, Objective
from .nn.self_play import FAR, play_window
from .nn.settings import check_least
from .nn.speed_distance import timing_term
from .nn.trainable import Trainable

__all__ = ["MoGlow", "MoGlowConfig"]


@dataclass(frozen=True)
class MoGlowConfig(ModelConfig):
    """Sizes; the defaults are those of the paper on gestures, in its version of the authors' configuration."""

    TINY: ClassVar[Mapping[str, Any]] = {"steps": 2, "hidden": 16}
    SMALL: ClassVar[Mapping[str, Any]] = {"steps": 4, "hidden": 64, "frames": 30, "residual": True, "pose_noise": 0.005}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_FLOW

    steps: int = 16
    """K; authors' configuration, paper version 16."""
    hidden: int = 800
    """Units of an LSTM layer; paper version 800, the authors prefer 512 since."""
    layers: int = 2
    """LSTM layers of a coupling; authors' configuration 2."""
    history: int = 5
    """τ, poses that condition a frame; authors' configuration 5."""
    look_ahead: int = 20
    """l, frames of speech after the generated frame; authors' configuration 20."""
    frames: int = 95
    """Frames trained in a window, after the history; authors' configuration: 6 s in all, at 20 frames per second."""
    nu: int = 0
    """Degrees of freedom of a Student's t latent; 0: a normal one, as in the paper. The authors' code offers 50."""
    history_dropout: float = 0.4
    """Probability that a pose of the history is blanked; authors' configuration 0.4."""
    controls: tuple[str, ...] = ()
    """Style controls by name (`cospeech.motion.poses.controls.CONTROLS`); the paper trains one system for each."""
    nll_unit: float = 1.0
    """Nats of the unit of the loss; the authors' code has bits (0.6931)."""
    pose_noise: float = 0.0
    """Deviation of noise on the standardised poses in training; ours, for data so smooth that a density has no limit."""
    residual: bool = False
    """Whether the flow models xₜ − xₜ₋₁, which has the density of xₜ, in place of xₜ; ours: small networks learn it sooner."""
    latent_scale: float = 1.0
    """Scale of random latents at play; ours, as in `cospeech.models.stylised_flow_extended.FlowExtendedConfig`."""
    stroke_timing: float = 0.0
    """Weight of the distance in time between recorded strokes and those of self-play; ours, as there."""
    stroke_timing_every: int = 4
    """Every how many steps there is that term; ours, as there."""

    def __post_init__(self) -> None:
        sizes = dict.fromkeys(("steps", "hidden", "layers", "history", "frames", "stroke_timing_every"), 1)
        check_least(self, "a MoGlow", sizes | dict.fromkeys(("look_ahead", "latent_scale", "stroke_timing"), 0))


class MoGlow(Trainable):
    """MoGlow (Henter et al. 2020): many motions for one speech, with controls for height, speed and reach of the hands.

    Poses, audio and controls are standardised vectors.

    Args:
        config: sizes.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech.
    """

    Config = MoGlowConfig
    config: MoGlowConfig

    def __init__(self, config: MoGlowConfig, *, pose: int, audio: int) -> None:
        super().__init__()
        unknown = [name for name in config.controls if name not in CONTROLS]
        if unknown or len({*config.controls}) < len(config.controls):
            raise InputError(
                f"style controls {', '.join(config.controls)}", nearest((unknown or ["twice the same"])[0], CONTROLS)
            )
        self.config, self.pose, self.audio = config, pose, audio
        self.arrays, self.controls = self.arrays_for(config), config.controls
        context = config.history * pose + self.speech_frames * (audio + len(config.controls))
        self.flow = Flow(pose, context, config.steps, self._net, float(config.nu or "inf"))

    @classmethod
    def arrays_for(cls, config: MoGlowConfig) -> tuple[str, ...]:
        """With the controls, where there are some."""
        return (*cls.arrays, "control") if config.controls else cls.arrays

    def _net(self, inputs: int, outputs: int) -> RecurrentNet:
        return RecurrentNet(nn.LSTM, inputs, self.config.hidden, outputs, self.config.layers)

    @property
    def speech_frames(self) -> int:
        """Frames of speech that condition a frame: τ + 1 + l."""
        return self.config.history + 1 + self.config.look_ahead

    @property
    def window(self) -> int:
        """Frames of a training window: history, trained frames, look-ahead."""
        return self.config.history + self.config.frames + self.config.look_ahead

    # the density ----------------------------------------------------------------------------------------------------

    def hear(self, audio: Tensor, control: Tensor | None = None) -> Tensor:
        """Speech and the controls of the configuration: (B, T, A), (B, T, 3) → (B, T, A + controls).

        Raises:
            InputError: the system has controls, and none are given.
        """
        if not self.config.controls:
            return audio
        if control is None:
            raise InputError("no style controls for a MoGlow that has them", ", ".join(self.config.controls))
        return torch.cat([audio, control[..., [CONTROLS.index(name) for name in self.config.controls]]], -1)

    def condition(self, poses: Tensor, speech: Tensor) -> Tensor:
        """c_t.

        Args:
            poses: (B, F, τ, D), oldest first.
            speech: (B, F, τ + 1 + l, A + controls), see `hear`.

        Returns:
            (B, F, C).
        """
        return torch.cat([poses.flatten(2), speech.flatten(2)], -1)

    def _windows(self, pose: Tensor, speech: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Trained poses (B, F, D), their histories (B, F, τ, D) and the speech (B, F, τ + 1 + l, A + controls)."""
        tau, frames = self.config.history, pose.shape[1] - self.config.history - self.config.look_ahead
        if frames < 1 or speech.shape[1] != pose.shape[1]:
            raise InputError(f"{pose.shape[1]} poses and {speech.shape[1]} frames of speech", f"both {self.window}")
        x = pose[:, tau : tau + frames]
        return x, frame_windows(pose[:, : tau + frames - 1], tau), frame_windows(speech, self.speech_frames)

    def _base(self, histories: Tensor) -> Tensor:
        """(B, F, D) that are added to the flow's output: the last pose of each history, or zeros."""
        return histories[:, :, -1] if self.config.residual else torch.zeros_like(histories[:, :, -1])

    def log_prob(self, pose: Tensor, audio: Tensor, control: Tensor | None = None) -> Tensor:
        """Exact log-likelihood of each frame after the history.

        Args:
            pose: (B, τ + F + l, D); the first τ are given, the last l are not used.
            audio: (B, τ + F + l, A).
            control: (B, τ + F + l, 3), where the system has controls.

        Returns:
            (B, F) nats, of standardised poses.
        """
        x, histories, speech = self._windows(pose, self.hear(audio, control))
        return self.flow.log_prob(x - self._base(histories), self.condition(histories, speech))

    def latents(self, pose: Tensor, audio: Tensor, control: Tensor | None = None) -> Tensor:
        """(B, F, D): the z of each frame after the history; arguments as in `log_prob`."""
        x, histories, speech = self._windows(pose, self.hear(audio, control))
        return self.flow(x - self._base(histories), self.condition(histories, speech))[0]

    # what is optimised ----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """One: the likelihood."""
        return {"flow": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """The negative log-likelihood of a frame, and ``stroke_timing``."""
        pose = batch.arrays["pose"]
        if self.training and self.config.pose_noise:
            pose = pose + self.config.pose_noise * batch.chance.normal(*pose.shape)
        x, histories, speech = self._windows(pose, self.hear(batch.arrays["audio"], batch.arrays.get("control")))
        base, first = self._base(histories), histories[:, 0]
        if self.training:
            histories = drop_history(histories, self.config.history_dropout, batch.chance)
        log_prob = self.flow.log_prob(x - base, self.condition(histories, speech))
        terms = {"nll": -log_prob.mean() / self.config.nll_unit}
        if self.config.stroke_timing and step % self.config.stroke_timing_every == 0:
            latents = self.flow.latent.sample(batch.chance.normal, len(x), speech.shape[1])
            motion = play_window(self._make_frame, latents, first, speech, FAR)
            terms |= timing_term(self.config.stroke_timing, motion.mT, x.mT)
        return terms

    # generation -----------------------------------------------------------------------------------------------------

    @torch.no_grad()
    def step(self, z: Tensor, history: Tensor, speech: Tensor, states: list[State] | None) -> tuple[Tensor, list[State]]:
        """One frame: latents (B, D), history (B, τ, D), speech (B, τ + 1 + l, A + controls), states → pose, states."""
        return self._make_frame(z, history, speech, states)

    def _make_frame(self, z: Tensor, history: Tensor, speech: Tensor, states: list[State] | None) -> tuple[Tensor, list[State]]:
        poses, states = self.flow.inverse(z[:, None], self.condition(history[:, None], speech[:, None]), states)
        return poses[:, 0] + self._base(history[:, None])[:, 0], states

    @torch.no_grad()
    def sample(self, z: Tensor, history: Tensor, audio: Tensor, control: Tensor | None = None) -> Tensor:
        """Poses that follow a history, each fed back.

        Args:
            z: (B, F, D) latents (`Latent.sample`); N(0, 1) where the latent is normal.
            history: (B, τ, D); zeros, the mean pose, begin a performance.
            audio: (B, τ + F + l, A).
            control: (B, τ + F + l, 3), constant for a style (`cospeech.motion.poses.controls.control_row`).

        Returns:
            (B, F, D).
        """
        return play_window(self.step, z, history, frame_windows(self.hear(audio, control), self.speech_frames))

    # the runtime bundle ---------------------------------------------------------------------------------------------

    def runtime_sizes(self) -> dict[str, Any]:
        """The fields of `cospeech.runtime.flow.weights.FlowSizes`."""
        c = self.config
        return {
            "pose": self.pose, "audio": self.audio + len(c.controls), "steps": c.steps, "hidden": c.hidden, "layers": c.layers,
            "history": c.history, "speech_frames": self.speech_frames, "cell": "lstm", "nu": float(c.nu),
            "residual": c.residual, "latent_scale": c.latent_scale,
        }  # fmt: skip

    def export(self) -> dict[str, Any]:
        """Arrays by name, as `cospeech.runtime.flow.graph` needs them: controls are further numbers of a frame of speech."""
        return {name: np.asarray(value.detach().cpu().numpy()) for name, value in self.state_dict().items()}
