"""The common part of networks whose windows begin with known poses, and that may read words: how each input comes in, how they
are trained, played and exported.

    rows of a clip   … [ seeds ][ made                ] …
    next window                            [ seeds ][ made …          the last poses that the window before made

The first window of a performance has no known poses: they are zeros, which is the mean pose, and their flag is 0.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from copy import deepcopy
from typing import NamedTuple

import torch
from torch import Tensor, nn

from .export import ExportGraph, Shape
from .modalities import SEEDS, check_lacks
from .objective import Batch
from .windowed import Windowed
from .words import SubwordTable, WordEmbedding

__all__ = ["SeededWindows", "WindowInputs"]

_AHEAD = 8  # when it plays, a window sees 1/8 of its length after its new frames; ours: about 0.3 s, half of it for the fade


class WindowInputs(NamedTuple):
    """Inputs of which poses are made, frame by frame; zeros where one is missing."""

    audio: Tensor
    """(B, T, A)."""
    words: Tensor
    """(B, T, W) embedded; W is 0 for a network that reads none."""
    style: Tensor
    """(B, T, C)."""
    seed: Tensor
    """(B, T, D + 1): the poses that are known, of the first frames, and 1 where one is."""


class SeededWindows(Windowed):
    """A network with `poses`: (`WindowInputs`, noise) → (B, T, D).

    As a `Windowed` its frames of speech are [audio | embedded words].
    """

    arrays: tuple[str, ...] = ("pose", "audio", "text")
    optional_arrays: tuple[str, ...] = ("text",)
    seeds: int = SEEDS
    """Known poses that a window begins with; 0: none."""
    cut: bool = False
    """Whether it makes only windows of ``multiple`` frames; more frames are then cut into such windows, each made by itself."""
    embedding: SubwordTable | WordEmbedding | None
    """None: it reads no words."""

    def poses(self, inputs: WindowInputs, noise: Tensor) -> Tensor:
        """(B, T, D) of T frames; ``noise`` (B, T or 1, modes)."""
        raise NotImplementedError

    def speaker_style(self, speaker: Tensor) -> Tensor:
        """(B,) numbers of speakers, −1 where unknown → (B, styles); of a network that has styles."""
        raise NotImplementedError

    def measure(self, pose: int, audio: int, embedding: SubwordTable | WordEmbedding | None = None) -> None:
        """Set the numbers of a `Windowed`, for a network that takes any number of frames and has no style or noise."""
        self.pose, self.embedding = pose, embedding
        self.audio = audio + (embedding.width if embedding is not None else 0)
        self.styles, self.modes = 0, 0
        self.multiple = self.shortest = 1

    def collect_inputs(
        self, arrays: Mapping[str, Tensor], lacks: Collection[str] = (), has_seeds: Tensor | None = None
    ) -> WindowInputs:
        """The arrays of a batch as inputs.

        Args:
            arrays: of a batch.
            lacks: names of `INPUTS` that are left out.
            has_seeds: (B,) 1 for windows that begin with known poses, 0 for others; None: all do.

        Raises:
            InputError: there is no such input.
        """
        check_lacks(lacks)
        pose = arrays["pose"]
        rows, frames = pose.shape[:2]
        audio = arrays["audio"] if "audio" in arrays else pose.new_zeros(rows, frames, 0)
        words = pose.new_zeros(rows, frames, 0) if self.embedding is None else self.embedding(arrays["text"])
        style = pose.new_zeros(rows, 0)
        if self.styles:
            speaker = arrays["speaker"]
            style = self.speaker_style(torch.full_like(speaker, -1) if "speaker" in lacks else speaker)
        flag = pose.new_zeros(rows, frames, 1)
        if "seed" not in lacks:
            flag[:, : self.seeds] = 1 if has_seeds is None else has_seeds[:, None, None]
        return WindowInputs(
            audio, torch.zeros_like(words) if "text" in lacks else words, style[:, None].expand(-1, frames, -1),
            torch.cat([pose * flag, flag], -1),
        )  # fmt: skip

    def collect_training_inputs(self, batch: Batch, seed_dropout: float) -> WindowInputs:
        """A batch as inputs; in training a share of its windows has no poses to begin with."""
        if not (seed_dropout and self.training):
            return self.collect_inputs(batch.arrays)
        has_seeds = batch.chance.uniform(len(batch)) >= seed_dropout
        return self.collect_inputs(batch.arrays, has_seeds=has_seeds.to(batch["pose"]))

    @torch.no_grad()
    def play(self, arrays: Mapping[str, Tensor], lacks: Collection[str] = (), noise: Tensor | None = None) -> dict[str, Tensor]:
        """Poses for the arrays of a batch.

        Args:
            arrays: of a batch; of ``pose`` the first four frames are used.
            lacks: names of `INPUTS` that are left out.
            noise: (B, 1 or T, modes); none: 0.

        Returns:
            ``pose``: (B, T, D), standardised.
        """
        pose = arrays["pose"]
        quiet = pose.new_zeros(len(pose), 1, self.modes) if noise is None else noise
        return {"pose": self.poses(self.collect_inputs(arrays, lacks), quiet)}

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor, seed: Tensor | None = None) -> Tensor:
        """(B, T, A + W), (B, T, C), (B, T, modes) of noise, (B, T, D + 1) known poses → (B, T, D)."""
        width = 0 if self.embedding is None else self.embedding.width
        speech, words = audio.split([self.audio - width, width], -1)
        seed = speech.new_zeros(*speech.shape[:2], self.pose + 1) if seed is None else seed
        if not self.cut or audio.shape[1] == self.multiple:
            return self.poses(WindowInputs(speech, words, style, seed), mode_noise)
        count = audio.shape[1] // self.multiple
        inputs = [x.reshape(len(x) * count, self.multiple, x.shape[2]) for x in (speech, words, style, seed, mode_noise)]
        return self.poses(WindowInputs(*inputs[:4]), inputs[4]).reshape(len(audio), -1, self.pose)

    def export_module(self) -> dict[str, ExportGraph]:
        """``make``: rows (1, T, A + W), style (N, T, C), noise (N, T, modes) where there are any, seed (N, T, D + 1) → poses.

        Each window begins with the last poses of the one before. A network without known poses is exported as every `Windowed`.
        """
        if not self.seeds:
            return super().export_module()
        inputs: dict[str, Shape] = {"rows": (1, "T", self.audio)}
        inputs |= {"style": ("N", "T", self.styles)} if self.styles else {}
        inputs |= {"noise": ("N", "T", self.modes)} if self.modes else {}
        inputs["seed"] = ("N", "T", self.pose + 1)
        window = max(self.shortest, -(-self.window // self.multiple) * self.multiple)
        ahead = window // _AHEAD
        return {
            "make": ExportGraph(
                _Playing(self), inputs, {"poses": ("N", "T", self.pose)}, frames=window if self.cut else 2 * window,
                fixed=self.cut, multiple=self.multiple,
                shortest=self.shortest, window=window, hop=window - self.seeds - ahead, look_ahead=ahead, seeds=self.seeds,
                normal_noise=self.normal_noise,
            )
        }  # fmt: skip


class _Playing(nn.Module):
    """``make``, without the inputs that have no width."""

    def __init__(self, net: SeededWindows) -> None:
        super().__init__()
        self.net = deepcopy(net)

    def forward(self, rows: Tensor, *inputs: Tensor) -> Tensor:
        others, nothing = iter(inputs), rows[..., :0]
        style, noise = (next(others) if width else nothing for width in (self.net.styles, self.net.modes))
        return self.net.make(rows, style, noise, next(others))
