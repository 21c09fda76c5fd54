"""Speech2AffectiveGestures: Bhattacharya et al. 2021, "Speech2AffectiveGestures: Synthesizing Co-Speech Gestures with
Generative Adversarial Affective Expression Learning": the trimodal network of Yoon et al. 2020 with two other encoders.

    MFCC (T × 14) ─► 4 convolutions over coefficients, frames as channels ─► linear ─► (32) ──┐
    words ────► 8 causal convolutions, skips ───────────────────────────────────────► (32) ──┤
    speaker ──► embedding ─► linear ─► μ, σ ─► z = μ + σ ε ─────────────────────────► (16) ──┼─► GRU × 4 ─► MLP ─► ŷ (B, T, D)
    first 4 poses ─► affective encoder ─────────────────────────────────────────────► (8) ───┘                     │
                                                   real or made? ◄─ GRU × 4 ◄─ affective encoder ◄─────────────────┘

    affective encoder: 9 bones (3 × 9 × T) ─► graph convolution ─► 3 parts of a body (48 × 3 × T) ─► graph convolution
                       ─► convolution 5 ─► convolution 3 ─► (8 × T)

The objectives are those of trimodal.py. Followed, changed, not said in the paper: docs/models/speech2affective_gestures.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..errors import InputError
from .nn.norm import BatchNorm1d
from .nn.pose_graph import GraphConvolution, GraphNorm, spatial_partition
from .nn.window_discriminator import GruDiscriminator
from .trimodal import Trimodal, TrimodalConfig

__all__ = ["Speech2AffectiveGestures", "Speech2AffectiveGesturesConfig"]

BONES = ((0, 1), (1, 2), (0, 3), (3, 4), (4, 5), (0, 6), (6, 7), (7, 8))  # of TED's 9, those that meet; authors' code
PARTS = ((0, 1, 2), (3, 4, 5), (6, 7, 8))  # spine and head, left arm, right arm; authors' code
PART_EDGES = ((0, 1), (0, 2))  # authors' code
CHANNELS, AFFECT = 16, 8  # channels of graph convolutions, and of the output of the affective encoder; authors' code
SPEECH_CHANNELS, SPEECH_KERNELS, SPEECH_SLOPE = (64, 64, 48), (5, 5, 3, 3), 0.3  # authors' code
AFFECT_SLOPE = 0.01  # PyTorch's own, as in the authors' code


@dataclass(frozen=True)
class Speech2AffectiveGesturesConfig(TrimodalConfig):
    """Settings of the trimodal network, and those below; the defaults are the paper's, or the authors' code's."""

    TINY: ClassVar[Mapping[str, Any]] = {
        "hidden": 8, "layers": 2, "word_width": 5, "bones": ((0, 1),), "parts": ((0,), (1,)), "part_edges": ((0, 1),),
    }  # fmt: skip
    SMALL: ClassVar[Mapping[str, Any]] = {"hidden": 64, "layers": 2, "word_width": 32}

    bones: tuple[tuple[int, int], ...] = BONES
    """Pairs of bones that meet; bone 0 is the middle of the graph. A pose has three numbers for each bone."""
    parts: tuple[tuple[int, ...], ...] = PARTS
    """Bones of each part of the body."""
    part_edges: tuple[tuple[int, int], ...] = PART_EDGES
    """Pairs of parts that meet; part 0 is the middle."""
    slope: float = 0.01
    """Of LeakyReLU in the MLP; authors' code: PyTorch's own."""
    adversarial_from: int = 0
    """Step of the discriminator's first turn; authors' code has no warm-up."""


