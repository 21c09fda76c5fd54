"""The common part of networks of many inputs: how each input comes in, and how they are played.

A missing input is zeros: words, the face, the emotion, the speaker, and the poses that a window begins with.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from copy import deepcopy
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ...errors import InputError, nearest
from .cascade import EMOTIONS, FACE
from .export import ExportGraph, Shape, without_inputs
from .objective import Batch
from .recurrent import BothWays, BothWaysGru
from .windowed import Windowed
from .words import SubwordTable, WordEmbedding

__all__ = ["INPUTS", "SEEDS", "ManyInputs", "ModalityInputs", "check_lacks", "weights_of"]

SEEDS = 4  # poses that a window begins with; Liu et al. 2022 and Yoon et al. 2020
INPUTS = ("text", "face", "emotion", "speaker", "seed")
"""Inputs that may be missing."""


class ModalityInputs(NamedTuple):
    """Inputs of which poses are made, frame by frame; zeros where one is missing."""

    audio: Tensor
    """(B, T, A)."""
    words: Tensor
    """(B, T, W) embedded."""
    face: Tensor
    """(B, T, 52) ARKit weights."""
    emotion: Tensor
    """(B, T, 8) weights of the emotions."""
    speaker: Tensor
    """(B, T, S) weights of the speakers."""
    seed: Tensor
    """(B, T, D + 1): the poses that are known, of the first four frames, and 1 where one is."""


def weights_of(labels: Tensor, count: int) -> Tensor:
    """(…,) whole numbers, −1 where unknown → (…, count): 1 at the label's place, all 0 where unknown."""
    return F.one_hot(labels.clamp_min(-1) + 1, count + 1)[..., 1:].float()


def check_lacks(lacks: Collection[str]) -> None:
    """Refuse names of inputs that cannot be left out.

    Raises:
        InputError: one of them is not of `INPUTS`.
    """
    for name in lacks:
        if name not in INPUTS:
            raise InputError(f"no input is called {name!r}", nearest(name, INPUTS))


