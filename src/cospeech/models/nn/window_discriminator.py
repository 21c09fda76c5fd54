"""The discriminator of whole windows of Yoon et al. 2020: three convolutions, a recurrent network both ways, one number."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .norm import BatchNorm1d
from .objective import Batch, Objective
from .recurrent import BothWaysGru
from .speaker_latent import kl_divergence
from .speed_distance import timing_term
from .trainable import Trainable

__all__ = ["AdversarialWindows", "GruDiscriminator", "SampledWindows", "WindowDiscriminator"]

_CHANNELS = (16, 8, 8)  # of the convolutions; authors' code
_HIDDEN, _LAYERS, _DROPOUT = 64, 4, 0.3  # of the GRU; authors' code


class GruDiscriminator(nn.Module):
    """(B, inputs, T) of a window of T frames → (B,) logits that it was recorded."""

    def __init__(self, inputs: int, frames: int) -> None:
        super().__init__()
        self.both_ways = BothWaysGru(inputs, _HIDDEN, _LAYERS, _DROPOUT)
        self.of_frames, self.of_all = nn.Conv1d(_HIDDEN, 1, 1), nn.Linear(frames, 1)

    def forward(self, features: Tensor) -> Tensor:
        scores: Tensor = self.of_all(self.of_frames(self.both_ways(features)).squeeze(1)).squeeze(1)
        return scores


class WindowDiscriminator(GruDiscriminator):
    """(B, T, D) windows of the configuration's length → (B,) logits that a window was recorded."""

    def __init__(self, pose: int, frames: int, slope: float) -> None:
        first, second, third = _CHANNELS
        super().__init__(third, frames - 6)
        self.convolutions = nn.Sequential(
            nn.Conv1d(pose, first, 3), BatchNorm1d(first), nn.LeakyReLU(slope),
            nn.Conv1d(first, second, 3), BatchNorm1d(second), nn.LeakyReLU(slope),
            nn.Conv1d(second, third, 3),
        )  # fmt: skip

    def forward(self, poses: Tensor) -> Tensor:
        """See the class."""
        return super().forward(self.convolutions(poses.mT))


class SampledWindows(NamedTuple):
    """Poses of windows, and the z that they were generated from."""

    pose: Tensor
    """(B, T, D)."""
    z: Tensor
    mean: Tensor
    variance: Tensor
    """log σ²; (B, width, T) each."""


class AdversarialWindows(Trainable):
    """A network of windows of Yoon et al. 2020's losses: Huber, adversarial, diversity and divergence of a speaker's latent.

    Its settings have the weights (``reconstruction``, ``stroke_timing``, ``adversarial``, ``diversity``, ``divergence``),
    ``beta`` of the Huber loss, ``speaker``, the width of z, and ``adversarial_from``, the first step with the discriminator.
    """

    discriminator: nn.Module | None
    """(B, T, D) → (B,) logits that a window was recorded; None: there is none."""

    def collect_training_inputs(self, batch: Batch, seed_dropout: float) -> Any:
        """A batch as inputs of the network."""
        raise NotImplementedError

    def _generate(self, inputs: Any, noise: Tensor) -> SampledWindows:
        """``noise``: (B, T or 1, width of z) of N(0, 1), ε."""
        raise NotImplementedError

    def _diversity(self, batch: Batch, inputs: Any, sample: SampledWindows) -> Tensor:
        """How much the motion of another, random speaker differs, relative to the difference of z."""
        raise NotImplementedError

    def _generate_in_training(self, batch: Batch, inputs: Any) -> SampledWindows:
        """As `_generate`, with one random ε for each window."""
        return self._generate(inputs, batch.chance.normal(len(batch), 1, self.config.speaker))

    def generator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Of G, weighted; moves all but the discriminator."""
        c = self.config
        inputs = self.collect_training_inputs(batch, c.seed_dropout)
        sample = self._generate_in_training(batch, inputs)
        terms = {"huber": c.reconstruction * F.smooth_l1_loss(sample.pose, batch["pose"], beta=c.beta)}
        terms |= timing_term(c.stroke_timing, sample.pose.mT, batch["pose"].mT)
        if self.discriminator is not None and step >= c.adversarial_from:
            terms["adversarial"] = c.adversarial * F.softplus(-self.discriminator(sample.pose)).mean()
        if c.diversity:
            terms["diversity"] = -c.diversity * self._diversity(batch, inputs, sample)
        if c.divergence:
            terms["divergence"] = c.divergence * kl_divergence(sample.mean, sample.variance)
        return terms

    def objectives(self) -> dict[str, Objective]:
        """The discriminator, from its first step on, and the generator; or the generator alone."""
        others = [value for name, value in self.named_parameters() if not name.startswith("discriminator.")]
        generator = {"generator": Objective(others, self.generator_loss)}
        if self.discriminator is None:
            return generator
        discriminator = Objective(self.discriminator.parameters(), self.discriminator_loss, start=self.config.adversarial_from)
        return {"discriminator": discriminator, **generator}

    def discriminator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Of D; moves the discriminator alone."""
        assert self.discriminator is not None
        with torch.no_grad():
            poses = self._generate_in_training(batch, self.collect_training_inputs(batch, self.config.seed_dropout)).pose
        true, false = self.discriminator(batch["pose"]), self.discriminator(poses)
        return {"true": F.softplus(-true).mean(), "false": F.softplus(false).mean()}
