"""Joint embedding: Ahuja and Morency 2019, "Language2Pose: Natural Language Grounded Pose Forecasting", for speech in the form
with which Yoon et al. 2020 compare: speech and motion are encoded into one space, and poses are decoded from there.

    waveform ─► 4 strided convolutions ─► (32) ─┐
    words ────► 8 causal convolutions ──► (32) ─┴─► GRU × 2 ─► last state ─► MLP ─► μ, σ ─► z = μ + σ ε (32) ──┐ one or the
    poses y ──► 4 convolutions ─► MLP ────────────────────────────────────────────────────► z (32) ────────────┤ other, by
                                                                                                               │ a coin
    first 4 poses ─► MLP (32) ─► [·, z] at every frame ─► GRU × 4, both directions, summed ─► MLP ─► ŷ (B, T, D)

    L = E |ŷ − y|₁

A window has one z: 32 numbers hold all that is known of two seconds of speech. When it plays, z comes from the speech.
Followed, changed, not said in the papers: docs/models/joint_embedding.md, by number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from ..errors import InputError
from .nn.configuration import SMALL_RECURRENT, ModelConfig
from .nn.modalities import SEEDS
from .nn.norm import BatchNorm1d
from .nn.objective import Batch, Objective
from .nn.recurrent import BothWaysGru
from .nn.seeded_windows import SeededWindows, WindowInputs
from .nn.settings import check_least
from .nn.temporal import Memory, TextTcn
from .nn.waveform_encoder import STRIDES, WaveformEncoder
from .nn.words import word_embedding

__all__ = ["JointEmbedding", "JointEmbeddingConfig"]

SLOPE = 0.2  # of LeakyReLU between the convolutions of poses; authors' code
SHORTEST = 12  # the least number of frames of which four convolutions of poses leave one


@dataclass(frozen=True)
class JointEmbeddingConfig(ModelConfig):
    """Sizes; the defaults are those of the code of Yoon et al. 2020, who compare with it."""

    TINY: ClassVar[Mapping[str, Any]] = {
        "hidden": 8, "layers": 2, "word_width": 5, "strides": (5, 1, 1, 1), "speech_hidden": 8, "pose_channels": 4, "code": 6,
    }  # fmt: skip
    SMALL: ClassVar[Mapping[str, Any]] = {"hidden": 64, "layers": 2, "word_width": 32, "speech_hidden": 64}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_RECURRENT

    frames: int = 34
    """T of a training window; Yoon et al. 34 at 15 per second, of which 4 are known."""
    hidden: int = 300
    """Of each direction of the decoder's GRU, and of the convolutions of words; Yoon et al. 300."""
    layers: int = 4
    """Of the decoder's GRU; Yoon et al. 4."""
    speech_hidden: int = 256
    """Of the two layers of the GRU that summarises the speech; Yoon et al. 256."""
    pose_channels: int = 32
    """Of the first convolution of poses, twice as many in the next two, and of the last; Yoon et al. 32."""
    dropout: float = 0.3
    """Between layers of the decoder's GRU and in the convolutions of words; Yoon et al. 0.3."""
    strides: tuple[int, ...] = STRIDES
    """Of the convolutions of the waveform; Yoon et al. Their product is the number of samples of a frame."""
    code: int = 32
    """Of z, of the speech and of the words of a frame, and of the known poses; Yoon et al. 32 each."""
    word_width: int = 300
    """Of a word where the network learns it; Yoon et al. 300."""
    slope: float = 1.0
    """Of LeakyReLU in MLPs; theirs, ``LeakyReLU(True)``, is a slope of 1, which is none at all."""

    def __post_init__(self) -> None:
        low = {"frames": SHORTEST, "hidden": 2, "layers": 1, "speech_hidden": 2, "pose_channels": 1, "code": 1}
        check_least(self, "a joint embedding", low | {"word_width": 1, "dropout": 0, "slope": 0})
        if not self.dropout < 1:
            raise InputError(f"dropout of a joint embedding is {self.dropout}", "a share")


