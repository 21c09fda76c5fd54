"""MUNIT: Huang et al. 2018, "Multimodal Unsupervised Image-to-Image Translation", in one dimension, as Ahuja et al. 2020
(Mix-StAGE, section 5.1) compare with it: one domain is speech, the other poses; the losses are those of the images.

Each domain X has content encoder Eᶜ, style encoder Eˢ, decoder G and discriminator D. Both share the content. The rest is
style, a few numbers for a whole window; for a translation it is drawn from N(0, 1):

    audio (B, T, A) ─► Eᶜ ─► c (B, 4·channels, T/4) ──┐    ┌──► G of poses, residual blocks with AdaIN ─► (B, T, D) ─► D
    poses (B, T, D) ─► Eᶜ ─► c                        ├────┤
                  └──► Eˢ ─► s (B, style) ── MLP ─────┘    └──► G of audio, likewise ─► (B, T, A) ─► D

With x of one domain, (c, s) = E(x); c' the content of the other, s' ~ N(0, 1), and x̂ = G(c', s'):

    L = λₓ E |G(c, s) − x|₁ + λ_c E |Eᶜ(x̂) − c'|₁ + λ_s E |Eˢ(x̂) − s'|₁ + λ_cyc E |G'(Eᶜ(x̂), E'ˢ(x')) − x'|₁ + λ_D E (D(x̂) − 1)²

summed over both domains (a dash: of the other one), and for the discriminators E (D(x) − 1)² + E D(x̂)². No term compares
generated poses with the recorded poses of the same speech.

Followed, changed, not said in the papers: docs/models/munit.md, by number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..errors import InputError
from .nn.configuration import SMALL_CONVOLUTIONS, ModelConfig
from .nn.objective import Batch, Objective
from .nn.settings import check_least
from .nn.unet1d import SLOPE
from .nn.windowed import Windowed

__all__ = ["Munit", "MunitConfig"]

DOWN = 2  # halvings of time by the content encoder; authors' configuration 2
STYLE_DOWN = 4  # by the style encoder; authors' code 4
SCALES = 3  # of a discriminator; authors' configuration 3
DISCRIMINATOR_DOWN = 4  # convolutions with stride 2 at each scale; authors' configuration 4
SHORTEST = 2 ** (DISCRIMINATOR_DOWN + SCALES - 1)  # the least number of frames that leaves one score at the coarsest scale
LEAST_FRAMES = 4 * 2**DOWN  # that can be generated: fewer frames are too short, after the halvings, for reflected edges


@dataclass(frozen=True)
class MunitConfig(ModelConfig):
    """Sizes and weights; the defaults are those of the authors' configurations for images. Mix-StAGE's paper gives none."""

    TINY: ClassVar[Mapping[str, Any]] = {"channels": 4, "style": 2, "mlp": 8, "blocks": 1}
    SMALL: ClassVar[Mapping[str, Any]] = {"channels": 8, "mlp": 64, "blocks": 2}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_CONVOLUTIONS

    frames: int = 64
    """T of a training window; Mix-StAGE's 64."""
    channels: int = 64
    """Of the first convolution of everything; twice and four times as many follow. Authors' configuration 64."""
    style: int = 8
    """Numbers of a style; authors' configuration 8."""
    mlp: int = 256
    """Units of the network from style to AdaIN; authors' configuration 256."""
    blocks: int = 4
    """Residual blocks of content encoder and decoder; authors' configuration 4."""
    adversarial: float = 1.0
    """λ_D; authors' configuration 1."""
    same: float = 10.0
    """λₓ; authors' configuration 10."""
    content_back: float = 1.0
    """λ_c; authors' configuration 1."""
    style_back: float = 1.0
    """λ_s; authors' configuration 1."""
    cycle: float = 10.0
    """λ_cyc; authors' configuration 10."""

    def __post_init__(self) -> None:
        low = {"frames": SHORTEST, "channels": 1, "style": 1, "mlp": 1, "blocks": 1}
        low |= {"adversarial": 0, "same": 0, "content_back": 0, "style_back": 0, "cycle": 0}
        check_least(self, "a MUNIT", low)
        if self.frames % 2**DOWN:
            raise InputError(f"windows of {self.frames} frames for a MUNIT", f"a multiple of {2**DOWN}")


# the parts ----------------------------------------------------------------------------------------------------------


