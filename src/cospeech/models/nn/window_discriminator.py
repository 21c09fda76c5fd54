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

    def forward(self, encoded: Tensor) -> Tensor:
        scores: Tensor = self.of_all(self.of_frames(self.both_ways(encoded)).squeeze(1)).squeeze(1)
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
    ``beta`` of the Huber loss, ``speaker``, the width of z, and ``adversarial_from``, the step from which on the discriminator
    judges.
    """

    discriminator: nn.Module | None
    """(B, T, D) → (B,) logits that a window was recorded; None: there is none."""

    def collect_training_inputs(self, batch: Batch, seed_dropout: float) -> Any:
        """A batch as inputs of the network."""
        raise NotImplementedError

    def _generate(self, given: Any, noise: Tensor) -> SampledWindows:
        """``noise``: (B, T or 1, width of z) of N(0, 1), ε."""
        raise NotImplementedError

    def _diversity(self, batch: Batch, given: Any, made: SampledWindows) -> Tensor:
        """How differently another speaker, drawn of all, would move, for so much difference of z."""
        raise NotImplementedError

    def _generate_in_training(self, batch: Batch, given: Any) -> SampledWindows:
        """With ε drawn, one for a window."""
        return self._generate(given, batch.chance.normal(len(batch), 1, self.config.speaker))

    def generator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Of G, weighted; moves all but the discriminator."""
        c = self.config
        given = self.collect_training_inputs(batch, c.seed_dropout)
        made = self._generate_in_training(batch, given)
        terms = {"huber": c.reconstruction * F.smooth_l1_loss(made.pose, batch["pose"], beta=c.beta)}
        terms |= timing_term(c.stroke_timing, made.pose.mT, batch["pose"].mT)
        if self.discriminator is not None and step >= c.adversarial_from:
            terms["adversarial"] = c.adversarial * F.softplus(-self.discriminator(made.pose)).mean()
        if c.diversity:
            terms["diversity"] = -c.diversity * self._diversity(batch, given, made)
        if c.divergence:
            terms["divergence"] = c.divergence * kl_divergence(made.mean, made.variance)
        return terms

    def objectives(self) -> dict[str, Objective]:
        """Discriminator, from the step on at which it begins, and generator; or the generator alone."""
        maker = [value for name, value in self.named_parameters() if not name.startswith("discriminator.")]
        generator = {"generator": Objective(maker, self.generator_loss)}
        if self.discriminator is None:
            return generator
        judge = Objective(self.discriminator.parameters(), self.discriminator_loss, start=self.config.adversarial_from)
        return {"discriminator": judge, **generator}

    def discriminator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Of D; moves the discriminator alone."""
        assert self.discriminator is not None
        with torch.no_grad():
            made = self._generate_in_training(batch, self.collect_training_inputs(batch, self.config.seed_dropout)).pose
        true, false = self.discriminator(batch["pose"]), self.discriminator(made)
        return {"true": F.softplus(-true).mean(), "false": F.softplus(false).mean()}
