"""Mix-StAGE: Ahuja et al. 2020, "Style Transfer for Co-Speech Gesture Animation: A Multi-Speaker Conditional-Mixture Approach".

One network for many speakers: content and style are encoded separately, so any voice may be combined with any style.

      speech ── Eᶜₐ ──┐                      ┌─► H ── softmax ──► Φ (M)
                      ├─► U-Net ──► Z ───────┤                    │
      poses ─── Eᶜₚ ──┘       ▲              └─► G₁ … G_M ──────► Σ φₘ Gₘ(Z) ──► Ŷ ──► velocity ──► D
                              │ Z = [U-Net(content), S(i)]
      poses ─── Eˢₚ ── argmax i ── style matrix S

That is the authors' code and the default. With ``style_first``, the paper's words: Z = U-Net([content, S(i)]).

The priors Φ are one-hot in training: the k-means cluster of a frame's pose ⊕ velocity ⊕ speed (240 numbers, `mode_features` and
`nearest_centre` of `cospeech.metrics.mode_f1`). H estimates them for generation. With Zₐ of speech and Zₚ of poses:

    L_mix   = CCE(Φ, H(Z)), the mean over Zₐ and Zₚ                             (3)
    L_joint = |Yₚ − G(Zₚ)|₁                                                     (4)
    L_rec   = |Yₚ − G(Zₐ)|₁                                                     (5)
    L_id    = CCE(Eˢₚ(Yₚ), ID) + CCE(Eˢₚ(Ŷ), ID),  Ŷ = G(Zₐ)                     (6)
    L_adv   = log D(Yₚ) + log(1 − D(G(Zₐ)))                                     (7)
    max over D, min over all others:  L_mix + L_joint + L_rec + λ L_id + L_adv  (8)

Parameters that the gradient of each reaches (of G the sub-generator of a frame's cluster; the argmax passes none to Eˢₚ):

    L_mix    Eᶜₐ  Eᶜₚ  U-Net  S  H          L_id   Eˢₚ of both terms; Eᶜₐ  U-Net  S  G  of the second
    L_joint       Eᶜₚ  U-Net  S     G       L_adv  Eᶜₐ  U-Net  S  G;  in the discriminator's turn D alone
    L_rec    Eᶜₐ       U-Net  S     G

In the authors' reading (``soft``: Φ is H's in training too) L_joint, L_rec, L_id and L_adv reach H and every sub-generator;
with ``id_freezes`` the second term of L_id does not reach Eˢₚ; with a ``curriculum`` one L1 term stands for (4) and (5).

Followed: equations 2–8. Changed: the authors toss a coin for each batch, whether D or G has its turn; here they take
turns (``alternate``). They toss one for each batch, which content is decoded; here one for each row, so that many processes
train as one would.
Not said: all sizes (the authors' code's); that Ŷ of (6) is of speech; which poses are clustered (authors'
code: those of all training data).
M = 1 is StAGE (`cospeech.models.stage`); it has no H, as there is only one class. Without Eˢₚ, S and L_id it is CMix-GAN, for
one speaker (`cospeech.models.cmix_gan`). This file is the paper, in its reading and in that of the authors'
code; what we add to it is in `cospeech.models.mix_stage_extended`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..errors import InputError, nearest
from .nn.adversarial_losses import ADVERSARIAL_LOSSES
from .nn.configuration import SMALL_CONVOLUTIONS, ModelConfig
from .nn.content import STYLE_FRAMES, AudioContent, PoseContent
from .nn.mixture import ModeLogits, SubGenerators, mix, one_hot_priors
from .nn.norm import without_tracking
from .nn.objective import Batch, Objective
from .nn.patch import PatchDiscriminator, velocity
from .nn.settings import check_least
from .nn.style import NoStyle, SpeakerStyle, StyleReading
from .nn.unet1d import UNet1d
from .nn.windowed import Windowed

__all__ = ["MixGan", "MixGanConfig", "MixStage", "MixStageConfig"]

GROWTH_EVERY, GROWTH_LIMIT = 301, 2.0  # steps between two steps of ``growth``, and where it ends; authors' code
HALVINGS = 3  # of AudioContent, which the U-Net's multiple of frames has to cover


@dataclass(frozen=True)
class MixGanConfig(ModelConfig):
    """Sizes and weights without those of style; the defaults are the paper's, or, where it is silent, the authors' code's."""

    TINY: ClassVar[Mapping[str, Any]] = {"modes": 4, "channels": 8}
    SMALL: ClassVar[Mapping[str, Any]] = {"channels": 16, "patch_channels": 16}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_CONVOLUTIONS

    frames: int = 64
    """T of a training window; not stated in the text, authors' code 64 (4.3 s at 15 frames per second)."""
    modes: int = 8
    """M, sub-generators; section 6.1: little is gained beyond 8. 1: StAGE."""
    channels: int = 256
    """Of content, U-Net and each sub-generator; not stated, authors' code 256."""
    depth: int = 5
    """Halvings of the U-Net; not stated, authors' code 5."""
    patch_channels: int = 64
    """Of the discriminator's first convolution; not stated, authors' code 64."""
    adversarial: float = 1.0
    """Weight of L_adv; equation 8."""
    soft: bool = False
    """Whether Φ is H's estimate in training too, as in the authors' code; else one-hot, section 4.1."""
    curriculum: int = 0
    """Steps over which the decoded content changes from pose to speech; 0: both are always decoded. Authors' code 1000."""
    adversarial_loss: str = "logarithm"
    """Loss of D's scores, one of models/nn/adversarial_losses.py: logarithm, equation 7; distance, the authors' code;
    squares, which is [ours]."""
    growth: float = 0.0
    """Increase of the weight of generated poses in L_adv every 301 steps, up to 2; authors' code 0.1. Equation 7: 0."""
    alternate: bool = False
    """Whether discriminator and generator take turns, a step each; authors' code tosses a coin for it."""