def _conv(inputs: int, outputs: int, kernel: int, stride: int = 1, bias: bool = True) -> nn.Conv1d:
    """Convolution with reflected edges: (B, C, T) → (B, C', T / stride); no bias where an instance norm takes it away."""
    return nn.Conv1d(inputs, outputs, kernel, stride, (kernel - 1) // 2, bias=bias, padding_mode="reflect")


class _ResidualBlock(nn.Module):
    """x + norm(conv(ReLU(norm(conv(x))))), the norm that of each row and channel over time; with AdaIN, scaled and moved."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = _conv(channels, channels, 3, bias=False)
        self.second = _conv(channels, channels, 3, bias=False)

    def forward(self, x: Tensor, adain: Tensor | None = None) -> Tensor:
        """(B, C, T), and (B, 4, C) shift and scale after the first convolution and after the second."""
        y = F.instance_norm(self.first(x))
        y = torch.relu(y if adain is None else y * adain[:, 1, :, None] + adain[:, 0, :, None])
        z = F.instance_norm(self.second(y))
        return x + (z if adain is None else z * adain[:, 3, :, None] + adain[:, 2, :, None])


class _ContentEncoder(nn.Module):
    """(B, X, T) → (B, 4·channels, T / 4); instance norms take the style away."""

    def __init__(self, inputs: int, channels: int, blocks: int) -> None:
        super().__init__()
        self.first = _conv(inputs, channels, 7, bias=False)
        self.down = nn.ModuleList(_conv(channels << k, channels << k + 1, 4, 2, bias=False) for k in range(DOWN))
        self.blocks = nn.Sequential(*(_ResidualBlock(channels << DOWN) for _ in range(blocks)))

    def forward(self, x: Tensor) -> Tensor:
        x = torch.relu(F.instance_norm(self.first(x)))
        for conv in self.down:
            x = torch.relu(F.instance_norm(conv(x)))
        content: Tensor = self.blocks(x)
        return content


class _StyleEncoder(nn.Sequential):
    """(B, X, T) → (B, style, 1): the mean over time of features that no norm has touched."""

    def __init__(self, inputs: int, channels: int, style: int) -> None:
        widths = [channels << min(k, DOWN) for k in range(STYLE_DOWN + 1)]
        layers: list[nn.Module] = [_conv(inputs, channels, 7), nn.ReLU()]
        for few, many in pairwise(widths):
            layers += [_conv(few, many, 4, 2), nn.ReLU()]
        super().__init__(*layers, nn.AdaptiveAvgPool1d(1), nn.Conv1d(widths[-1], style, 1))


class _Decoder(nn.Module):
    """Content (B, 4·channels, T / 4) and style (B, S) → (B, X, T)."""

    def __init__(self, outputs: int, config: MunitConfig) -> None:
        super().__init__()
        wide = config.channels << DOWN
        self.blocks = nn.ModuleList(_ResidualBlock(wide) for _ in range(config.blocks))
        self.mlp = nn.Sequential(
            nn.Linear(config.style, config.mlp), nn.ReLU(), nn.Linear(config.mlp, config.mlp), nn.ReLU(),
            nn.Linear(config.mlp, config.blocks * 4 * wide),
        )  # fmt: skip
        layers: list[nn.Module] = []
        for few in (wide >> k + 1 for k in range(DOWN)):
            layers += [nn.Upsample(scale_factor=2), _conv(2 * few, few, 5), nn.GroupNorm(1, few), nn.ReLU()]
        self.grow = nn.Sequential(*layers, _conv(config.channels, outputs, 7))

    def forward(self, content: Tensor, style: Tensor) -> Tensor:
        adain = self.mlp(style).unflatten(1, (len(self.blocks), 4, -1))
        for k, block in enumerate(self.blocks):
            content = block(content, adain[:, k])
        x: Tensor = self.grow(content)
        return x


def _clear_bias(layer: nn.Conv1d | nn.Linear) -> None:
    """Biases begin at 0; authors' code."""
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)


class _Discriminator(nn.Module):
    """(B, X, T) → (B, P) scores at three scales of time, one after the other; each weighs as its own mean."""

    def __init__(self, inputs: int, channels: int) -> None:
        super().__init__()
        self.scales = nn.ModuleList(self._scale(inputs, channels) for _ in range(SCALES))
        for part in self.modules():
            if isinstance(part, nn.Conv1d):  # authors' code
                nn.init.normal_(part.weight, 0, 0.02)
                _clear_bias(part)

    @staticmethod
    def _scale(inputs: int, channels: int) -> nn.Sequential:
        widths = [inputs, *(channels << k for k in range(DISCRIMINATOR_DOWN))]
        layers: list[nn.Module] = []
        for few, many in pairwise(widths):
            layers += [_conv(few, many, 4, 2), nn.LeakyReLU(SLOPE)]
        return nn.Sequential(*layers, nn.Conv1d(widths[-1], 1, 1))

    def distance(self, x: Tensor, target: float) -> Tensor:
        """Σ over the scales of the mean of (D − target)²."""
        squares = []
        for scale in self.scales:
            squares.append((scale(x) - target).square().mean())
            x = F.avg_pool1d(x, 3, 2, padding=1, count_include_pad=False)
        return torch.stack(squares).sum()


