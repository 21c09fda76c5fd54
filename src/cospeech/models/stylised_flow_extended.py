"""The stylised flow, extended; all of this is ours. The paper is `cospeech.models.stylised_flow`, whose equations hold.

Our additions, each off by default. With them a network of a few hundred thousand weights learns in hundreds of steps what takes
thousands of steps without. All of them are linear in xₜ, so that the likelihood (5) stays exact:

    residual, inertia    the flow gives xₜ − bₜ, bₜ = xₜ₋₁ + inertia (xₜ₋₁ − xₜ₋₂): how the movement continues by inertia
    steps_seen           the couplings see a history as its last pose and the steps that led there
    style                c_t has a style code too, of a stretch of poses before the history:

         stretch (style_window) ──3 convolutions, mean and deviation over time──► code ──► c_t

    latent_scale         scale of random latents at play
    pose_noise           noise on the poses in training: a density of smooth data has no upper limit
    stroke_timing        ℓ_T = 1 − r of the logarithms of the speeds of self-play and of the recording
    style_recognition    ℓ_S = cross-entropy of a network that names speakers by their velocities: recorded, and self-play
    whole_history_norms  the batch norms of the encoder keep the statistics of histories without hidden poses

The effect of each on the motion: docs/models/stylised_flow.md, "Changed, and added".
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..errors import InputError
from .nn.conditioning import StyleEncoder, as_steps, blank_history, drop_history
from .nn.flow import State
from .nn.norm import without_tracking
from .nn.objective import Batch, Objective, StepRandom
from .nn.sampled import at_rest
from .nn.self_play import FAR, play_window
from .nn.speed_distance import timing_term
from .nn.style_recogniser import StyleRecogniser
from .stylised_flow import FlowConfig, StylisedFlow

__all__ = ["FlowExtendedConfig", "StylisedFlowExtended"]

SWAPPED = 0.5  # of the steps with self-play, with ``style_recognition``: its styles are those of other recordings of the batch


@dataclass(frozen=True)
class FlowExtendedConfig(FlowConfig):
    """The paper's settings, and ours."""

    pose_noise: float = 0.0
    """Deviation of noise on the standardised poses in training; [ours], for data so smooth that a density has no limit."""
    style: int = 0
    """Numbers of a style code that conditions every frame beside f_t; 0: none, as in the paper. [ours]: it encodes a longer
    stretch of the same recording, without labels. So an example sets the style, and the latents stay free."""
    style_window: int = 80
    """Frames of that stretch, which lies before the history; [ours]."""
    style_gap: int = 0
    """Frames between that stretch and the history; [ours]. Without a gap, the code tells what somebody does at this moment."""
    style_recognition: float = 0.0
    """Weight of the cross-entropy of a network that names the speaker of the velocities of self-play; [ours]. The likelihood
    hardly needs a style, because the last poses tell nearly all. So self-play must have the style of its code, in half of the
    steps that of another recording. This network and the encoder of styles learn first, from recordings and their speakers. In
    play there are no labels: the code of any motion is a style."""
    style_steps: int = 500
    """Steps in which they learn, before those of the flow; [ours]: after half a minute on one core, nothing more is learnt of
    recordings that are held out."""
    residual: bool = False
    """Whether the flow models xₜ − xₜ₋₁, which has the density of xₜ, in place of xₜ; [ours], quicker to learn."""
    inertia: float = 0.0
    """With ``residual``: share of the last step that is subtracted too, so that xₜ = xₜ₋₁ + inertia (xₜ₋₁ − xₜ₋₂) + …;
    [ours]."""
    steps_seen: bool = False
    """Whether the couplings see a history as its last pose and the steps that led there, not as poses; [ours]: a linear change
    of their input. ``history_dropout`` then hides all steps of a frame at once."""
    latent_scale: float = 1.0
    """Scale of the latents that a bundle draws at temperature 1; [ours], as images of Glow are sampled (Kingma & Dhariwal 2018,
    0.7). Training does not use it. Below 1 motion depends more on the speech and less on chance. Bundling measures the
    deviations of the poses that come out, and the runtime corrects them."""
    stroke_timing: float = 0.0
    """Weight of the distance in time between the strokes of the recording and those of self-play
    (``nn.speed_distance.timing_term``); [ours]. The likelihood sees recorded histories only: a network can be good at
    it, and in play still time its strokes by its own history, not by the speech."""
    stroke_timing_every: int = 4
    """Every how many steps there is self-play; [ours]: playing a window costs as much as the rest of a step."""
    whole_history_norms: bool = False
    """Whether the batch norms of the encoder keep the statistics of whole histories; [ours]. Without it, they keep those of
    histories with hidden poses (``history_dropout``), while every history is whole in play: the variance shift of Li et al.
    2019. It costs a forward pass of the encoder in each step. With ``steps_seen`` most histories are whole in training too, so
    that the shift is smaller; nobody has measured it."""


