"""Losses of a discriminator's scores: the discriminator's own, of true and of generated poses, and the generator's."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from torch import Tensor
from torch.nn import functional as F

__all__ = ["ADVERSARIAL_LOSSES", "AdversarialLoss"]

Loss = Callable[[Tensor], Tensor]


class AdversarialLoss(NamedTuple):
    """Three losses of scores of any shape: their means.

    Args:
        true: of D, for poses of people.
        false: of D, for generated poses.
        generator_loss: of the generator, for generated poses.
    """

    true: Loss
    false: Loss
    generator_loss: Loss


ADVERSARIAL_LOSSES: dict[str, AdversarialLoss] = {
    "logarithm": AdversarialLoss(
        lambda s: F.softplus(-s).mean(), lambda s: F.softplus(s).mean(), lambda s: -F.softplus(s).mean()
    ),
    "distance": AdversarialLoss(lambda s: (s - 1).abs().mean(), lambda s: s.abs().mean(), lambda s: (s - 1).abs().mean()),
    "squares": AdversarialLoss(
        lambda s: (s - 1).square().mean(), lambda s: s.square().mean(), lambda s: (s - 1).square().mean()
    ),
}
"""``logarithm``: log D and log(1 − D), D the sigmoid of a score (Goodfellow et al. 2014; Mix-StAGE, equation 7); ``distance``:
L1 to 1 and 0 (Mix-StAGE, authors' code); ``squares``: the squared distance (Mao et al. 2017; Speech2Gesture)."""
