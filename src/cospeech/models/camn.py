"""CaMN: Liu et al. 2022, "BEAT: A Large-Scale Semantic and Emotional Multi-Modal Dataset for Conversational Gestures
Synthesis".

A cascade over six inputs. Each is encoded together with those before it; then the body is made, and from it the hands.

    speaker ─► embedding ─────────────────────────────► zˢ (8)   ─┐
    emotion ─► embedding ─► conv 9 × 4 ───────────────► zᵉ (8)   ─┤
    words ───► 300 ─► 8 causal convolutions, skips ───► zᵗ (128) ─┼──────────────────────────────┐
    speech ──► blocks of convolutions ─► MLP(·, zᵉ, zˢ, zᵗ) ────► zᵃ (128) ─┤                    │
    face ────► 4 blocks of convolutions ─► MLP(·, zᵃ, zᵉ, zˢ, zᵗ) ────────► zᶠ (32) ─┤          │
    first 4 poses, flag (D + 1) ──────────────────────────────────────────────────────┼─► h     │
                                                                                      ▼
          body  b̂ = MLP(Σ directions of LSTM × 4 (h))          hands  ĝ = MLP(Σ directions of LSTM × 4 (h, b̂))

    L = λ E Huber((λ_s + 1) y, (λ_s + 1) ŷ),   λ_s the relevance of a frame, ŷ = [b̂, ĝ], Huber(d) = d² / 2β, or |d| − β / 2

Followed, changed, not said in the paper: docs/models/camn.md, by number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..errors import InputError
from .nn.basic_block import BasicBlock, basic_blocks
from .nn.cascade import EMOTIONS, FACE
from .nn.configuration import SMALL_RECURRENT, ModelConfig
from .nn.modalities import SEEDS, ManyInputs, ModalityInputs
from .nn.norm import BatchNorm1d
from .nn.objective import Batch, Objective
from .nn.recurrent import BothWays
from .nn.settings import check_least
from .nn.speed_distance import timing_term
from .nn.temporal import Memory, TextTcn
from .nn.words import word_embedding

__all__ = ["Camn", "CamnConfig", "EmotionEncoder", "SpeakerEncoder", "face_encoder", "speech_encoder"]

SLOPE = 0.1  # of LeakyReLU in MLPs and after the speaker; not stated, authors' code
EMOTION_SLOPE = 0.3  # of the emotion's convolutions; not stated, authors' code
SPEECH_KERNEL = 7  # ours: with four convolutions in a row a frame sees 25, as each of theirs sees 27,035 samples, 25.3 frames


@dataclass(frozen=True)
class CamnConfig(ModelConfig):
    """Sizes and weights; the defaults are the paper's, or, where it is silent, the authors' code's."""

    TINY: ClassVar[Mapping[str, Any]] = {"hidden": 8, "layers": 2, "word_width": 5, "audio": 6, "text": 4}
    SMALL: ClassVar[Mapping[str, Any]] = {"hidden": 64, "layers": 2, "word_width": 32, "audio": 64, "text": 64}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_RECURRENT

    frames: int = 34
    """T of a training window; section 5: 34 at 15 per second, of which 4 are known."""
    hidden: int = 256
    """Of each direction of the LSTMs, and of the convolutions of words; MLPs have half of it. Authors' code 256."""
    layers: int = 4
    """Of each LSTM; authors' code 4."""
    dropout: float = 0.3
    """Between layers of LSTMs and in the convolutions of words; authors' code 0.3."""
    audio: int = 128
    """Width of zᵃ; section 4."""
    text: int = 128
    """Width of zᵗ; section 4."""
    face: int = 32
    """Width of zᶠ; section 4."""
    emotion: int = 8
    """Width of zᵉ; section 4."""
    speaker: int = 8
    """Width of zˢ; section 4."""
    word_width: int = 300
    """Of a word where the network learns it; authors' code 300."""
    reconstruction: float = 500.0
    """λ; authors' code 500."""
    beta: float = 0.1
    """β of Huber's loss, in deviations; authors' code 0.1."""
    semantic: bool = True
    """Whether frames are weighted by semantic relevance; without, stores need no such array. Section 4."""
    seed_dropout: float = 0.0
    """Share of training windows without known poses, so that it can begin by itself; ours, as published 0."""
    stroke_timing: float = 0.0
    """Weight of the distance in time of rises and falls of the speed from the recorded ones; ours, as published 0."""

    def __post_init__(self) -> None:
        low = {"frames": SEEDS + 1, "hidden": 2, "layers": 1, "audio": 1, "text": 1, "face": 2, "emotion": 1, "speaker": 1}
        low |= {"word_width": 1, "dropout": 0, "reconstruction": 0, "seed_dropout": 0, "stroke_timing": 0}
        check_least(self, "a CaMN", low)
        if not (self.dropout < 1 and self.seed_dropout <= 1 and self.beta > 0):
            raise InputError(
                f"a CaMN with dropout {self.dropout}, seed_dropout {self.seed_dropout}, beta {self.beta}", "shares; beta > 0"
            )