class ManyInputs(Windowed):
    """A network with `forward`: (`ModalityInputs`, noise) → (B, T, D), which plays windows of any length.

    As a `Windowed` its frames of speech are [audio | embedded words], its styles [speakers' weights | emotions' weights]; face
    and seed poses are then missing.
    """

    optional_arrays = ("text", "face", "emotion", "semantic")
    speakers: int
    """S."""
    embedding: SubwordTable | WordEmbedding

    def _measures(self, pose: int, audio: int, speakers: int, embedding: SubwordTable | WordEmbedding, modes: int = 0) -> None:
        """Set the numbers of a `Windowed`."""
        self.pose, self.speakers, self.embedding = pose, speakers, embedding
        self.audio = audio + embedding.width
        self.styles, self.modes = speakers + EMOTIONS, modes
        self.multiple = self.shortest = 1

    def words(self, text: Tensor) -> Tensor:
        """(B, T, 12) numbers of subwords, or (B, T, 300) vectors → (B, T, W)."""
        vectors: Tensor = self.embedding(text)
        return vectors

    def collect_inputs(
        self, arrays: Mapping[str, Tensor], lacks: Collection[str] = (), has_seeds: Tensor | None = None
    ) -> ModalityInputs:
        """The arrays of a batch as inputs.

        Args:
            arrays: of a batch; ``face`` and ``emotion`` may be missing.
            lacks: names of `INPUTS` that are left out.
            has_seeds: (B,) 1 for windows that begin with known poses, 0 for others; None: all do.

        Raises:
            InputError: there is no such input.
        """
        check_lacks(lacks)
        audio, pose = arrays["audio"], arrays["pose"]
        rows, frames = audio.shape[:2]
        unknown = arrays["speaker"].new_full((rows, frames), -1)
        emotion = arrays.get("emotion", unknown) if "emotion" not in lacks else unknown
        speaker = arrays["speaker"][:, None].expand(-1, frames) if "speaker" not in lacks else unknown
        face = arrays["face"].nan_to_num() if "face" in arrays and "face" not in lacks else audio.new_zeros(rows, frames, FACE)
        words = self.words(arrays["text"])
        flag = audio.new_zeros(rows, frames, 1)
        if "seed" not in lacks:
            flag[:, :SEEDS] = 1 if has_seeds is None else has_seeds[:, None, None]
        return ModalityInputs(
            audio, torch.zeros_like(words) if "text" in lacks else words, face, weights_of(emotion, EMOTIONS),
            weights_of(speaker, self.speakers), torch.cat([pose * flag, flag], -1),
        )  # fmt: skip

    def collect_training_inputs(self, batch: Batch, seed_dropout: float) -> ModalityInputs:
        """A batch as inputs; in training a share of its windows has no poses to begin with."""
        if not (seed_dropout and self.training):
            return self.collect_inputs(batch.arrays)
        has_seeds = batch.chance.uniform(len(batch)) >= seed_dropout
        return self.collect_inputs(batch.arrays, has_seeds=has_seeds.to(batch["audio"]))

    @torch.no_grad()
    def play(self, arrays: Mapping[str, Tensor], lacks: Collection[str] = (), noise: Tensor | None = None) -> dict[str, Tensor]:
        """Poses for the arrays of a batch, of any length.

        Args:
            arrays: of a batch; of ``pose`` the first four frames are used.
            lacks: names of `INPUTS` that are left out.
            noise: (B, T, modes); none: 0.

        Returns:
            ``pose``: (B, T, D), standardised.
        """
        audio = arrays["audio"]
        quiet = audio.new_zeros(*audio.shape[:2], self.modes) if noise is None else noise
        return {"pose": self(self.collect_inputs(arrays, lacks), quiet)}

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor) -> Tensor:
        """(B, T, A + W), (B, T, S + 8), (B, T, modes) of noise → (B, T, D)."""
        speech, words = audio.split([self.audio - self.embedding.width, self.embedding.width], -1)
        speaker, emotion = style.split([self.speakers, EMOTIONS], -1)
        nothing = speech.new_zeros(*speech.shape[:2], FACE + self.pose + 1)
        face, seed = nothing.split([FACE, self.pose + 1], -1)
        poses: Tensor = self(ModalityInputs(speech, words, face, emotion, speaker, seed), mode_noise)
        return poses

    @torch.no_grad()
    def speaker_styles(self, stretches: Tensor) -> Tensor:
        """(S, n, T, D) → (S, S + 8): each speaker alone, neutral."""
        alone = torch.eye(self.speakers, self.styles, dtype=stretches.dtype, device=stretches.device)
        alone[:, self.speakers] = 1
        return alone

    def recurrent_layers(self) -> tuple[BothWays | BothWaysGru, ...]:
        """Those whose first inputs are the poses to begin with and their flag."""
        raise NotImplementedError

    def export_module(self) -> dict[str, ExportGraph]:
        """``make``: rows (1, T, A + W), style (N, T, S + 8), noise (N, T, modes) where there is any → poses (N, T, D)."""
        inputs: dict[str, Shape] = {"rows": (1, "T", self.audio), "style": ("N", "T", self.styles)}
        inputs |= {"noise": ("N", "T", self.modes)} if self.modes else {}
        hop, ahead = max(1, self.window // 2), self.window // 4
        poses = {"poses": ("N", "T", self.pose)}
        make = ExportGraph(
            _Playing(self), inputs, poses, window=self.window, hop=hop, look_ahead=ahead, normal_noise=self.normal_noise
        )
        return {"make": make}


class _Playing(nn.Module):
    """``make`` of a network of many inputs, without the weights of seed poses, which it never gets here."""

    def __init__(self, net: ManyInputs) -> None:
        super().__init__()
        self.net = deepcopy(net)
        for part in self.net.recurrent_layers():
            name = "lstm" if isinstance(part, BothWays) else "gru"
            setattr(part, name, without_inputs(getattr(part, name), net.pose + 1))

    def forward(self, rows: Tensor, style: Tensor, *noise: Tensor) -> Tensor:
        net = self.net
        speech, words = rows.split([net.audio - net.embedding.width, net.embedding.width], -1)
        speaker, emotion = style.split([net.speakers, EMOTIONS], -1)
        face = rows[..., :1] * rows.new_zeros(FACE)
        inputs = ModalityInputs(speech, words, face, emotion, speaker, rows[..., :0])
        poses: Tensor = net(inputs, noise[0] if noise else rows[..., :0])
        return poses
