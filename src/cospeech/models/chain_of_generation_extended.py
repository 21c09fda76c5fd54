"""Chain of Generation, extended; all of this is ours. The paper is `cospeech.models.chain_of_generation`, whose equations hold.

The mean of all possible motions has the smallest L1 distance to one recording: with equation 9 alone a network of our size
stands nearly still. And the paper's network wants words and seed poses, and plays one motion for one speech. What we add, each
off by default:

    noise                        smooth Gumbel noise for both decoders: takes of one speech differ
    adversarial                  ℓ_D of a discriminator that sees poses, their motion, the speech, speaker and emotion
    motion_statistics            ℓ_M = |m(P) − m(P*)|₁, m: mean pose, and deviations of pose, velocity, acceleration
    speed_envelope               ℓ_V = |v(P) − v(P*)|² / |v(P*)|², v: how fast the pose changes, over 0.2 s
    stroke_timing                ℓ_T = 1 − r of the logarithms of v(P) and v(P*), without what changes over 2 s
    speed_distribution           ℓ_W = W₁ of the distributions of the logarithms of v, of each part of the body
    part_correlation             ℓ_R = |r(P) − r(P*)|₁, r: correlations of these logarithms, of each part with each
    part_timing                  ℓ_P: ℓ_T of each part of the body, the mean
    speech_swap                  clips that are played to the speech of another clip, in the style of their own labels
    word_dropout, seed_dropout   clips without words, without seed poses: what may be missing when it plays
    label_conditioning           clips with the style of their labels: style and emotion may be given when it plays
    face_teacher_forcing         clips with their recorded face: a face may be given when it plays
    gain_augmentation            louder or softer speech: the level of a microphone says nothing about the emotion
    speech_augmentation          what the decoders hear, as other voices and rooms would have it

    ℓ = equation 9 + λ_M ℓ_M + λ_V ℓ_V + λ_T ℓ_T + λ_W ℓ_W + λ_R ℓ_R + λ_P ℓ_P + λ_D (D(P) − 1)²
    D minimises (D(P*) − 1)² + D(P)² + D(P*, speech of another clip)²

What each does for the motion: docs/models/chain_of_generation.md, "Added".
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
from .nn.gumbel import smooth_gumbel
from .nn.motion_statistics_loss import statistics_term
from .nn.objective import Batch, Objective
from .nn.part_speeds import Parts, PartWeights, part_terms
from .nn.patch import PATCH_FRAMES
from .nn.pose_discriminator import PoseDiscriminator
from .nn.settings import check_least
from .nn.speech_augmentation import SpeechAugmentation
from .nn.speed_distance import speed_distance, timing_term
from .nn.temporal import Memory

__all__ = ["ChainExtendedConfig", "ChainOfGenerationExtended", "Turn"]


@dataclass(frozen=True)
class ChainExtendedConfig(ChainConfig):
    """The paper's, and what is ours."""

    word_dropout: float = 0.0
    """Share of training clips whose words are not known. [ours]"""
    seed_dropout: float = 0.0
    """Share of training clips without seed poses. [ours]"""
    label_conditioning: float = 0.0
    """Share of training clips whose style is of their labels, not of what the classifier says. [ours]"""
    face_teacher_forcing: float = 0.0
    """Share of training clips of which TFFDec sees the recorded face. [ours]"""
    gain_augmentation: float = 0.0
    """dB by which training clips are made louder or softer at most. [ours]"""
    speech_augmentation: float = 0.0
    """By how much each number of speech is changed throughout a clip, in deviations of the corpus, for the decoders
    alone (models/nn/speech_augmentation.py). [ours]"""
    speech_swap: float = 0.0
    """Share of training clips that are played to the speech of another of their batch, in the style of their own labels: of
    what they should be like D and ``motion_statistics`` tell. [ours]"""
    motion_statistics: float = 0.0
    """Weight of how far a clip's mean pose, and its deviations of pose, velocity and acceleration, are from those
    recorded. [ours]"""
    speed_envelope: float = 0.0
    """Weight of how far the speed of a clip's poses is from the recorded one, frame by frame. The best guess by squares is the
    mean speed at such speech: it says where strokes and pauses are, whatever the strokes look like. [ours]"""
    stroke_timing: float = 0.0
    """Weight of how little the speed of a clip's poses rises and falls when the recorded one does. It says nothing of the size
    and form of strokes. [ours]"""
    speed_distribution: float = 0.0
    """Weight of how far the distribution of speeds of each part of the body is from the recorded one. [ours]"""
    part_correlation: float = 0.0
    """Weight of how far the correlations of the speeds of parts of the body are from the recorded ones. [ours]"""
    part_timing: float = 0.0
    """Weight of how little each part of the body moves when it moves in the recording. [ours]"""
    noise: int = 0
    """Numbers of smooth Gumbel noise that both decoders get at every frame, by which takes differ. [ours]"""
    persistence: float = 15.0
    """Frames over which the noise correlates. [ours]"""
    adversarial: float = 0.0
    """Weight of what a discriminator says (models/nn/pose_discriminator.py), by least squares; 0: there is none. [ours]"""
    discriminator_channels: int = 48
    """Of its first convolution. [ours]"""

    def __post_init__(self) -> None:
        least = ("motion_statistics", "speed_envelope", "stroke_timing", "adversarial", "speech_augmentation")
        check_least(self, "an extended Chain of Generation", dict.fromkeys((*least, *PartWeights._fields), 0))


