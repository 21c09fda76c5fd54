"""Gesture autoencoders: feature networks of movement, for a loss (ω) and for a metric (FGD).

There is no inception network for gestures. Two convolutional autoencoders take its place; both minimise

    L = |x̂ − x|₁ + |Δx̂ − Δx|₁,   Δ the difference of successive frames, x̂ = decoder(encoder(x))

`GestureAutoencoder`, of which ω is "the 4-th layer" (Ye et al. 2022, section 3.3); its loss there is |ω(x̂) − ω(x)|₁:

    (B, T, D) ─►[conv 3 ─ BN ─ LReLU ─ conv 3]─► ω (B, T, 256) ─►[BN ─ LReLU ─ conv 3 …]─►[conv 4, stride 2 …] × 4 ─┐
                       (B, T, D) ◄─ conv 1 ◄─[conv 3 …] × 4 ◄─[×2 linear ─ conv 3 …] × n ◄─ code (B, 32) ◄─ mean ◄─┘

`FgdAutoencoder`, whose code is what FGD is taken of (Yoon et al. 2020):

    (B, 34, D) ─►[conv 3] × 2 ─►[conv 4, stride 2]─► conv 3 ─► (B, 32·12) ─►[256]─►[128]─► 32 ─► code (B, 32)
                      (B, 34, D) ◄─ conv 3 ◄─ conv 3 ◄─[conv 3, transposed] × 2 ◄─ (B, 4, 34) ◄─[64]◄─┘

BEAT (Liu et al. 2022) has the second in other sizes, with a code of 300 numbers, and squares in the place of |Δx̂ − Δx|₁, at a
tenth of the weight: recipes/fgd_beat.toml.

Followed, changed, not said in the papers: docs/models/gesture_autoencoder.md, by number. Neither goes into a runtime bundle:
they serve training and evaluation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from torch import Tensor, nn
from torch.nn import functional as F

from .nn.configuration import SMALL_FLOW, ModelConfig
from .nn.norm import BatchNorm1d, batch_norm
from .nn.objective import Batch, Objective
from .nn.settings import check_least
from .nn.trainable import Trainable

__all__ = ["AutoencoderConfig", "FgdAutoencoder", "FgdConfig", "GestureAutoencoder", "Omega"]

SLOPE = 0.2  # of LeakyReLU; both authors' code
HALVINGS = 4  # convolutions of stride 2 in the encoder; flow paper: not stated, authors' code 4
SHORTEST = 16  # frames that four halvings leave one of


@dataclass(frozen=True)
class AutoencoderConfig(ModelConfig):
    """Sizes of `GestureAutoencoder`; the paper gives none, the defaults are the authors' code's for TED."""

    TINY: ClassVar[Mapping[str, Any]] = {"width": 8, "code": 4}
    SMALL: ClassVar[Mapping[str, Any]] = {"width": 64, "frames": 30}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = {**SMALL_FLOW, "batch": 64}

    frames: int = 30
    """T of a training window; ω takes windows of any length."""
    width: int = 256
    """Channels of the convolutions, and of ω."""
    code: int = 32
    """Width of the code."""
    batch_statistics: bool = False
    """Whether ω, as a loss, normalises by the statistics of its batch, as in the authors' code; else by those of training."""


@dataclass(frozen=True)
class FgdConfig(ModelConfig):
    """Sizes of `FgdAutoencoder`; the paper gives none but the length, the defaults are the authors' code's.

    The decoder's are of the code's: a dense layer of 2 · code, then ⌊code / 8⌋ channels; authors' code, and BEAT's.
    """

    TINY: ClassVar[Mapping[str, Any]] = {"channels": 4, "code": 4}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = {**SMALL_FLOW, "steps": 2000, "batch": 64}

    frames: int = 34
    """T of a window; Yoon et al. 2020 (2.27 s at their 15 frames per second)."""
    channels: int = 32
    """Of the first and last convolution of the encoder, and of the decoder's; those between have twice as many."""
    hidden: int = 256
    """Of the encoder's first fully connected layer; the second has half of it."""
    code: int = 32
    """Width of the code."""
    dense_slope: float = 1.0
    """Of the LeakyReLU after fully connected layers; authors' ``LeakyReLU(True)`` is a slope of 1, which is none at all."""
    widening: int = 1
    """Width of the decoder's last convolution but one, in ``channels``; BEAT's code 2."""
    difference: float = 1.0
    """Weight of |Δx̂ − Δx|₁; BEAT's code 0."""
    velocity: float = 0.0
    """Weight of |Δx̂ − Δx|₂², which takes the place of that term in BEAT's code, there 0.1."""


