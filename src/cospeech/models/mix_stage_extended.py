"""Mix-StAGE, extended; all of this is ours. The paper is `cospeech.models.mix_stage`, whose equations hold.

With the paper's loss and few steps the generator soon stands nearly still: log(1 − D) has no gradient where D is certain, and
the remaining loss, the distance to one recording, is least for the mean of all motions. Our additions, each off by default:

    reconstruction    weight of L_rec and L_joint
    adversarial_loss  "squares": least squares, whose gradient does not vanish
    pose_discriminator
                      D sees poses, their motion, the speech and the speaker; recordings with the speech of another clip count
                      as false too
    persistence       L_adv and the second term of L_id are of poses as they are played, with priors of H and smooth noise:

        Z ─┬─► H ──► logits + noise ── softmax ──► Φ ─┐
           └─► G₁ … G_M ──────────────────────────────┴─► Ŷ of L_adv and L_id, which then reach H too

    motion_statistics ℓ_M = |m(Ŷ) − m(Y)|₁, m: mean pose, and deviations of pose, velocity, acceleration of a window
    stroke_timing     ℓ_T = 1 − r of the logarithms of the speeds of Ŷ and of the recording, without what changes over 2 s
    speed_distribution, part_correlation, part_timing
                      distances: how much of the time each part rests, which parts move together, and when
                      (models/nn/part_speeds.py)
    speech_augmentation
                      speech as other voices and rooms would change it (models/nn/speech_augmentation.py)

The effect of each on the motion: docs/models/mix_stage.md, "Added".
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from .mix_stage import MixStage, MixStageConfig
from .nn.adversarial_losses import ADVERSARIAL_LOSSES
from .nn.mixture import mix
from .nn.motion_statistics_loss import statistics_term
from .nn.objective import Batch
from .nn.part_speeds import Parts, PartWeights, part_terms
from .nn.pose_discriminator import PoseDiscriminator
from .nn.settings import check_least
from .nn.smooth_noise import smooth_noise
from .nn.speech_augmentation import SpeechAugmentation
from .nn.speed_distance import timing_term

__all__ = ["MixStageExtended", "MixStageExtendedConfig"]


@dataclass(frozen=True)
class MixStageExtendedConfig(MixStageConfig):
    """The paper's settings, and ours."""

    reconstruction: float = 1.0
    """Weight of L_rec and L_joint; equation 8: 1. [ours]: less, so that one recording is not the only target."""
    pose_discriminator: bool = False
    """Whether D sees poses beside velocity, and knows their speaker and speech
    (models/nn/pose_discriminator.py). [ours]"""
    persistence: float = 0.0
    """Frames over which noise correlates. With it L_adv, and the second term of L_id, see poses as they are played: with priors
    of H and the smooth noise that makes takes differ. [ours]; 0: they see the poses of L_rec."""
    motion_statistics: float = 0.0
    """Weight of the distance between generated and recorded statistics of a window: mean pose, and deviations of pose, velocity
    and acceleration. So the network moves as far and as fast as the recordings. [ours]"""
    stroke_timing: float = 0.0
    """Weight of the distance in time of rises and falls of the speed of the poses of L_adv from the recorded ones. [ours]"""
    speed_distribution: float = 0.0
    """Weight of the distance of the distribution of speeds of each part of the body from the recorded one. [ours]"""
    part_correlation: float = 0.0
    """Weight of the distance of the correlations of speeds of parts of the body from the recorded ones. [ours]"""
    part_timing: float = 0.0
    """Weight of the distance of ``stroke_timing``, for each part of the body by itself. [ours]"""
    speech_augmentation: float = 0.0
    """Size of the change of each number of speech throughout a window, in deviations of the corpus. [ours]"""

    def __post_init__(self) -> None:
        weights = (
            "reconstruction", "persistence", "motion_statistics", "stroke_timing", "speech_augmentation", *PartWeights._fields,
        )  # fmt: skip
        check_least(self, "an extended Mix-StAGE", dict.fromkeys(weights, 0))


class MixStageExtended(MixStage):
    """Mix-StAGE with our additions: a discriminator that sees poses, speakers and speech, and training on poses as they play.

    Args:
        config: sizes and weights.
        pose, audio, speakers: as in `MixStage`.
        parts: columns of each part of the body, for the three terms of parts.
    """

    Config = MixStageExtendedConfig
    config: MixStageExtendedConfig

    def __init__(self, config: MixStageExtendedConfig, *, pose: int, audio: int, speakers: int, parts: Parts = ()) -> None:
        super().__init__(config, pose=pose, audio=audio, speakers=speakers)
        self.parts = parts or [range(pose)]
        self.speech_augmentation = SpeechAugmentation(config.speech_augmentation)

    @classmethod
    def dimensions_for(cls, config: MixStageExtendedConfig) -> tuple[str, ...]:
        """With the parts of the body, where a term needs them."""
        has_part_terms = config.speed_distribution or config.part_correlation or config.part_timing
        return (*cls.dimensions, "parts") if has_part_terms else cls.dimensions

    def _make_discriminator(self) -> nn.Module:
        if not self.config.pose_discriminator:
            return super()._make_discriminator()
        return PoseDiscriminator(self.pose, self.audio, self.config.patch_channels, max(1, self.styles))

    def _encode_contents(self, batch: Batch, step: int) -> tuple[Tensor, Tensor | None]:
        """As in the paper; with ``speech_augmentation`` the speech is changed first."""
        audio = self.speech_augmentation(batch["audio"], batch.chance)
        return super()._encode_contents(Batch({**batch.arrays, "audio": audio}, batch.chance), step)

    def _draw_poses(self, batch: Batch, outputs: Tensor, logits: Tensor, poses: Tensor) -> Tensor:
        """With ``persistence`` as it is played: with priors of H and noise."""
        if not self.config.persistence:
            return poses
        rows, modes, frames = logits.shape
        noise = smooth_noise(batch.chance, rows, modes, frames, self.config.persistence)
        return mix(outputs, torch.softmax(logits + noise, 1))

    def _score(self, pose: Tensor, batch: Batch, shift: int = 0) -> Tensor:
        """D's scores of (B, D, T) poses in their speakers' styles; ``shift``: with the speech of so many rows before."""
        if not self.config.pose_discriminator:
            return super()._score(pose, batch)
        scores: Tensor = self.discriminator(pose, batch["audio"].roll(shift, 0).mT, batch["speaker"])
        return scores

    def discriminator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """As in the paper; with ``pose_discriminator`` recordings with the speech of others are false too."""
        terms = super().discriminator_loss(batch, step)
        if self.config.pose_discriminator and len(batch) > 1:
            losses = ADVERSARIAL_LOSSES[self.config.adversarial_loss]
            terms["mismatched"] = losses.false(self._score(batch["pose"].mT, batch, shift=1))
        return terms

    def generator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """As in the paper, with weighted L_rec and L_joint, and our terms."""
        self._shared_forward = decoding = self._decode_batch(batch, step)
        terms, weight = super().generator_loss(batch, step), self.config.reconstruction
        terms = {name: weight * term if name in ("rec", "joint") else term for name, term in terms.items()}
        c, pose = self.config, batch["pose"].mT
        weights = PartWeights(c.speed_distribution, c.part_correlation, c.part_timing)
        terms |= part_terms(weights, decoding.adversarial_poses, pose, self.parts)
        terms |= statistics_term(c.motion_statistics, decoding.adversarial_poses, pose)
        return terms | timing_term(c.stroke_timing, decoding.adversarial_poses, pose)
