"""Speech2Gesture: Ginosar et al. 2019, "Learning Individual Styles of Conversational Gesture", in the one-dimensional form that
Ahuja et al. 2020 (Mix-StAGE) compare with: one network per speaker, speech in, the poses of the same frames out.

    (B, T, A) log-mel ─►[conv 3×3, conv 4×4 stride 2] × 3 ─► conv 3×3 ─► conv 3×A/8 ─► linear in time to T ─► (B, 256, T)
                                                                                                                  │
      (B, T, D) ŷ ◄─ conv 1 ◄─[conv 3] × 4 ◄─ U-Net, five halvings of time, skips added ◄─────────────────────────┘
          │
          └─► Δŷ or Δy ─►[conv 4 stride 2 …]─► a score per patch of 34 frames: a real motion, or a generated one?

Optimised, with the least squares of the authors' code:

    min_D   E (D(Δy) − 1)² + λ_D E D(Δŷ)²                    y poses, ŷ = G(speech), Δ from one frame to the next
    min_G   λ E |ŷ − y|₁   + λ_G E (D(Δŷ) − 1)²

Where the first poses of a window are given (Yoon et al. 2020), an MLP makes 16 numbers of four of them. They join the output
of the U-Net at every frame.

Followed, changed, not said in the paper: docs/models/speech2gesture.md, by number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..errors import InputError
from .nn.adversarial_losses import ADVERSARIAL_LOSSES
from .nn.configuration import SMALL_CONVOLUTIONS, ModelConfig
from .nn.content import AudioContent
from .nn.modalities import SEEDS
from .nn.norm import BatchNorm1d
from .nn.objective import Batch, Objective
from .nn.patch import PATCH_FRAMES, PatchDiscriminator, velocity
from .nn.seeded_windows import SeededWindows, WindowInputs
from .nn.settings import check_least
from .nn.speed_distance import timing_term
from .nn.unet1d import UNet1d, conv_block

__all__ = ["Speech2Gesture", "Speech2GestureConfig"]

SPEECH_HALVINGS = 3  # halvings of time in the speech encoder
SEED_HIDDEN = 32  # of the MLP of known poses; Yoon et al. 2020, authors' code
_LOSS = ADVERSARIAL_LOSSES["squares"]  # authors' code


@dataclass(frozen=True)
class Speech2GestureConfig(ModelConfig):
    """Sizes; the defaults are those of the form in Mix-StAGE's code."""

    TINY: ClassVar[Mapping[str, Any]] = {"channels": 8, "discriminator_channels": 4}
    SMALL: ClassVar[Mapping[str, Any]] = {"channels": 16, "discriminator_channels": 16}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_CONVOLUTIONS

    frames: int = 64
    """T of a training window; authors' code 64, at 15 per second (4.3 s)."""
    channels: int = 256
    """Of U-Net and decoder; authors' code and Mix-StAGE's 256. The speech encoder has 1/4, 1/2 and all of them."""
    depth: int = 5
    """Halvings of time in the U-Net; Mix-StAGE's code 5 (T is filled up to a multiple of 2^depth)."""
    decoder: int = 4
    """Convolutions after the U-Net; Mix-StAGE's code 4."""
    seed: int = 0
    """Numbers that an MLP makes of the known poses of a window; Yoon et al. 2020 16. 0: no known poses, as published."""
    discriminator_channels: int = 64
    """Channels of the discriminator's first convolution, doubled in each that follows; authors' code 64."""
    regression: float = 1.0
    """λ; authors' code 1, Yoon et al. 2020 100."""
    adversarial: float = 1.0
    """λ_G; authors' code 1. 0 trains by L₁ alone."""
    fake: float = 1.0
    """λ_D; authors' code 1."""
    stroke_timing: float = 0.0
    """Weight of the distance in time of rises and falls of the speed from the recorded ones; ours, as published 0."""

    def __post_init__(self) -> None:
        low = {
            "frames": PATCH_FRAMES,
            "channels": 4,
            "depth": 1,
            "decoder": 0,
            "seed": 0,
            "regression": 0,
            "discriminator_channels": 1,
            "adversarial": 0,
            "fake": 0,
            "stroke_timing": 0,
        }
        check_least(self, "a Speech2Gesture", low)


def _pose_mlp(pose: int, width: int) -> nn.Sequential:
    """(B, 4 · D) → (B, width)."""
    return nn.Sequential(
        nn.Linear(SEEDS * pose, SEED_HIDDEN), BatchNorm1d(SEED_HIDDEN), nn.ReLU(), nn.Linear(SEED_HIDDEN, width)
    )