class _Domain(nn.Module):
    """The encoders and the decoder of one kind of signals; (B, X, T) throughout."""

    def __init__(self, width: int, config: MunitConfig) -> None:
        super().__init__()
        self.content = _ContentEncoder(width, config.channels, config.blocks)
        self.style = _StyleEncoder(width, config.channels, config.style)
        self.decoder = _Decoder(width, config)
        for part in self.modules():
            if isinstance(part, nn.Conv1d | nn.Linear):  # authors' code
                nn.init.kaiming_normal_(part.weight)
                _clear_bias(part)

    def decode(self, content: Tensor, style: Tensor) -> Tensor:
        """(B, X, T)."""
        x: Tensor = self.decoder(content, style)
        return x

    def encode(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Content (B, 4·channels, T / 4) and style (B, S)."""
        return self.content(x), self.style(x).squeeze(-1)


class _Translation(NamedTuple):
    """Signals of a domain, from the other domain's content and a random style."""

    signals: Tensor
    content: Tensor
    style: Tensor


# the model ----------------------------------------------------------------------------------------------------------


class Munit(Windowed):
    """MUNIT between speech and poses (Huang et al. 2018; Ahuja et al. 2020): style passed on from speaker to speaker.

    Section 5.1 of the latter.

    Poses and audio are standardised vectors; a style is that of a window of poses of any person.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech.
    """

    Config = MunitConfig
    config: MunitConfig
    encodes_style = True

    def __init__(self, config: MunitConfig, *, pose: int, audio: int) -> None:
        super().__init__()
        if min(pose, audio) < 1:
            raise InputError(f"a MUNIT from {audio} numbers of speech to {pose} of a pose", "both are positive")
        self.config, self.pose, self.audio = config, pose, audio
        self.multiple, self.shortest, self.styles, self.modes = 2**DOWN, LEAST_FRAMES, config.style, 0
        self.speech, self.motion = _Domain(audio, config), _Domain(pose, config)
        self.judge_heard, self.judge_moved = (_Discriminator(width, config.channels) for width in (audio, pose))

    @property
    def _domains(self) -> dict[str, _Domain]:
        return {"audio": self.speech, "pose": self.motion}

    @property
    def _discriminators(self) -> dict[str, _Discriminator]:
        return {"audio": self.judge_heard, "pose": self.judge_moved}

    # what is optimised ----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """Two, in every step the discriminators first."""
        discriminators, makers = (
            [p for part in parts.values() for p in part.parameters()] for parts in (self._discriminators, self._domains)
        )
        return {
            "discriminator": Objective(discriminators, self.discriminator_loss),
            "generator": Objective(makers, self.generator_loss),
        }

    def _translate(self, contents: dict[str, Tensor], batch: Batch) -> dict[str, _Translation]:
        """Each domain's x̂, of the other's content."""
        translations = {}
        for name, other in (("audio", "pose"), ("pose", "audio")):
            style = batch.chance.normal(len(batch), self.config.style)
            translations[name] = _Translation(self._domains[name].decode(contents[other], style), contents[other], style)
        return translations

    def discriminator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Least squares of both discriminators; moves them alone."""
        with torch.no_grad():
            fakes = self._translate({name: domain.content(batch[name].mT) for name, domain in self._domains.items()}, batch)
        terms = {}
        for name, discriminator in self._discriminators.items():
            terms[f"{name}_real"] = self.config.adversarial * discriminator.distance(batch[name].mT, 1.0)
            terms[f"{name}_made"] = self.config.adversarial * discriminator.distance(fakes[name].signals, 0.0)
        return terms

    def generator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L of the module's docstring, a term for each domain; moves all but the discriminators."""
        c = self.config
        codes = {name: domain.encode(batch[name].mT) for name, domain in self._domains.items()}
        fakes = self._translate({name: content for name, (content, _) in codes.items()}, batch)
        terms = {}
        for name, other in (("audio", "pose"), ("pose", "audio")):
            x, own, there = batch[name].mT, self._domains[name], fakes[name]
            content, style = own.encode(there.signals)
            again = self._domains[other].decode(content, codes[other][1])
            terms[f"{name}_same"] = c.same * (own.decode(*codes[name]) - x).abs().mean()
            terms[f"{name}_content"] = c.content_back * (content - there.content).abs().mean()
            terms[f"{name}_style"] = c.style_back * (style - there.style).abs().mean()
            terms[f"{name}_cycle"] = c.cycle * (again - batch[other].mT).abs().mean()
            terms[f"{name}_adversarial"] = c.adversarial * self._discriminators[name].distance(there.signals, 1.0)
        return terms

    # generation -----------------------------------------------------------------------------------------------------

    @torch.no_grad()
    def style_of(self, poses: Tensor) -> Tensor:
        """(B, T, D) poses of one person, 32 frames at least → (B, style).

        Raises:
            InputError: too few frames.
        """
        if poses.shape[1] < 2 ** (STYLE_DOWN + 1):
            raise InputError(f"{poses.shape[1]} frames to tell a style from", f"{2 ** (STYLE_DOWN + 1)} at least")
        style: Tensor = self.motion.style(poses.mT).squeeze(-1)
        return style

    @torch.no_grad()
    def speaker_styles(self, stretches: Tensor) -> Tensor:
        """The mean style of each speaker's stretches, (S, n, T, D) → (S, style)."""
        return torch.stack([self.style_of(own).mean(0) for own in stretches])

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor) -> Tensor:
        """(B, T, A) and (B, T, style), of which the first frame's holds throughout, → (B, T, D); there are no modes."""
        poses: Tensor = self.motion.decode(self.speech.content(audio.mT), style[:, 0]).mT
        return poses
