"""Chain of Generation, extended; all of this is ours. The paper is `cospeech.models.chain_of_generation`, whose equations hold.

The mean of all possible motions has the smallest L1 distance to one recording. So with equation 9 alone a network of our size
stands nearly still. Also, the paper's network needs words and seed poses, and plays one motion for one speech. Our additions,
each off by default:

    noise                        smooth Gumbel noise for both decoders: takes of one speech differ
    adversarial                  ℓ_D of a discriminator that sees poses, their motion, the speech, speaker and emotion
    motion_statistics            ℓ_M = |m(P) − m(P*)|₁, m: mean pose, and deviations of pose, velocity, acceleration
    speed_envelope               ℓ_V = |v(P) − v(P*)|² / |v(P*)|², v: how fast the pose changes, over 0.2 s
    stroke_timing                ℓ_T = 1 − r of the logarithms of v(P) and v(P*), without what changes over 2 s
    speed_distribution           ℓ_W = W₁ of the distributions of the logarithms of v, of each part of the body
    part_correlation             ℓ_R = |r(P) − r(P*)|₁, r: correlations of these logarithms, of each part with each
    part_timing                  ℓ_P: ℓ_T of each part of the body, the mean
    speech_swap                  clips with the speech of another clip, in the style of their own labels
    word_dropout, seed_dropout   clips without words, without seed poses: inputs that may be missing when it plays
    label_conditioning           clips with the style of their labels: style and emotion may be given when it plays
    face_teacher_forcing         clips with their recorded face: a face may be given when it plays
    gain_augmentation            louder or softer speech: the level of a microphone says nothing about the emotion
    speech_augmentation          speech of the decoders, as other voices and rooms would change it

    ℓ = equation 9 + λ_M ℓ_M + λ_V ℓ_V + λ_T ℓ_T + λ_W ℓ_W + λ_R ℓ_R + λ_P ℓ_P + λ_D (D(P) − 1)²
    D minimises (D(P*) − 1)² + D(P)² + D(P*, speech of another clip)²

The effect of each on the motion: docs/models/chain_of_generation.md, "Added".
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from ..errors import InputError
from .chain_of_generation import ChainConfig, ChainOfGeneration
from .nn.adversarial_losses import ADVERSARIAL_LOSSES
from .nn.cascade import EMOTIONS, CascadeOutput
from .nn.gain_augmentation import GainAugmentation
from .nn.motion_statistics_loss import statistics_term
from .nn.objective import Batch, Objective
from .nn.part_speeds import Parts, PartWeights, part_terms
from .nn.patch import PATCH_FRAMES
from .nn.pose_discriminator import PoseDiscriminator
from .nn.settings import check_least
from .nn.smooth_noise import smooth_noise
from .nn.speech_augmentation import SpeechAugmentation
from .nn.speed_distance import speed_distance, timing_term
from .nn.temporal import Memory

__all__ = ["ChainExtendedConfig", "ChainOfGenerationExtended", "Turn"]


@dataclass(frozen=True)
class ChainExtendedConfig(ChainConfig):
    """The paper's settings, and ours."""

    word_dropout: float = 0.0
    """Share of training clips without words. [ours]"""
    seed_dropout: float = 0.0
    """Share of training clips without seed poses. [ours]"""
    label_conditioning: float = 0.0
    """Share of training clips whose style comes from their labels, not from the classifier. [ours]"""
    face_teacher_forcing: float = 0.0
    """Share of training clips of which TFFDec sees the recorded face. [ours]"""
    gain_augmentation: float = 0.0
    """dB by which training clips are made louder or softer at most. [ours]"""
    speech_augmentation: float = 0.0
    """Size of the change of each number of speech throughout a clip, in deviations of the corpus, for the decoders alone
    (models/nn/speech_augmentation.py). [ours]"""
    speech_swap: float = 0.0
    """Share of training clips that get the speech of another clip of their batch, in the style of their own labels. They have
    no recording as a target; D and ``motion_statistics`` say how they should move. [ours]"""
    motion_statistics: float = 0.0
    """Weight of the distance of a clip's mean pose, and of its deviations of pose, velocity and acceleration, from the
    recorded ones. [ours]"""
    speed_envelope: float = 0.0
    """Weight of the squared distance of the speed of a clip's poses from the recorded one, frame by frame. The best estimate is
    the mean speed at such speech: it says where strokes and pauses are, whatever the strokes look like. [ours]"""
    stroke_timing: float = 0.0
    """Weight of the distance in time of rises and falls of the speed of a clip's poses from the recorded ones. It does not
    depend on the size and form of strokes. [ours]"""
    speed_distribution: float = 0.0
    """Weight of the distance of the distribution of speeds of each part of the body from the recorded one. [ours]"""
    part_correlation: float = 0.0
    """Weight of the distance of the correlations of speeds of parts of the body from the recorded ones. [ours]"""
    part_timing: float = 0.0
    """Weight of the distance of ``stroke_timing``, for each part of the body by itself. [ours]"""
    noise: int = 0
    """Numbers of smooth Gumbel noise that both decoders get at every frame, by which takes differ. [ours]"""
    persistence: float = 15.0
    """Frames over which the noise correlates. [ours]"""
    adversarial: float = 0.0
    """Weight of the least-squares loss of a discriminator (models/nn/pose_discriminator.py); 0: there is none. [ours]"""
    discriminator_channels: int = 48
    """Of its first convolution. [ours]"""

    def __post_init__(self) -> None:
        least = ("motion_statistics", "speed_envelope", "stroke_timing", "adversarial", "speech_augmentation")
        check_least(self, "an extended Chain of Generation", dict.fromkeys((*least, *PartWeights._fields), 0))


