"""Speaker classifier: the speaker of a movement, for the inception score of Mix-StAGE (Ahuja et al. 2020, section 5.2).

    (B, T, D) ─►[conv 4, stride 2 ─ BN ─ ReLU] × 6 ─► (B, S, T / 64) ─► mean over time ─► logits (B, S)

trained on recorded poses by cross-entropy. Channels 64, 128, 128, 256, 256, S, as in the authors' code, where the last
convolution too has batch norm and ReLU. It serves evaluation: `cospeech.training.feature_networks.load_classifier`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .nn.configuration import ModelConfig
from .nn.norm import BatchNorm1d
from .nn.objective import Batch, Objective
from .nn.settings import check_least
from .nn.trainable import Trainable

__all__ = ["SpeakerClassifier", "SpeakerClassifierConfig"]

SHORTEST = 64  # the least number of frames of which six halvings leave one


@dataclass(frozen=True)
class SpeakerClassifierConfig(ModelConfig):
    """Sizes; the defaults are those of the authors' code of Mix-StAGE."""

    TINY: ClassVar[Mapping[str, Any]] = {"channels": 4}
    SMALL: ClassVar[Mapping[str, Any]] = {"channels": 16, "plain": True}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = {"steps": 1200, "validate_every": 150, "save_every": 1200}

    frames: int = 64
    """T of a training window, and of a window of the score; authors' code 64 (4.3 s at 15 frames per second)."""
    channels: int = 64
    """Of the first convolution; twice as many in the next two, four times as many in the two after. Authors' code 64."""
    plain: bool = False
    """Whether the last convolution gives the logits as they are: ours, as the authors' form cannot be certain of few speakers.
    Authors' code: false, batch norm and ReLU follow."""


class SpeakerClassifier(Trainable):
    """Estimates who moves; poses are standardised vectors.

    Args:
        config: sizes.
        pose: D, numbers of a pose.
        speakers: S, classes.

    Raises:
        InputError: sizes that are not positive, or one speaker.
    """

    arrays = ("pose",)
    dimensions = ("pose", "speakers")
    Config = SpeakerClassifierConfig
    config: SpeakerClassifierConfig

    def __init__(self, config: SpeakerClassifierConfig, *, pose: int, speakers: int) -> None:
        super().__init__()
        sizes = {"frames": SHORTEST, "channels": 1, "pose": 1, "speakers": 2}
        check_least(vars(config) | {"pose": pose, "speakers": speakers}, f"a classifier of {speakers} speakers", sizes)
        self.config, self.pose, self.speakers = config, pose, speakers
        few = config.channels
        widths = (pose, few, 2 * few, 2 * few, 4 * few, 4 * few)
        last = _halve(widths[-1], speakers) if config.plain else _halving(widths[-1], speakers)
        self.blocks = nn.Sequential(*(_halving(a, b) for a, b in pairwise(widths)), last)

    def forward(self, poses: Tensor) -> Tensor:
        """(B, T, D), T ≥ 64, → (B, S) logits."""
        logits: Tensor = self.blocks(poses.mT).mean(-1)
        return logits

    @torch.no_grad()
    def probabilities(self, poses: Tensor) -> Tensor:
        """(B, T, D), T ≥ 64, → (B, S), which sum to 1."""
        return torch.softmax(self(poses), 1)

    def objectives(self) -> dict[str, Objective]:
        """One."""
        return {"classifier": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Cross-entropy."""
        return {"cross_entropy": F.cross_entropy(self(batch["pose"]), batch["speaker"])}

    def validate(self, batch: Batch) -> dict[str, Tensor]:
        """The cross-entropy, and the share of windows that are classified as another speaker's."""
        logits, speaker = self(batch["pose"]), batch["speaker"]
        return {"cross_entropy": F.cross_entropy(logits, speaker), "error": (logits.argmax(1) != speaker).float().mean()}


def _halve(inputs: int, outputs: int) -> nn.Conv1d:
    """(B, inputs, T) → (B, outputs, ⌊T / 2⌋)."""
    return nn.Conv1d(inputs, outputs, 4, 2, padding=1)


def _halving(inputs: int, outputs: int) -> nn.Sequential:
    """The same, with batch norm and ReLU."""
    return nn.Sequential(_halve(inputs, outputs), BatchNorm1d(outputs), nn.ReLU())
