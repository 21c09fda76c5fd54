"""Speech2Gesture: Ginosar et al. 2019, "Learning Individual Styles of Conversational Gesture", in the one-dimensional form that
Ahuja et al. 2020 (Mix-StAGE) compare with: one network per speaker, speech in, the poses of the same frames out.

    (B, T, A) log-mel ─►[conv 3×3, conv 4×4 stride 2] × 3 ─► conv 3×3 ─► conv 3×A/8 ─► linear in time to T ─► (B, 256, T)
                                                                                                                  │
      (B, T, D) ŷ ◄─ conv 1 ◄─[conv 3] × 4 ◄─ U-Net, five halvings of time, skips added ◄─────────────────────────┘
          │
          └─► Δŷ or Δy ─►[conv 4 stride 2 …]─► a score per patch of 34 frames: a real motion, or one that was made?

What is optimised, with the least squares of the authors' code:

    min_D   E (D(Δy) − 1)² + λ_D E D(Δŷ)²                    y poses, ŷ = G(speech), Δ from one frame to the next
    min_G   E |ŷ − y|₁     + λ_G E (D(Δŷ) − 1)²

Followed, changed, not said in the paper: docs/models/speech2gesture.md, by number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..errors import InputError
from .nn.adversarial_losses import ADVERSARIAL_LOSSES
from .nn.configuration import ModelConfig
from .nn.content import AudioContent
from .nn.objective import Batch, Objective
from .nn.patch import PATCH_FRAMES, PatchDiscriminator, velocity
from .nn.settings import check_least
from .nn.unet1d import UNet1d, conv_block
from .nn.windowed import Windowed

__all__ = ["Speech2Gesture", "Speech2GestureConfig"]

HEARD = 3  # times that the speech encoder halves time
_LOSS = ADVERSARIAL_LOSSES["squares"]  # authors' code


@dataclass(frozen=True)
class Speech2GestureConfig(ModelConfig):
    """Sizes; the defaults are those of the form in Mix-StAGE's code."""

    TINY: ClassVar[Mapping[str, Any]] = {"channels": 8, "discriminator_channels": 4}

    frames: int = 64
    """T of a training window; authors' code 64, at 15 per second (4.3 s)."""
    channels: int = 256
    """Of U-Net and decoder; authors' code and Mix-StAGE's 256. The speech encoder has 1/4, 1/2 and all of them."""
    depth: int = 5
    """Halvings of time in the U-Net; Mix-StAGE's code 5 (T is filled up to a multiple of 2^depth)."""
    decoder: int = 4
    """Convolutions after the U-Net; Mix-StAGE's code 4."""
    discriminator_channels: int = 64
    """Channels of the discriminator's first convolution, doubled in each that follows; authors' code 64."""
    adversarial: float = 1.0
    """λ_G; authors' code 1. 0 trains by L₁ alone."""
    fake: float = 1.0
    """λ_D; authors' code 1."""

    def __post_init__(self) -> None:
        low = {
            "frames": PATCH_FRAMES,
            "channels": 4,
            "depth": 1,
            "decoder": 0,
            "discriminator_channels": 1,
            "adversarial": 0,
            "fake": 0,
        }
        check_least(self, "a Speech2Gesture", low)


# the model ----------------------------------------------------------------------------------------------------------


class Speech2Gesture(Windowed):
    """Speech2Gesture (Ginosar et al. 2019): one motion for one speech, of one speaker.

    Poses and audio are standardised vectors.

    Args:
        config: sizes.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech.
    """

    Config = Speech2GestureConfig
    config: Speech2GestureConfig

    def __init__(self, config: Speech2GestureConfig, *, pose: int, audio: int) -> None:
        super().__init__()
        if min(pose, audio) < 1:
            raise InputError(f"a Speech2Gesture from {audio} numbers of speech to {pose} of a pose", "both are positive")
        self.config, self.pose, self.audio = config, pose, audio
        self.multiple = self.shortest = 2 ** max(HEARD, config.depth)
        self.styles = self.modes = 0
        self.encoder = AudioContent(config.channels)
        self.unet = UNet1d(config.channels, config.depth)
        self.decoder = nn.Sequential(*(conv_block(config.channels, config.channels) for _ in range(config.decoder)))
        self.out = nn.Conv1d(config.channels, pose, 1)
        self.discriminator = PatchDiscriminator(pose, config.discriminator_channels)

    def forward(self, audio: Tensor) -> Tensor:
        """G: (B, T, A) → (B, T, D), for T of any length: the last frame is repeated until it can be halved so often."""
        frames = audio.shape[1]
        filled = F.pad(audio.mT, (0, -frames % self.multiple), mode="replicate").mT
        return self._poses(filled)[:, :frames]

    def _poses(self, audio: Tensor) -> Tensor:
        made: Tensor = self.out(self.decoder(self.unet(self.encoder(audio)))).mT
        return made

    def discriminate(self, poses: Tensor) -> Tensor:
        """D(Δ): the scores of the patches of a motion, (B, T, D) → (B, T / 4 − 4); 12 for 64 frames."""
        scores: Tensor = self.discriminator(velocity(poses.mT))
        return scores

    # what is optimised ----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """Two, in every step the discriminator first (authors' code: one step of each in turn)."""
        judge = [*self.discriminator.parameters()]
        known = {id(p) for p in judge}
        maker = [p for p in self.parameters() if id(p) not in known]
        return {"discriminator": Objective(judge, self.discriminator_loss), "generator": Objective(maker, self.generator_loss)}

    def discriminator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Least squares of the discriminator: real motions towards 1, those made towards 0; moves the discriminator alone."""
        with torch.no_grad():
            made = self(batch["audio"])
        return {
            "real": _LOSS.true(self.discriminate(batch["pose"])),
            "made": self.config.fake * _LOSS.false(self.discriminate(made)),
        }

    def generator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Poses near the real ones, motions that the discriminator takes for real; moves all but the discriminator."""
        made = self(batch["audio"])
        terms = {"l1": (made - batch["pose"]).abs().mean()}
        if self.config.adversarial:
            terms["adversarial"] = self.config.adversarial * _LOSS.generator_loss(self.discriminate(made))
        return terms

    # generation -----------------------------------------------------------------------------------------------------

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor) -> Tensor:
        """(B, T, A) → (B, T, D); there is no style to choose and no mode."""
        return self._poses(audio)