@dataclass(frozen=True)
class MixStageConfig(MixGanConfig):
    """The same, and settings of style."""

    TINY: ClassVar[Mapping[str, Any]] = {**MixGanConfig.TINY, "style": 4}

    style: int = 10
    """D, length of a style embedding; not stated, authors' code 10."""
    style_first: bool = False
    """Whether the style joins the content before the U-Net, as sections 4 and 4.5 have it; else after it, as in the authors'
    code."""
    identity: float = 0.1
    """λ_id; supplement."""
    id_freezes: bool = False
    """Whether the style encoder is frozen for generated poses, as in the authors' code; equation 8: it is not."""


class _Decoding(NamedTuple):
    """The forward pass of a batch in a step: generated poses, and intermediate results."""

    key: tuple[Batch, int, bool, bool]
    """Batch, step, whether in training, whether with gradients."""
    own: StyleReading
    """Of the recorded poses."""
    pose_content: Tensor | None
    """Content of the recorded poses, which is decoded too, for L_joint."""
    logits: Tensor
    poses: Tensor
    """Ŷ of L_rec."""
    adversarial_poses: Tensor
    """Ŷ of L_adv and L_id; in the paper the same."""


class MixGan(Windowed):
    """Equations 2–8, with any part for the style.

    Poses and audio are standardised vectors.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose; 96 as published.
        audio: A, numbers of a frame of speech; 64 bands as published.
        style: Eˢₚ and S, or no style.
        identity: λ_id.
        style_first: whether the style joins the content before the U-Net.

    Raises:
        InputError: sizes that do not fit each other.
    """

    arrays = ("pose", "audio", "cluster")
    """``cluster``: (B, T) whole numbers 0 … M − 1, each frame's nearest centre."""
    dimensions = ("pose", "audio", "speakers")
    config: MixGanConfig

    def __init__(
        self,
        config: MixGanConfig,
        *,
        pose: int,
        audio: int,
        style: SpeakerStyle | NoStyle,
        identity: float = 0.0,
        style_first: bool = False,
    ) -> None:
        super().__init__()
        sizes = dict.fromkeys(("modes", "channels", "patch_channels", "pose", "audio"), 1)
        check_least(vars(config) | {"pose": pose, "audio": audio}, f"a {type(self).__name__}", sizes | {"depth": HALVINGS})
        if config.frames < STYLE_FRAMES or config.frames % 2**config.depth:
            hint = f"{STYLE_FRAMES} at least, and a multiple of {2**config.depth}"
            raise InputError(f"windows of {config.frames} frames", hint)
        if config.adversarial_loss not in ADVERSARIAL_LOSSES:
            raise InputError(
                f"scores judged by {config.adversarial_loss!r}", nearest(config.adversarial_loss, ADVERSARIAL_LOSSES)
            )
        self.config, self.pose, self.audio, self.identity = config, pose, audio, identity
        self.multiple = self.shortest = 2**config.depth
        self.styles, self.modes = style.speakers, config.modes if config.modes > 1 else 0
        self.style_first, z = style_first, config.channels + style.width * (not style_first)
        self.audio_content = AudioContent(config.channels)
        self.pose_content = PoseContent(pose, config.channels)
        self.style = style
        self.unet = UNet1d(config.channels, config.depth, style.width * style_first)
        self.generators = SubGenerators(z, config.channels, pose, config.modes)
        self.mode_logits = ModeLogits(z, config.channels, config.modes) if config.modes > 1 else None
        self.discriminator = self._make_discriminator()
        self._shared_forward: _Decoding | None = None

    def _make_discriminator(self) -> nn.Module:
        """D."""
        return PatchDiscriminator(self.pose, self.config.patch_channels)

    # the parts of equation 2 ----------------------------------------------------------------------------------------

    def latent(self, content: Tensor, weights: Tensor) -> Tensor:
        """Z = [U-Net(content), weights · S]: (B, channels, T), (B, T or 1, S) of the speakers → (B, channels + style, T).

        With ``style_first`` Z = U-Net([content, weights · S]): (B, channels, T).
        """
        style = self.style(weights).expand(-1, -1, content.shape[-1])
        if self.style_first:
            z: Tensor = self.unet(torch.cat([content, style], 1))
            return z
        return torch.cat([self.unet(content), style], 1)

    def _logits(self, z: Tensor) -> Tensor:
        """Logits of H, whose softmax estimates Φ: (B, ·, T) → (B, M, T)."""
        if self.mode_logits is None:
            return z.new_zeros(z.shape[0], 1, z.shape[-1])
        logits: Tensor = self.mode_logits(z)
        return logits

    def _priors(self, logits: Tensor, cluster: Tensor) -> Tensor:
        """Φ (B, M, T): one-hot in training, section 4.1, those of H otherwise."""
        one_hot = self.training and not self.config.soft
        return one_hot_priors(cluster, self.config.modes).to(logits) if one_hot else torch.softmax(logits, 1)

    # what is optimised ----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """Two, in this order: max over D and min over all others of equation 8."""
        discriminator = [value for name, value in self.named_parameters() if name.startswith("discriminator.")]
        others = [value for name, value in self.named_parameters() if not name.startswith("discriminator.")]
        every = 2 if self.config.alternate else 1
        return {
            "discriminator": Objective(discriminator, self.discriminator_loss, every),
            "generator": Objective(others, self.generator_loss, every, start=every - 1),
        }

    def _growing(self, step: int) -> float:
        """Weight of generated poses in L_adv; constant in the paper."""
        return min(GROWTH_LIMIT, 1 + self.config.growth * (step // GROWTH_EVERY)) if self.config.growth else 1.0

    def _decode_batch(self, batch: Batch, step: int) -> _Decoding:
        """The forward pass of a step. The turn of D keeps it for the turn of G, as D changes none of its parameters."""
        key = (batch, step, self.training, torch.is_grad_enabled())
        if self._shared_forward is not None and self._shared_forward.key == key:
            return self._shared_forward
        own = self.style.see(batch["pose"].mT)
        content, pose_content = self._encode_contents(batch, step)
        z = self.latent(content, own.weights)
        logits = self._logits(z)
        outputs = self.generators(z)
        poses = mix(outputs, self._priors(logits, batch["cluster"]))
        return _Decoding(key, own, pose_content, logits, poses, self._draw_poses(batch, outputs, logits, poses))

    def _draw_poses(self, batch: Batch, outputs: Tensor, logits: Tensor, poses: Tensor) -> Tensor:
        """Ŷ (B, D, T) of L_adv and L_id, from the sub-generators' outputs (B, M, D, T), H's logits (B, M, T), Ŷ of L_rec."""
        return poses

    def _score(self, pose: Tensor, batch: Batch) -> Tensor:
        """D's scores of (B, D, T) poses."""
        scores: Tensor = self.discriminator(velocity(pose))
        return scores

    def discriminator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """−L_adv of equation 7, for D, or another loss in its place."""
        self._shared_forward = None
        with torch.set_grad_enabled(torch.is_grad_enabled() and not self.config.alternate):
            decoding = self._decode_batch(batch, step)
        self._shared_forward = None if self.config.alternate else decoding
        true, false = (self._score(x, batch) for x in (batch["pose"].mT, decoding.adversarial_poses.detach()))
        losses = ADVERSARIAL_LOSSES[self.config.adversarial_loss]
        return {"true": losses.true(true), "false": self._growing(step) * losses.false(false)}

    def _encode_contents(self, batch: Batch, step: int) -> tuple[Tensor, Tensor | None]:
        """Contents (B, channels, T) to decode: that of speech, for L_rec, L_id and L_adv; and that of poses, for L_joint.

        With a curriculum there is only one: of poses at first, and with each step of speech in more rows.
        """
        audio_content = self.audio_content(batch["audio"])
        if not self.config.curriculum:
            return audio_content, self.pose_content(batch["pose"].transpose(1, 2))
        if not self.training or step >= self.config.curriculum:
            return audio_content, None
        pose_content = self.pose_content(batch["pose"].transpose(1, 2))
        is_speech = batch.chance.uniform(len(batch), 1, 1) < step / self.config.curriculum
        return torch.where(is_speech, audio_content, pose_content), None

    def generator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """The terms of equation 8, weighted, for all but D.

        The batch norms keep statistics of what plays: of the content of speech (during a curriculum, of all that is decoded),
        and in the style encoder of recorded poses.
        """
        pose, cluster = batch["pose"].mT, batch["cluster"]
        decoding, self._shared_forward = self._decode_batch(batch, step), None
        poses, mixes = decoding.poses, [F.cross_entropy(decoding.logits, cluster)]
        terms = {"rec": (pose - poses).abs().mean()}  # equation 5
        if decoding.pose_content is not None:
            with without_tracking(self):
                z = self.latent(decoding.pose_content, decoding.own.weights)
                logits = self._logits(z)
                again = mix(self.generators(z), self._priors(logits, cluster))
            terms["joint"] = (pose - again).abs().mean()  # equation 4
            mixes.append(F.cross_entropy(logits, cluster))
        if self.mode_logits is not None:
            terms["mix"] = torch.stack(mixes).mean()  # equation 3
        with without_tracking(self.style):
            identity = self.style.identity(decoding.own, decoding.adversarial_poses, batch["speaker"])
        terms |= {name: self.identity * term for name, term in identity.items()}  # equation 6
        generator_loss = ADVERSARIAL_LOSSES[self.config.adversarial_loss].generator_loss(
            self._score(decoding.adversarial_poses, batch)
        )  # equation 7: log(1 − D)
        terms["adv"] = self.config.adversarial * self._growing(step) * generator_loss
        return terms

    # generation -----------------------------------------------------------------------------------------------------

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor) -> Tensor:
        """Equation 2 with the priors of H: (B, T, A), (B, T, S) of the speakers, (B, T, M; M = 1: 0) → (B, T, D)."""
        z = self.latent(self.audio_content(audio), style)
        if self.mode_logits is None:
            return self.generators(z)[:, 0].mT
        logits = self._logits(z)
        return mix(self.generators(z), torch.softmax(logits + mode_noise.mT if self.modes else logits, 1)).mT


class MixStage(MixGan):
    """Mix-StAGE (Ahuja et al. 2020): one motion for one speech, in the style of a speaker or of a mixture of them.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose; 96 as published.
        audio: A, numbers of a frame of speech; 64 bands as published.
        speakers: S, rows of the style matrix.
    """

    Config = MixStageConfig
    encodes_style = True
    style: SpeakerStyle

    def __init__(self, config: MixStageConfig, *, pose: int, audio: int, speakers: int) -> None:
        sizes = dict.fromkeys(("pose", "channels", "style", "speakers"), 1)
        check_least(vars(config) | {"pose": pose, "speakers": speakers}, f"a {type(self).__name__}", sizes)
        style = SpeakerStyle(pose, config.channels, speakers, config.style, freezes=config.id_freezes)
        super().__init__(config, pose=pose, audio=audio, style=style, identity=config.identity, style_first=config.style_first)

    @torch.no_grad()
    def style_of(self, poses: Tensor) -> Tensor:
        """(B, T, D) poses, 64 frames at least → (B, S) probabilities of the speakers (Eˢₚ)."""
        return torch.softmax(self.style.encoder(poses.mT), 1)

    @torch.no_grad()
    def speaker_styles(self, stretches: Tensor) -> Tensor:
        """The identity: a speaker's style is a row of the style matrix."""
        return torch.eye(self.styles).to(stretches)