# the model ----------------------------------------------------------------------------------------------------------


class Speech2Gesture(SeededWindows):
    """Speech2Gesture (Ginosar et al. 2019): one motion for one speech, of one speaker.

    Poses and audio are standardised vectors.

    Args:
        config: sizes.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech.
    """

    arrays = ("pose", "audio")
    optional_arrays = ()
    Config = Speech2GestureConfig
    config: Speech2GestureConfig

    def __init__(self, config: Speech2GestureConfig, *, pose: int, audio: int) -> None:
        super().__init__()
        if min(pose, audio) < 1:
            raise InputError(f"a Speech2Gesture from {audio} numbers of speech to {pose} of a pose", "both are positive")
        self.config = config
        self.measure(pose, audio)
        self.whole = 2 ** max(SPEECH_HALVINGS, config.depth)  # frames that the halvings of time divide
        self.seeds = SEEDS if config.seed else 0
        self.cut = bool(self.seeds)  # windows that begin with known poses are played as long as they were in training
        self.multiple = self.shortest = config.frames if self.cut else self.whole
        self.encoder = AudioContent(config.channels)
        self.unet = UNet1d(config.channels, config.depth)
        widths = (config.channels + config.seed, *[config.channels] * config.decoder)
        self.decoder = nn.Sequential(*(conv_block(a, b) for a, b in pairwise(widths)))
        self.out = nn.Conv1d(widths[-1], pose, 1)
        self.known = _pose_mlp(pose, config.seed) if config.seed else None
        self.discriminator = PatchDiscriminator(pose, config.discriminator_channels)

    def forward(self, audio: Tensor, seed: Tensor | None = None) -> Tensor:
        """G: (B, T, A), (B, T, D + 1) known poses → (B, T, D), for T of any length: the last frame is repeated up to the next
        multiple of `whole`."""
        frames = audio.shape[1]
        rows = F.pad(audio.mT, (0, -frames % self.whole), mode="replicate").mT
        return self._poses(rows, seed)[:, :frames]

    def poses(self, inputs: WindowInputs, noise: Tensor) -> Tensor:
        """See `SeededWindows`; there is no noise."""
        return self(inputs.audio, inputs.seed)

    def _poses(self, audio: Tensor, seed: Tensor | None) -> Tensor:
        features = self.unet(self.encoder(audio))
        if self.known is not None:
            first = features.new_zeros(len(features), SEEDS, self.pose) if seed is None else seed[:, :SEEDS, :-1]
            code = self.known(first.flatten(1)).unsqueeze(2) + 0 * features[:, :1]  # the same at every frame
            features = torch.cat([features, code], 1)
        poses: Tensor = self.out(self.decoder(features)).mT
        return poses

    def discriminate(self, poses: Tensor) -> Tensor:
        """D(Δ): the scores of the patches of a motion, (B, T, D) → (B, T / 4 − 4); 12 for 64 frames."""
        scores: Tensor = self.discriminator(velocity(poses.mT))
        return scores

    # what is optimised ----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """Two, in every step the discriminator first (authors' code: one step of each in turn)."""
        own = [*self.discriminator.parameters()]
        own_ids = {id(p) for p in own}
        rest = [p for p in self.parameters() if id(p) not in own_ids]
        return {"discriminator": Objective(own, self.discriminator_loss), "generator": Objective(rest, self.generator_loss)}

    def discriminator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Least squares of the discriminator: real motions towards 1, generated ones towards 0; trains it alone."""
        with torch.no_grad():
            poses = self.poses(self.collect_inputs(batch.arrays), batch["pose"][..., :0])
        return {
            "real": _LOSS.true(self.discriminate(batch["pose"])),
            "made": self.config.fake * _LOSS.false(self.discriminate(poses)),
        }

    def generator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Distance to the real poses, and score of the motion by the discriminator; it trains all but the discriminator."""
        poses = self.poses(self.collect_inputs(batch.arrays), batch["pose"][..., :0])
        terms = {"l1": self.config.regression * (poses - batch["pose"]).abs().mean()}
        terms |= timing_term(self.config.stroke_timing, poses.mT, batch["pose"].mT)
        if self.config.adversarial:
            terms["adversarial"] = self.config.adversarial * _LOSS.generator_loss(self.discriminate(poses))
        return terms

    # generation -----------------------------------------------------------------------------------------------------

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor, seed: Tensor | None = None) -> Tensor:
        """(B, T, A), (B, T, D + 1) known poses → (B, T, D); there is no style to choose and no mode."""
        return super().make(audio, style, mode_noise, seed) if self.cut else self._poses(audio, seed)