class Turn(NamedTuple):
    """The forward pass of a batch in a step: inputs and output of the cascade; the discriminator compares them."""

    output: CascadeOutput
    """Of the clip's own frames."""
    audio: Tensor
    """Â of all frames of the speech."""
    features: Tensor
    """F̂ of the same frames."""
    recording: Batch
    """The batch, with the loudness after augmentation."""
    inputs: Batch
    """The same, but with the speech, words and faces that the cascade gets."""
    own: Tensor
    """(B, 1, 1) whether speech, words and faces are the clip's own."""
    style: Tensor
    """(B, S + 8, T)."""
    words: Tensor
    """(B, W, T)."""
    noise: Tensor
    """(B, Z, T)."""


class ChainOfGenerationExtended(ChainOfGeneration):
    """Chain of Generation with our additions: noise, a discriminator, and inputs that may be missing or given.

    Args:
        config: sizes and weights.
        pose, audio, speakers, hands, text: as in `ChainOfGeneration`.
        louder: (A,) by how much each number of speech grows with 10 dB, for ``gain_augmentation``.
        parts: columns of each part of the body, for the three terms of parts.

    Raises:
        InputError: sizes that do not fit each other.
    """

    Config = ChainExtendedConfig
    config: ChainExtendedConfig

    def __init__(
        self, config: ChainExtendedConfig, *, pose: int, audio: int, speakers: int, hands: Collection[int], text: int = 0,
        louder: Sequence[float] = (), parts: Parts = (),
    ) -> None:  # fmt: skip
        check_least(config, "an extended Chain of Generation", {"discriminator_channels": 1, "noise": 0})
        if config.adversarial > 0 and config.frames < PATCH_FRAMES:
            raise InputError(f"clips of {config.frames} frames"[:200], f"{PATCH_FRAMES} at least to be judged")
        super().__init__(config, pose=pose, audio=audio, speakers=speakers, hands=hands, text=text)
        width, adversarial = self.speech_encoder.inputs, config.adversarial > 0
        self.modes, self.parts = config.noise, parts or [range(pose)]
        self.gain_augmentation = GainAugmentation(config.gain_augmentation, width, louder)
        self.speech_augmentation = SpeechAugmentation(config.speech_augmentation)
        self.discriminator = (
            PoseDiscriminator(pose, width, config.discriminator_channels, speakers, EMOTIONS) if adversarial else None
        )
        self._shared_forward: tuple[Batch, Turn] | None = None

    @classmethod
    def dimensions_for(cls, config: ChainExtendedConfig) -> tuple[str, ...]:
        """With ``louder``, where the gain is augmented, and with the parts of the body, where a term needs them."""
        louder = ("louder",) if config.gain_augmentation > 0 else ()
        parts = ("parts",) if config.speed_distribution or config.part_correlation or config.part_timing else ()
        return (*cls.dimensions, *louder, *parts)

    @property
    def extra_width(self) -> int:
        """With the noise."""
        return super().extra_width + self.config.noise

    @property
    def accepts_face(self) -> bool:
        """Whether it was trained with recorded faces."""
        return self.config.face_teacher_forcing > 0

    @property
    def accepts_seeds(self) -> bool:
        """Whether some training clips had seed poses."""
        return super().accepts_seeds and self.config.seed_dropout < 1

    # poses that come ``delay`` frames after their speech ------------------------------------------------------------

    def mask_seeds(self, pose: Tensor, has_seeds: Tensor | None = None) -> Tensor:
        """As in the paper, delayed; ``has_seeds``: (B, 1, 1) whether a clip has seed poses, else they are zeros."""
        first = super().mask_seeds(pose)
        first = first if has_seeds is None else torch.where(has_seeds, first, 0.0)
        return F.pad(first, (self.delay, 0))[..., : pose.shape[-1]]

    def extra(self, seeds: Tensor, noise: Tensor) -> Tensor:
        """With the noise (B, Z, T)."""
        return torch.cat([super().extra(seeds, noise), noise], 1)

    def poses(self, rows: Tensor, style: Tensor, noise: Tensor, seeds: Tensor, face: Tensor | None = None) -> CascadeOutput:
        """As in the paper; after the last frame its inputs are repeated."""
        rows, style, noise = (torch.cat([x, x[..., -1:].expand(-1, -1, self.delay)], -1) for x in (rows, style, noise))
        seeds = F.pad(seeds, (0, self.delay))
        face = None if face is None else F.pad(face, (self.delay, 0), value=torch.nan)
        return self._cut(super().poses(rows, style, noise, seeds, face))

    def _cut(self, output: CascadeOutput) -> CascadeOutput:
        """Cut to the frames whose speech was heard completely."""
        return CascadeOutput(*(x[..., self.delay :] for x in output))

    # what is optimised ----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """The paper's two, and between them that of D, where there is one."""
        parts = super().objectives()
        if self.discriminator is None:
            return parts
        gestures, adversarial = parts["gestures"], {id(p) for p in self.discriminator.parameters()}
        others = [p for p in gestures.parameters if id(p) not in adversarial]
        discriminator = Objective(self.discriminator.parameters(), self.discriminator_loss, start=gestures.start)
        return {
            "classifier": parts["classifier"],
            "discriminator": discriminator,
            "gestures": gestures._replace(parameters=others),
        }

    def classifier_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Equation 10, on speech made louder or softer."""
        return self.classifier.losses(
            self.gain_augmentation(batch[self.speech_encoder.array], batch.chance), batch["speaker"], batch["emotion"]
        )

    def _swap_speech(self, batch: Batch) -> tuple[Batch, Tensor]:
        """The batch, where some clips have speech, words and faces of the clip before; (B, 1, 1) which clips have their own."""
        own = batch.chance.uniform(len(batch), 1, 1) >= self.config.speech_swap * self.training
        names = {self.speech_encoder.array, "text", "face"}
        arrays = {n: torch.where(own, x, x.roll(1, 0)) if n in names else x for n, x in batch.arrays.items()}
        return Batch(arrays, batch.chance), own

    def _draw_style(self, inputs: Batch, own: Tensor) -> Tensor:
        """(B, S + 8, T) weights of speakers and of emotions."""
        speakers, label = self.styles - EMOTIONS, inputs["emotion"]
        estimate = self.estimate_style(inputs[self.speech_encoder.array]).unsqueeze(1).expand(-1, label.shape[1], -1)
        speaker = F.one_hot(inputs["speaker"], speakers).unsqueeze(1).expand(-1, label.shape[1], -1)
        mood = torch.where((label < 0).unsqueeze(2), estimate[..., speakers:], F.one_hot(label.clamp_min(0), EMOTIONS).float())
        coins = inputs.chance.uniform(len(inputs), 2, 1, 1) < self.config.label_conditioning * self.training
        who = torch.where(coins[:, 0] | ~own, speaker.float(), estimate[..., :speakers])
        how = torch.where(coins[:, 1] | ~own, mood, estimate[..., speakers:])
        return torch.cat([who, how], 2).mT

    def _turn(self, batch: Batch) -> Turn:
        """The forward pass of a step. The turn of D keeps it for the other turn, as D changes none of its parameters."""
        if self._shared_forward is not None and self._shared_forward[0] is batch:
            return self._shared_forward[1]
        speech = self.gain_augmentation(batch[self.speech_encoder.array], batch.chance)
        recording = Batch({**batch.arrays, self.speech_encoder.array: speech}, batch.chance)
        inputs, own = self._swap_speech(recording)
        style = self._draw_style(inputs, own)
        rows, frames = len(batch), style.shape[-1]
        noise = smooth_noise(batch.chance, rows, self.config.noise, frames, self.config.persistence)
        coins = batch.chance.uniform(rows, 3, 1, 1)
        coins = coins if self.training else torch.ones_like(coins)
        words = self.words(inputs["text"]).mT * (coins[:, 0] >= self.config.word_dropout)
        seeds = self.mask_seeds(batch["pose"].mT, coins[:, 1] >= self.config.seed_dropout)
        face = F.pad(inputs["face"].mT, (self.delay, 0), value=torch.nan)[..., :frames]
        face = torch.where(coins[:, 2] < self.config.face_teacher_forcing, face, torch.nan)
        other = self.speech_augmentation(inputs[self.speech_encoder.array], batch.chance)
        output, features = self(other.mT, words, style, self.extra(seeds, noise), Memory(), face)
        return Turn(self._cut(output), features, output.features, recording, inputs, own, style, words, noise)

    def _score(self, pose: Tensor, batch: Batch, shift: int = 0) -> Tensor:
        """D's scores of (B, D, T) poses; ``shift``: with the speech of so many rows before."""
        assert self.discriminator is not None
        speech, emotion = batch[self.speech_encoder.array].roll(shift, 0), batch["emotion"][:, self.config.frames // 2]
        scores: Tensor = self.discriminator(pose, speech[:, : self.config.frames].mT, batch["speaker"], emotion)
        return scores

    def discriminator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Least squares, for D: recordings are true; generated poses, and recordings with the speech of others, are false."""
        self._shared_forward = None
        turn = self._turn(batch)
        self._shared_forward = (batch, turn) if torch.is_grad_enabled() else None
        pose, losses = batch["pose"][:, : self.config.frames].mT, ADVERSARIAL_LOSSES["squares"]
        terms = {"true": losses.true(self._score(pose, turn.recording))}
        terms["false"] = losses.false(self._score(turn.output.pose.detach(), turn.inputs))
        if len(batch) > 1:
            terms["mismatched"] = losses.false(self._score(pose, turn.recording, shift=1))
        return terms

    def gesture_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """The terms of equation 9, weighted, and D's."""
        turn, self._shared_forward = self._turn(batch), None
        return self.terms(batch, turn)

    def terms(self, batch: Batch, turn: Turn) -> dict[str, Tensor]:
        """Loss terms of the generated motion."""
        c, frames, output = self.config, self.config.frames, turn.output
        pose, face = batch["pose"][:, :frames].mT, turn.inputs["face"][:, :frames].mT
        target = torch.where(turn.own, pose, output.pose.detach())  # no distance where no recording has this speech
        terms = self.losses(output._replace(features=turn.features), turn.audio, target, face)
        terms |= statistics_term(c.motion_statistics, output.pose, pose)
        if c.speed_envelope:
            terms["speed_envelope"] = c.speed_envelope * speed_distance(output.pose, target)
        terms |= timing_term(c.stroke_timing, output.pose, target)
        terms |= part_terms(PartWeights(c.speed_distribution, c.part_correlation), output.pose, pose, self.parts)
        terms |= part_terms(PartWeights(part_timing=c.part_timing), output.pose, target, self.parts)
        if self.discriminator is not None:
            terms["adv"] = c.adversarial * ADVERSARIAL_LOSSES["squares"].generator_loss(self._score(output.pose, turn.inputs))
        return terms