# encoders ------------------------------------------------------------------------------------------------------------


class SpeakerEncoder(nn.Module):
    """(B, T, S) weights of the speakers → (B, width, T): a mixture of embeddings, a linear layer, leaky ReLU."""

    def __init__(self, speakers: int, width: int) -> None:
        super().__init__()
        self.embedding = nn.Embedding(speakers, width)
        self.linear = nn.Linear(width, width)

    def forward(self, weights: Tensor) -> Tensor:
        return F.leaky_relu(self.linear(weights @ self.embedding.weight), SLOPE).mT


class EmotionEncoder(nn.Module):
    """(B, T, 8) weights of the emotions → (B, width, T): a mixture of embeddings, a linear layer, four convolutions."""

    WIDTHS = (8, 16, 16)  # not stated; authors' code

    def __init__(self, width: int) -> None:
        super().__init__()
        self.embedding = nn.Embedding(EMOTIONS, width)
        self.linear = nn.Linear(width, width)
        self.tail = nn.Sequential(*(
            nn.Sequential(nn.Conv1d(a, b, 9, padding=4), BatchNorm1d(b), nn.LeakyReLU(EMOTION_SLOPE))
            for a, b in pairwise((width, *self.WIDTHS, width))
        ))  # fmt: skip

    def forward(self, weights: Tensor) -> Tensor:
        code: Tensor = self.tail(self.linear(weights @ self.embedding.weight).mT)
        return code