def _block(inputs: int, outputs: int, kernel: int = 3, stride: int = 1, padding: int = 1, bias: bool = False) -> nn.Sequential:
    """Convolution, batch norm, leaky ReLU; (B, C, T) throughout."""
    conv = nn.Conv1d(inputs, outputs, kernel, stride, padding, bias=bias)
    return nn.Sequential(conv, BatchNorm1d(outputs), nn.LeakyReLU(SLOPE))


def _loss(output: Tensor, x: Tensor) -> dict[str, Tensor]:
    """The two terms that both networks minimise, and one that may replace the second; (B, T, D) each."""
    difference = output.diff(dim=1) - x.diff(dim=1)
    return {"l1": (output - x).abs().mean(), "l1_difference": difference.abs().mean(), "velocity": difference.square().mean()}


class Omega(nn.Module):
    """ω: convolution, batch norm, leaky ReLU, convolution; (B, T, D) → (B, T, width), five frames seen by each."""

    def __init__(self, pose: int, width: int, batch_statistics: bool) -> None:
        super().__init__()
        self.first = nn.Conv1d(pose, width, 3, padding=1, bias=False)
        self.norm = BatchNorm1d(width)
        self.second = nn.Conv1d(width, width, 3, padding=1, bias=False)
        self.batch_statistics = batch_statistics

    def forward(self, x: Tensor) -> Tensor:
        y = self.first(x.transpose(1, 2))
        if self.batch_statistics and not self.training:  # as a loss: the batch's statistics, none of which is kept
            y = batch_norm(y, self.norm.weight, self.norm.bias, self.norm.eps)
        else:
            y = self.norm(y)
        y = self.second(F.leaky_relu(y, SLOPE))
        return y.transpose(1, 2)