class _SpeechEncoder(nn.Module):
    """(B, T, samples) waveform and (B, T, W) words → μ and log σ² of z, (B, code) each."""

    def __init__(self, config: JointEmbeddingConfig, audio: int, words: int) -> None:
        super().__init__()
        code, hidden = config.code, config.speech_hidden
        self.speech = WaveformEncoder(audio, config.strides, code)
        self.text = TextTcn(words, config.hidden, code, config.dropout)
        self.summary = nn.GRU(2 * code, hidden, 2, batch_first=True)
        self.head = nn.Sequential(
            nn.Linear(hidden, hidden // 2), BatchNorm1d(hidden // 2), nn.ReLU(), nn.Linear(hidden // 2, code)
        )
        self.mean, self.variance = nn.Linear(code, code), nn.Linear(code, code)

    def forward(self, waveform: Tensor, words: Tensor) -> tuple[Tensor, Tensor]:
        features = torch.cat([self.speech(waveform), self.text(words.mT, Memory())], 1)
        last = self.head(self.summary(features.mT)[0][:, -1])
        return self.mean(last), self.variance(last)


class _PoseEncoder(nn.Module):
    """(B, T, D) poses of whole windows → z (B, code)."""

    def __init__(self, config: JointEmbeddingConfig, pose: int) -> None:
        super().__init__()
        first, second = config.pose_channels, 2 * config.pose_channels
        self.convolutions = nn.Sequential(
            nn.Conv1d(pose, first, 3), BatchNorm1d(first), nn.LeakyReLU(SLOPE),
            nn.Conv1d(first, second, 3), BatchNorm1d(second), nn.LeakyReLU(SLOPE),
            nn.Conv1d(second, second, 4, 2), BatchNorm1d(second), nn.LeakyReLU(SLOPE),
            nn.Conv1d(second, first, 3),
        )  # fmt: skip
        wide, narrow, frames = 8 * first, 4 * first, ((config.frames - 4) // 2 - 1) - 2
        self.head = nn.Sequential(
            nn.Linear(frames * first, wide), BatchNorm1d(wide), nn.LeakyReLU(config.slope),
            nn.Linear(wide, narrow), BatchNorm1d(narrow), nn.LeakyReLU(config.slope),
            nn.Linear(narrow, config.code), nn.Linear(config.code, config.code),
        )  # fmt: skip

    def forward(self, poses: Tensor) -> Tensor:
        z: Tensor = self.head(self.convolutions(poses.mT).flatten(1))
        return z


class _Decoder(nn.Module):
    """z (B, code) and the known poses (B, 4, D) → (B, T, D), T that of ``like`` (B, T, ·)."""

    def __init__(self, config: JointEmbeddingConfig, pose: int) -> None:
        super().__init__()
        code, half = config.code, config.hidden // 2
        self.known = nn.Sequential(nn.Linear(SEEDS * pose, code), BatchNorm1d(code), nn.ReLU(), nn.Linear(code, code))
        self.both_ways = BothWaysGru(2 * code, config.hidden, config.layers, config.dropout)
        self.out = nn.Sequential(nn.Conv1d(config.hidden, half, 1), nn.LeakyReLU(config.slope), nn.Conv1d(half, pose, 1))

    def forward(self, z: Tensor, seeds: Tensor, like: Tensor) -> Tensor:
        code = torch.cat([self.known(seeds.flatten(1)), z], 1)
        poses: Tensor = self.out(self.both_ways(code.unsqueeze(2) + 0 * like[..., :1].mT)).mT  # the same at every frame
        return poses


class JointEmbedding(SeededWindows):
    """Joint embedding (Ahuja and Morency 2019, in the form of Yoon et al. 2020): one motion for one speech and its words.

    Poses and audio are standardised.

    Args:
        config: sizes.
        pose: D, numbers of a pose.
        audio: samples of a frame.
        text: width of the store's word vectors; 0: it has ids of subwords.

    Raises:
        InputError: no pose; samples that the strides do not fit.
    """

    dimensions = ("pose", "audio", "text")
    Config = JointEmbeddingConfig
    normal_noise = True
    config: JointEmbeddingConfig

    def __init__(self, config: JointEmbeddingConfig, *, pose: int, audio: int, text: int = 0) -> None:
        super().__init__()
        if pose < 1:
            raise InputError(f"a joint embedding of {pose} numbers of a pose", "one at least")
        self.config = config
        embedding = word_embedding(text, config.word_width)
        self.measure(pose, audio, embedding)
        self.modes, self.shortest = config.code, SEEDS
        self.speech_encoder = _SpeechEncoder(config, audio, embedding.width)
        self.pose_encoder = _PoseEncoder(config, pose)
        self.decoder = _Decoder(config, pose)

    def poses(self, inputs: WindowInputs, noise: Tensor) -> Tensor:
        """See `SeededWindows`; ε is the noise of the first frame."""
        return self._decode(self.encode_speech(inputs, noise[:, 0]), inputs)

    def encode_speech(self, inputs: WindowInputs, noise: Tensor) -> Tensor:
        """z of speech and words, (B, code), for ε (B, code)."""
        mean, variance = self.speech_encoder(inputs.audio, inputs.words)
        z: Tensor = mean + torch.exp(variance / 2) * noise
        return z

    def _decode(self, z: Tensor, inputs: WindowInputs) -> Tensor:
        poses: Tensor = self.decoder(z, inputs.seed[:, :SEEDS, :-1], inputs.seed)
        return poses

    # what is optimised -----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """One."""
        return {"gestures": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L of the module's docstring; for every window a coin decides whether z comes from speech or from poses."""
        inputs = self.collect_inputs(batch.arrays)
        coin = batch.chance.uniform(len(batch), 1) < 0.5
        speech = self.encode_speech(inputs, batch.chance.normal(len(batch), self.config.code))
        z = torch.where(coin, self.pose_encoder(batch["pose"]), speech)
        return {"l1": (self._decode(z, inputs) - batch["pose"]).abs().mean()}

    def validate(self, batch: Batch) -> dict[str, Tensor]:
        """``speech_l1``: L with all z from speech, as when it plays; ε is 0."""
        return {"speech_l1": (self.play(batch.arrays)["pose"] - batch["pose"]).abs().mean()}