class _MfccEncoder(nn.Module):
    """(B, frames, A) of whole windows → (B, width, frames): convolutions along the coefficients, whose channels are frames."""

    def __init__(self, frames: int, audio: int, width: int) -> None:
        super().__init__()
        channels, layers = (frames, *SPEECH_CHANNELS, frames), list[nn.Module]()
        for inputs, outputs, kernel in zip(channels, channels[1:], SPEECH_KERNELS, strict=False):
            layers += [
                nn.Conv1d(inputs, outputs, kernel, padding=kernel // 2),
                BatchNorm1d(outputs),
                nn.LeakyReLU(SPEECH_SLOPE),
            ]
        self.layers, self.out = nn.Sequential(*layers), nn.Linear(audio, width)
        self.bend = nn.LeakyReLU(SPEECH_SLOPE)

    def forward(self, cepstra: Tensor) -> Tensor:
        features: Tensor = self.bend(self.out(self.layers(cepstra))).mT
        return features


class AffectiveEncoder(nn.Module):
    """(B, D or more, T) poses, of which the first D numbers are used → (B, `AFFECT`, T).

    Args:
        config: the graph.
        pose: D.

    Raises:
        InputError: a pose that is not three numbers for each bone of the parts.
    """

    def __init__(self, config: Speech2AffectiveGesturesConfig, pose: int) -> None:
        super().__init__()
        self.parts, self.nodes = config.parts, sum(map(len, config.parts))
        if pose != 3 * self.nodes or sorted(bone for part in config.parts for bone in part) != [*range(self.nodes)]:
            problem = f"{pose} numbers of a pose for a graph of {self.nodes} bones"
            raise InputError(problem, "three for each bone: prepare the store with --pose direction-vectors")
        wide = CHANNELS * max(map(len, config.parts))
        of_bones = spatial_partition(self.nodes, config.bones)
        self.of_bones = GraphConvolution(3, CHANNELS, of_bones, 9, 5)
        self.bone_norm = GraphNorm(CHANNELS, self.nodes)
        of_parts = spatial_partition(len(config.parts), config.part_edges)
        self.of_parts = GraphConvolution(wide, CHANNELS, of_parts, 9, 3)
        self.part_norm = GraphNorm(CHANNELS, len(config.parts))
        self.tail = nn.Sequential(
            nn.Conv1d(CHANNELS * len(config.parts), 16, 5, padding=2), BatchNorm1d(16), nn.LeakyReLU(AFFECT_SLOPE),
            nn.Conv1d(16, AFFECT, 3, padding=1), BatchNorm1d(AFFECT), nn.LeakyReLU(AFFECT_SLOPE),
        )  # fmt: skip

    def forward(self, poses: Tensor) -> Tensor:
        bones = poses[:, : 3 * self.nodes].unflatten(1, (self.nodes, 3)).permute(0, 2, 3, 1)
        features = self.bone_norm(self.of_bones(bones))
        most = max(map(len, self.parts))
        parts = torch.stack([self._gather(features, part, most) for part in self.parts], 3)
        features = self.part_norm(self.of_parts(parts))
        affect: Tensor = self.tail(features.permute(0, 1, 3, 2).flatten(1, 2))
        return affect

    @staticmethod
    def _gather(features: Tensor, part: tuple[int, ...], most: int) -> Tensor:
        """(B, C · most, T) of the bones of a part, one after the other; zeros where it has fewer."""
        bones = torch.cat([features[..., bone] for bone in part], 1)
        return F.pad(bones, (0, 0, 0, (most - len(part)) * features.shape[1])) if len(part) < most else bones


class _AffectiveDiscriminator(GruDiscriminator):
    """(B, T, D) windows of the configuration's length → (B,) logits that a window was recorded."""

    def __init__(self, config: Speech2AffectiveGesturesConfig, pose: int) -> None:
        super().__init__(AFFECT, config.frames)
        self.affect = AffectiveEncoder(config, pose)

    def forward(self, poses: Tensor) -> Tensor:
        """See the class."""
        return super().forward(self.affect(poses.mT))


class Speech2AffectiveGestures(Trimodal):
    """Speech2AffectiveGestures (Bhattacharya et al. 2021): one motion for one speech, from cepstra, words and speaker.

    It makes windows as in training. Arguments, style and errors are those of `Trimodal`; a pose has three numbers for each
    bone.
    """

    Config = Speech2AffectiveGesturesConfig
    config: Speech2AffectiveGesturesConfig
    cut = True

    def build_speech_encoder(self, audio: int) -> nn.Module:
        """See `Trimodal`."""
        self.multiple = self.shortest = self.config.frames
        return _MfccEncoder(self.config.frames, audio, self.config.audio)

    def build_pose_encoder(self) -> tuple[nn.Module, int]:
        """See `Trimodal`; the flag is not used."""
        return AffectiveEncoder(self.config, self.pose), AFFECT

    def build_discriminator(self) -> nn.Module:
        """See `Trimodal`."""
        return _AffectiveDiscriminator(self.config, self.pose)