def speech_encoder(audio: int, width: int) -> nn.Sequential:
    """(B, A, T) → (B, width, T): two blocks at the rate of the poses, in the place of six on the waveform."""
    return basic_blocks((audio, max(1, width // 2), width), SPEECH_KERNEL)


def face_encoder(width: int) -> nn.Sequential:
    """(B, 52, T) → (B, width, T): four blocks, the first with kernel 7; authors' code."""
    half = width // 2
    first, second = BasicBlock(FACE, half, 7), BasicBlock(half, half, 3)
    return nn.Sequential(first, second, BasicBlock(half, half, 3, short=True), BasicBlock(half, width, 3))


def _mlp(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    """Of every frame, (B, inputs, T) → (B, outputs, T)."""
    return nn.Sequential(nn.Conv1d(inputs, hidden, 1), nn.LeakyReLU(SLOPE), nn.Conv1d(hidden, outputs, 1))


# the model -----------------------------------------------------------------------------------------------------------


class Camn(ManyInputs):
    """CaMN (Liu et al. 2022): body, then hands, from sound, words, emotion and a face that is given.

    Poses and audio are standardised vectors.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech.
        speakers: S.
        hands: columns of the pose that are hands.
        text: width of the store's word vectors; 0: it has ids of subwords.

    Raises:
        InputError: no pose, no speech, no speaker; hands that are none or all of the pose.
    """

    arrays: tuple[str, ...] = ("pose", "audio", "text", "face", "emotion", "semantic")
    dimensions = ("pose", "audio", "speakers", "hands", "text")
    Config = CamnConfig
    config: CamnConfig
    order: Tensor

    def __init__(
        self, config: CamnConfig, *, pose: int, audio: int, speakers: int, hands: Sequence[int], text: int = 0
    ) -> None:
        super().__init__()
        body = [column for column in range(pose) if column not in {*hands}]
        if min(pose, audio, speakers) < 1 or not 0 < len(body) < pose:
            problem = (
                f"a CaMN of {speakers} speakers from {audio} numbers of speech to {pose}, of which {len(hands)} are of hands"
            )
            raise InputError(problem, "all are positive, and some of a pose are of hands and others are not")
        self.config, self.arrays = config, self.arrays_for(config)
        self._measures(pose, audio, speakers, word_embedding(text, config.word_width))
        order = torch.tensor([*body, *hands])
        self.register_buffer("order", order.argsort(), persistent=False)
        self.speaker, self.emotion = SpeakerEncoder(speakers, config.speaker), EmotionEncoder(config.emotion)
        self.text = TextTcn(self.embedding.width, config.hidden, config.text, config.dropout)
        self.speech, self.face = speech_encoder(audio, config.audio), face_encoder(config.face)
        half, labels = config.hidden // 2, config.speaker + config.emotion + config.text
        self.speech_fusion = nn.Sequential(_mlp(config.audio + labels, half, config.audio), nn.LeakyReLU(SLOPE))
        self.face_fusion = nn.Sequential(_mlp(config.face + config.audio + labels, half, config.face), nn.LeakyReLU(SLOPE))
        width = pose + 1 + labels + config.audio + config.face
        self.body = BothWays(width, config.hidden, config.layers, config.dropout)
        self.body_out = _mlp(config.hidden, half, len(body))
        self.hands = BothWays(width + len(body), config.hidden, config.layers, config.dropout)
        self.hands_out = _mlp(config.hidden, half, len(hands))

    @classmethod
    def arrays_for(cls, config: CamnConfig) -> tuple[str, ...]:
        """Without the semantic relevance, where it is not used."""
        return cls.arrays if config.semantic else tuple(name for name in cls.arrays if name != "semantic")

    def forward(self, inputs: ModalityInputs, noise: Tensor | None = None) -> Tensor:
        """Body and hands: inputs of T frames → (B, T, D). There is no noise."""
        speaker, emotion = self.speaker(inputs.speaker), self.emotion(inputs.emotion)
        text = self.text(inputs.words.mT, Memory())
        speech = self.speech_fusion(torch.cat([self.speech(inputs.audio.mT), emotion, speaker, text], 1))
        face = self.face_fusion(torch.cat([self.face(inputs.face.mT), speech, emotion, speaker, text], 1))
        features = torch.cat([inputs.seed.mT, speaker, emotion, text, speech, face], 1)
        body = self.body_out(self.body(features, Memory()))
        hands = self.hands_out(self.hands(torch.cat([features, body], 1), Memory()))
        return torch.cat([body, hands], 1).index_select(1, self.order).mT

    def recurrent_layers(self) -> tuple[BothWays, ...]:
        """The recurrent layers of body and hands."""
        return self.body, self.hands

    # what is optimised -----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """One."""
        return {"gestures": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L of the module's docstring."""
        output, pose = self(self.collect_training_inputs(batch, self.config.seed_dropout)), batch["pose"]
        timing = timing_term(self.config.stroke_timing, output.mT, pose.mT)
        if self.config.semantic:
            weight = batch["semantic"].nan_to_num().unsqueeze(-1) + 1
            output, pose = output * weight, pose * weight
        return {"huber": self.config.reconstruction * F.smooth_l1_loss(output, pose, beta=self.config.beta), **timing}