class GestureAutoencoder(Trainable):
    """The extractor of the gesture perceptual loss; poses are standardised vectors.

    Args:
        config: sizes.
        pose: D, numbers of a pose.
        audio: not heard.
    """

    arrays = ("pose",)
    Config = AutoencoderConfig
    config: AutoencoderConfig

    def __init__(self, config: AutoencoderConfig, *, pose: int, audio: int = 0) -> None:
        super().__init__()
        sizes = {"frames": SHORTEST, "width": 1, "code": 1, "pose": 1}
        check_least(vars(config) | {"pose": pose}, "a gesture autoencoder", sizes)
        self.config, self.pose = config, pose
        width = config.width
        self.omega = Omega(pose, width, config.batch_statistics)
        self.omega_norm = BatchNorm1d(width)
        halving = [_block(width, width, kernel=4, stride=2) for _ in range(HALVINGS - 1)]
        self.encoder = nn.Sequential(_block(width, width), *halving, _block(width, config.code, kernel=4, stride=2))
        doublings = max(1, (config.frames + 1).bit_length() - 1)  # the least n with 2 · 2ⁿ ≥ T + 2
        self.growing = nn.ModuleList(_block(width if k else config.code, width) for k in range(doublings))
        self.decoder = nn.Sequential(_block(width, width, padding=0), *(_block(width, width) for _ in range(3)))
        self.out = nn.Conv1d(width, pose, 1)
        for part in self.modules():
            if isinstance(part, nn.Conv1d) and part is not self.out:
                nn.init.kaiming_normal_(part.weight)

    def encode(self, x: Tensor) -> Tensor:
        """(B, T, D) → (B, code), for T ≥ 16."""
        y = F.leaky_relu(self.omega_norm(self.omega(x).transpose(1, 2)), SLOPE)
        code: Tensor = self.encoder(y).mean(-1)
        return code

    def decode(self, code: Tensor) -> Tensor:
        """(B, code) → (B, T, D), T being the configuration's."""
        y = code.unsqueeze(-1).expand(-1, -1, 2)
        for block in self.growing:
            y = block(F.interpolate(y, scale_factor=2, mode="linear", align_corners=True))
        y = self.decoder(y[..., : self.config.frames + 2])
        x: Tensor = self.out(y).transpose(1, 2)
        return x

    def forward(self, x: Tensor) -> Tensor:
        """ω, the features of the perceptual loss: (B, T, D) → (B, T, width)."""
        features: Tensor = self.omega(x)
        return features

    def objectives(self) -> dict[str, Objective]:
        """One: reconstruction."""
        return {"autoencoder": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L of the module's docstring."""
        x = batch.arrays["pose"]
        terms = _loss(self.decode(self.encode(x)), x)
        return {name: terms[name] for name in ("l1", "l1_difference")}


class FgdAutoencoder(Trainable):
    """The feature network of FGD; poses are standardised vectors, a window has as many frames as the configuration says.

    Args:
        config: sizes.
        pose: D, numbers of a pose.
        audio: not heard.
    """

    arrays = ("pose",)
    Config = FgdConfig
    config: FgdConfig

    def __init__(self, config: FgdConfig, *, pose: int, audio: int = 0) -> None:
        super().__init__()
        sizes = {"frames": SHORTEST, "channels": 1, "hidden": 2, "code": 1, "widening": 1, "pose": 1}
        low = sizes | {"difference": 0, "velocity": 0}
        check_least(vars(config) | {"pose": pose}, "an autoencoder for FGD", low)
        self.config, self.pose = config, pose
        few, many = config.channels, 2 * config.channels
        self.convolutions = nn.Sequential(
            _block(pose, few, padding=0, bias=True),
            _block(few, many, padding=0, bias=True),
            _block(many, many, kernel=4, stride=2, padding=0, bias=True),
            nn.Conv1d(many, few, 3),
        )
        frames = (config.frames - 4 - 4) // 2 + 1 - 2  # 34 frames → 12
        self.dense = nn.Sequential(
            *self._dense(few * frames, config.hidden),
            *self._dense(config.hidden, config.hidden // 2),
            nn.Linear(config.hidden // 2, config.code),
            nn.Linear(config.code, config.code),
        )
        self.first, last = max(1, config.code // 8), config.widening * few
        self.spread = nn.Sequential(
            *self._dense(config.code, 2 * config.code), nn.Linear(2 * config.code, self.first * config.frames)
        )
        self.decoder = nn.Sequential(
            nn.ConvTranspose1d(self.first, few, 3), BatchNorm1d(few), nn.LeakyReLU(SLOPE),
            nn.ConvTranspose1d(few, few, 3), BatchNorm1d(few), nn.LeakyReLU(SLOPE),
            nn.Conv1d(few, last, 3), nn.Conv1d(last, pose, 3),
        )  # fmt: skip

    def _dense(self, inputs: int, outputs: int) -> list[nn.Module]:
        return [nn.Linear(inputs, outputs), BatchNorm1d(outputs), nn.LeakyReLU(self.config.dense_slope)]

    @property
    def window(self) -> int:
        """Frames of a window."""
        return self.config.frames

    def encode(self, x: Tensor) -> Tensor:
        """(B, T, D) → (B, code): the features of FGD."""
        code: Tensor = self.dense(self.convolutions(x.transpose(1, 2)).flatten(1))
        return code

    def decode(self, code: Tensor) -> Tensor:
        """(B, code) → (B, T, D)."""
        x: Tensor = self.decoder(self.spread(code).unflatten(1, (self.first, self.config.frames)))
        return x.transpose(1, 2)

    def forward(self, x: Tensor) -> Tensor:
        """The features: (B, T, D) → (B, code)."""
        return self.encode(x)

    def objectives(self) -> dict[str, Objective]:
        """One: reconstruction."""
        return {"autoencoder": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L of the module's docstring, weighted."""
        x = batch.arrays["pose"]
        terms = _loss(self.decode(self.encode(x)), x)
        weights = {"l1": 1.0, "l1_difference": self.config.difference, "velocity": self.config.velocity}
        return {name: weights[name] * term for name, term in terms.items() if weights[name]}