class StylisedFlowExtended(StylisedFlow):
    """The stylised flow with our additions: steps in place of poses, and style codes.

    Args:
        config: sizes and weights.
        pose, audio, omega: as in `StylisedFlow`.
        speakers: of the store; only ``style_recognition`` needs them.
    """

    Config = FlowExtendedConfig
    config: FlowExtendedConfig

    def __init__(
        self, config: FlowExtendedConfig, *, pose: int, audio: int, speakers: int = 0, omega: nn.Module | None = None
    ) -> None:
        if config.inertia and (config.history < 2 or not config.residual or not 0 < config.inertia <= 1):
            raise InputError(f"inertia {config.inertia}", "0 … 1, with residual and a history of 2 poses at least")
        if config.whole_history_norms and config.steps_seen:
            raise InputError("whole_history_norms with steps_seen", "use one of the two")
        weight = config.style_recognition
        if config.style_gap < 0 or weight < 0 or (weight and not (config.style and speakers)):
            problem = f"style_recognition {weight} and style_gap {config.style_gap} with a style of {config.style}"
            raise InputError(problem, "neither is negative, and the first needs style codes and speakers")
        super().__init__(config, pose=pose, audio=audio, omega=omega)
        self.recogniser = StyleRecogniser(pose, channels=config.hidden, speakers=speakers) if weight else None
        self.speaker_of_code = nn.Linear(config.style, speakers) if weight else None

    @classmethod
    def dimensions_for(cls, config: Any) -> tuple[str, ...]:
        return (*cls.dimensions, "speakers") if config.style_recognition else cls.dimensions

    def _add_encoders(self) -> int:
        c = self.config
        self.stylist = StyleEncoder(self.pose, channels=c.encoder_channels, style=c.style) if c.style else None
        self.styles, self.encodes_style, self.smallest_batch = c.style, c.style > 0, 2 if c.style else 1
        return c.style

    @property
    def window(self) -> int:
        """Frames of a training window: stretch for the style, gap, history, trained frames, look-ahead."""
        return self.style_frames + super().window

    @property
    def style_frames(self) -> int:
        """Frames before the history: the stretch that the style is taken from, and the gap."""
        return self.config.style_window + self.config.style_gap if self.config.style else 0

    def _stretch(self, pose: Tensor) -> Tensor:
        """The stretch of a window that the style is taken from."""
        return pose[:, : self.config.style_window * self.encodes_style]

    # the density ----------------------------------------------------------------------------------------------------

    def style(self, poses: Tensor) -> Tensor | None:
        """(B, S, D) any stretch of poses → (B, style) its code; None for a model without."""
        return None if self.stylist is None else self.stylist(poses)

    def condition(self, poses: Tensor, audio: Tensor, style: Tensor | None = None) -> Tensor:
        """c_t, with the style code (B, style) of the whole stretch, for a model that has one."""
        parts = [super().condition(poses, audio)]
        if self.config.steps_seen:
            parts = [as_steps(poses).flatten(2), parts[0][..., poses.shape[2] * self.pose :]]
        if style is not None:
            parts.append(style.unsqueeze(1).expand(-1, poses.shape[1], -1))
        return torch.cat(parts, -1)

    def _windows(self, pose: Tensor, audio: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        return super()._windows(pose[:, self.style_frames :], audio[:, self.style_frames :])

    def log_prob(self, pose: Tensor, audio: Tensor) -> Tensor:
        """As in the paper, of (B, S + τ + F + l, D) poses and as much speech; the first S are the stretch for the style."""
        x, c = self._condition_poses(pose, audio)
        return self.flow.log_prob(x, c)

    def latents(self, pose: Tensor, audio: Tensor) -> Tensor:
        """(B, F, D): the z of each frame after the history; arguments as in `log_prob`."""
        return self.flow(*self._condition_poses(pose, audio))[0]

    def _condition_poses(self, pose: Tensor, audio: Tensor) -> tuple[Tensor, Tensor]:
        """(B, F, D) targets of the flow for recorded poses, and (B, F, C) their conditioning."""
        x, histories, speech = self._windows(pose, audio)
        return x - self._base(histories), self.condition(histories, speech, self.style(self._stretch(pose)))

    def _base(self, histories: Tensor) -> Tensor:
        """(B, F, D) that are added to the flow's output: the last pose of each history and its inertia; or zeros."""
        if not self.config.residual:
            return torch.zeros_like(histories[:, :, -1])
        last = histories[:, :, -1]
        return last + self.config.inertia * (last - histories[:, :, -2]) if self.config.inertia else last

    # what is optimised ----------------------------------------------------------------------------------------------

    @property
    def preliminary_steps(self) -> int:
        """Those in which styles are learnt."""
        return self.config.style_steps if self.recogniser is not None else 0

    def objectives(self) -> dict[str, Objective]:
        """Equation 11 with what is added to it. With ``style_recognition``, the networks of styles come first, and stay."""
        if self.recogniser is None:
            return super().objectives()
        first, steps = ("recogniser.", "stylist.", "speaker_of_code."), self.config.style_steps
        styles = [value for name, value in self.named_parameters() if name.startswith(first)]
        others = [value for name, value in self.named_parameters() if not name.startswith(first)]
        return {"style": Objective(styles, self.style_loss, stop=steps), "flow": Objective(others, self.loss, start=steps)}

    def style_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Cross-entropies of two networks that name the speaker: by a style code, and by velocities."""
        assert self.recogniser is not None
        assert self.speaker_of_code is not None
        pose, speaker = batch["pose"], batch["speaker"]
        motion, code = self._windows(pose, batch["audio"])[0], self.style(self._stretch(pose))
        return {
            "code": F.cross_entropy(self.speaker_of_code(code), speaker),
            "motion": F.cross_entropy(self.recogniser(motion), speaker),
        }

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """The terms of equation 11, weighted."""
        pose = batch["pose"]
        if self.training and self.config.pose_noise:
            pose = pose + self.config.pose_noise * batch.chance.normal(*pose.shape)
        x, histories, speech = self._windows(pose, batch["audio"])
        base, whole_histories = self._base(histories), histories
        if self.training:
            drop = blank_history if self.config.steps_seen else drop_history
            histories = drop(histories, self.config.history_dropout, batch.chance)
        with at_rest(self.stylist) if self.recogniser is not None and self.stylist is not None else nullcontext():
            style = self.style(self._stretch(pose))
        with self._norms_of(whole_histories, speech):
            conditioning = self.condition(histories, speech, style)
        terms = self.losses(x, conditioning, batch.chance, step, base)
        if (self.config.stroke_timing or self.recogniser) and step % self.config.stroke_timing_every == 0:
            turn = self.training and self.recogniser is not None and batch.chance.uniform(1).item() < SWAPPED
            style = style.roll(1, 0) if style is not None and turn else style
            motion = self._play_window(pose, speech, style, batch.chance)
            terms |= timing_term(self.config.stroke_timing, motion.mT, x.mT)
            if self.recogniser is not None:
                speaker = batch["speaker"].roll(int(turn), 0)
                terms["style_self_play"] = self.config.style_recognition * self.recogniser.of_self_play(motion, speaker)
        return terms

    @contextmanager
    def _norms_of(self, histories: Tensor, speech: Tensor) -> Iterator[None]:
        """Let the batch norms of the encoder keep statistics of these histories, and within it of no others."""
        encoder = self.encoder if self.training and self.config.whole_history_norms else None
        if encoder is None:
            yield
            return
        with torch.no_grad():
            encoder(histories, speech)
        torch.clear_autocast_cache()  # before PyTorch 2.11, it kept these weights without gradients for the pass that learns
        with without_tracking(encoder):
            yield

    def _play_window(self, pose: Tensor, speech: Tensor, style: Tensor | None, chance: StepRandom) -> Tensor:
        """(B, F, D): the trained frames, played from their recorded history with random latents; each pose is fed back."""
        first = self.style_frames
        latents = self.flow.latent.sample(chance.normal, len(pose), speech.shape[1])
        encoder = self.encoder if self.training else None  # batch norms must not take statistics of single frames
        if encoder is not None:
            encoder.eval()
        step = partial(self._make_frame, style=style)
        motion = play_window(step, latents, pose[:, first : first + self.config.history], speech, FAR)
        if encoder is not None:
            encoder.train()
        return motion

    # generation -----------------------------------------------------------------------------------------------------

    @torch.no_grad()
    def style_of(self, poses: Tensor) -> Tensor:
        """(B, T, D) poses → (B, style) their code."""
        return super().style_of(poses) if self.stylist is None else self.stylist(poses)

    @torch.no_grad()
    def speaker_styles(self, stretches: Tensor) -> Tensor:
        """The mean code of each speaker's stretches, (S, n, T, D) → (S, style)."""
        return self.style_of(stretches.flatten(0, 1)).view(*stretches.shape[:2], -1).mean(1)

    @torch.no_grad()
    def step(
        self, z: Tensor, history: Tensor, audio: Tensor, states: list[State] | None, style: Tensor | None = None
    ) -> tuple[Tensor, list[State]]:
        """One frame, as in the paper; ``style``: (B, style)."""
        return self._make_frame(z, history, audio, states, style)

    def _make_frame(
        self, z: Tensor, history: Tensor, audio: Tensor, states: list[State] | None, style: Tensor | None = None
    ) -> tuple[Tensor, list[State]]:
        poses, states = self.flow.inverse(z[:, None], self.condition(history[:, None], audio[:, None], style), states)
        return poses[:, 0] + self._base(history[:, None])[:, 0], states

    # the runtime bundle ---------------------------------------------------------------------------------------------

    def runtime_sizes(self) -> dict[str, Any]:
        """The fields of `cospeech.runtime.flow.weights.FlowSizes`."""
        c = self.config
        own = {
            "residual": c.residual, "inertia": c.inertia, "style": c.style, "steps_seen": c.steps_seen,
            "latent_scale": c.latent_scale,
        }  # fmt: skip
        return super().runtime_sizes() | own | {"channels": c.encoder_channels if c.encoder or c.style else 0}