class Turn(NamedTuple):
    """Of a batch in a step: what the cascade makes of it, and whose style and speech the discriminator compares it with."""

    made: CascadeOutput
    """Of the clip's own frames."""
    heard: Tensor
    """Â of all that was heard."""
    features: Tensor
    """F̂ of the same."""
    recorded: Batch
    """As the batch, as loud as it was heard."""
    played: Batch
    """As the batch, but with the speech, words and faces that were played to."""
    own: Tensor
    """(B, 1, 1) whether these are the clip's own."""
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
        pose, audio, speakers, hands, text: as of `ChainOfGeneration`.
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
        heard, adversarial = self.speech_encoder.inputs, config.adversarial > 0
        self.modes, self.parts = config.noise, parts or [range(pose)]
        self.gain_augmentation = GainAugmentation(config.gain_augmentation, heard, louder)
        self.speech_augmentation = SpeechAugmentation(config.speech_augmentation)
        self.discriminator = (
            PoseDiscriminator(pose, heard, config.discriminator_channels, speakers, EMOTIONS) if adversarial else None
        )
        self._shared_forward: tuple[Batch, Turn] | None = None

    @classmethod
    def dimensions_for(cls, config: ChainExtendedConfig) -> tuple[str, ...]:
        """With what is louder in loud speech, where its gain is changed, and the parts of the body, where a term is of them."""
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

    def mask_seeds(self, pose: Tensor, known: Tensor | None = None) -> Tensor:
        """As of the paper, delayed; ``known``: (B, 1, 1) whether a clip's are, else zeros."""
        first = super().mask_seeds(pose)
        first = first if known is None else torch.where(known, first, 0.0)
        return F.pad(first, (self.delay, 0))[..., : pose.shape[-1]]

    def extra(self, seeds: Tensor, noise: Tensor) -> Tensor:
        """With the noise (B, Z, T)."""
        return torch.cat([super().extra(seeds, noise), noise], 1)

    def poses(self, rows: Tensor, style: Tensor, noise: Tensor, seeds: Tensor, face: Tensor | None = None) -> CascadeOutput:
        """As of the paper; what follows the last frame is as it is."""
        rows, style, noise = (torch.cat([x, x[..., -1:].expand(-1, -1, self.delay)], -1) for x in (rows, style, noise))
        seeds = F.pad(seeds, (0, self.delay))
        face = None if face is None else F.pad(face, (self.delay, 0), value=torch.nan)
        return self._cut(super().poses(rows, style, noise, seeds, face))

    def _cut(self, made: CascadeOutput) -> CascadeOutput:
        """Cut to the frames whose speech was heard completely."""
        return CascadeOutput(*(x[..., self.delay :] for x in made))

    # what is optimised ----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """The paper's two, and between them D's, where there is one."""
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
        """The batch with some clips' speech, words and faces those of the clip before; (B, 1, 1) which have their own."""
        own = batch.chance.uniform(len(batch), 1, 1) >= self.config.speech_swap * self.training
        names = {self.speech_encoder.array, "text", "face"}
        arrays = {n: torch.where(own, x, x.roll(1, 0)) if n in names else x for n, x in batch.arrays.items()}
        return Batch(arrays, batch.chance), own

    def _draw_style(self, played: Batch, own: Tensor) -> Tensor:
        """(B, S + 8, T) weights of speakers and of emotions."""
        speakers, label = self.styles - EMOTIONS, played["emotion"]
        heard = self.estimate_style(played[self.speech_encoder.array]).unsqueeze(1).expand(-1, label.shape[1], -1)
        told = F.one_hot(played["speaker"], speakers).unsqueeze(1).expand(-1, label.shape[1], -1)
        felt = torch.where((label < 0).unsqueeze(2), heard[..., speakers:], F.one_hot(label.clamp_min(0), EMOTIONS).float())
        coins = played.chance.uniform(len(played), 2, 1, 1) < self.config.label_conditioning * self.training
        who = torch.where(coins[:, 0] | ~own, told.float(), heard[..., :speakers])
        how = torch.where(coins[:, 1] | ~own, felt, heard[..., speakers:])
        return torch.cat([who, how], 2).mT

    def _turn(self, batch: Batch) -> Turn:
        """What both turns of a step need; D's leaves it to that of the others, as it moves nothing of it."""
        if self._shared_forward is not None and self._shared_forward[0] is batch:
            return self._shared_forward[1]
        heard = self.gain_augmentation(batch[self.speech_encoder.array], batch.chance)
        recorded = Batch({**batch.arrays, self.speech_encoder.array: heard}, batch.chance)
        played, own = self._swap_speech(recorded)
        style = self._draw_style(played, own)
        rows, frames = len(batch), style.shape[-1]
        noise = smooth_gumbel(batch.chance, rows, self.config.noise, frames, self.config.persistence)
        coins = batch.chance.uniform(rows, 3, 1, 1)
        coins = coins if self.training else torch.ones_like(coins)
        words = self.words(played["text"]).mT * (coins[:, 0] >= self.config.word_dropout)
        seeds = self.mask_seeds(batch["pose"].mT, coins[:, 1] >= self.config.seed_dropout)
        face = F.pad(played["face"].mT, (self.delay, 0), value=torch.nan)[..., :frames]
        face = torch.where(coins[:, 2] < self.config.face_teacher_forcing, face, torch.nan)
        other = self.speech_augmentation(played[self.speech_encoder.array], batch.chance)
        made, features = self(other.mT, words, style, self.extra(seeds, noise), Memory(), face)
        return Turn(self._cut(made), features, made.features, recorded, played, own, style, words, noise)

    def _score(self, pose: Tensor, batch: Batch, shift: int = 0) -> Tensor:
        """D's scores of (B, D, T) poses; ``shift``: to the speech of so many rows before."""
        assert self.discriminator is not None
        heard, emotion = batch[self.speech_encoder.array].roll(shift, 0), batch["emotion"][:, self.config.frames // 2]
        scores: Tensor = self.discriminator(pose, heard[:, : self.config.frames].mT, batch["speaker"], emotion)
        return scores

    def discriminator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Least squares, for D: recordings are true; what was made, and recordings to the speech of others, false."""
        self._shared_forward = None
        turn = self._turn(batch)
        self._shared_forward = (batch, turn) if torch.is_grad_enabled() else None
        pose, losses = batch["pose"][:, : self.config.frames].mT, ADVERSARIAL_LOSSES["squares"]
        terms = {"true": losses.true(self._score(pose, turn.recorded))}
        terms["false"] = losses.false(self._score(turn.made.pose.detach(), turn.played))
        if len(batch) > 1:
            terms["mismatched"] = losses.false(self._score(pose, turn.recorded, shift=1))
        return terms

    def gesture_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """The terms of equation 9, weighted, and D's."""
        turn, self._shared_forward = self._turn(batch), None
        return self.terms(batch, turn)

    def terms(self, batch: Batch, turn: Turn) -> dict[str, Tensor]:
        """Loss terms of the generated motion."""
        c, frames, made = self.config, self.config.frames, turn.made
        pose, face = batch["pose"][:, :frames].mT, turn.played["face"][:, :frames].mT
        wanted = torch.where(turn.own, pose, made.pose)  # of no distance where nobody knows what would have been done
        terms = self.losses(made._replace(features=turn.features), turn.heard, wanted, face)
        terms |= statistics_term(c.motion_statistics, made.pose, pose)
        if c.speed_envelope:
            terms["speed_envelope"] = c.speed_envelope * speed_distance(made.pose, wanted)
        terms |= timing_term(c.stroke_timing, made.pose, wanted)
        terms |= part_terms(PartWeights(c.speed_distribution, c.part_correlation), made.pose, pose, self.parts)
        terms |= part_terms(PartWeights(part_timing=c.part_timing), made.pose, wanted, self.parts)
        if self.discriminator is not None:
            terms["adv"] = c.adversarial * ADVERSARIAL_LOSSES["squares"].generator_loss(self._score(made.pose, turn.played))
        return terms
