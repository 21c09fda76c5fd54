"""Multi-context: Yoon et al. 2020, "Speech Gesture Generation from the Trimodal Context of Text, Audio, and Speaker Identity",
in the form in which BEAT (Liu et al. 2022) compares with it: all inputs side by side, one recurrent network over them.

    words ───► 8 causal convolutions, skips ─► (128) ──┐
    speech ──► blocks of convolutions ───────► (128) ──┤
    speaker ─► embedding ─► μ, σ ─► z = μ + σ ε (8) ───┼─► GRU × 4, both directions, summed ─► MLP ─► ŷ (B, T, D)
    first 4 poses, flag ─────────────────────(D + 1) ──┤                                            │
    emotion, face where wanted (CaMN's encoders) ──────┘           real or made? ◄─ GRU × 4 ◄─ conv 3 × 3

    G   λ E Huber(y, ŷ) − λ_G E log D(ŷ) − λ_d E min(1000, Σ Huber(ŷ', ŷ) / |z' − z|₁) + λ_k KL(N(μ, σ) ‖ N(0, 1))
    D   − E log D(y) − E log(1 − D(ŷ)),       ŷ' of another speaker's z'

With emotion and face it is the "concatenation model", which Xu et al. 2024 also test with missing inputs.
Followed, changed, not said in the papers: docs/models/multi_context.md, by number.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from ..errors import InputError
from .camn import EmotionEncoder, face_encoder, speech_encoder
from .nn.configuration import SMALL_RECURRENT, ModelConfig
from .nn.modalities import SEEDS, ManyInputs, ModalityInputs, weights_of
from .nn.objective import Batch
from .nn.recurrent import BothWaysGru
from .nn.settings import check_least
from .nn.speaker_latent import SpeakerLatent, pose_diversity
from .nn.temporal import Memory, TextTcn
from .nn.window_discriminator import AdversarialWindows, SampledWindows, WindowDiscriminator
from .nn.words import word_embedding

__all__ = ["MultiContext", "MultiContextConfig"]


@dataclass(frozen=True)
class MultiContextConfig(ModelConfig):
    """Sizes and weights; the defaults are those of BEAT's code."""

    TINY: ClassVar[Mapping[str, Any]] = {
        "hidden": 8, "layers": 2, "word_width": 5, "audio": 6, "text": 4, "adversarial_from": 5,
    }  # fmt: skip
    SMALL: ClassVar[Mapping[str, Any]] = {
        "hidden": 64, "layers": 2, "word_width": 32, "audio": 64, "text": 64, "adversarial_from": 60,
    }  # fmt: skip
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_RECURRENT

    frames: int = 34
    """T of a training window; Yoon et al. 34 at 15 per second, of which 4 are known."""
    hidden: int = 256
    """Of each direction of the GRU, and of the convolutions of words; BEAT's code 256, Yoon et al. 300."""
    layers: int = 4
    """Of the GRU; Yoon et al. 4."""
    dropout: float = 0.3
    """Between layers of the GRU and in the convolutions of words; authors' code 0.3."""
    audio: int = 128
    """Of speech; BEAT's code 128, Yoon et al. 32."""
    text: int = 128
    """Of words; BEAT's code 128, Yoon et al. 32."""
    speaker: int = 8
    """Of z; BEAT's code 8, Yoon et al. 16."""
    emotion: int = 0
    """Of the emotion, as CaMN encodes it (there 8); 0: it is no input, as published."""
    face: int = 0
    """Of the face, as CaMN encodes it (there 32); 0: it is no input, as published."""
    word_width: int = 300
    """Of a word where the network learns it; authors' code 300."""
    slope: float = 1.0
    """Of LeakyReLU after the speaker and in the MLP; authors' ``LeakyReLU(True)`` is a slope of 1, which is none at all."""
    reconstruction: float = 500.0
    """λ; both 500."""
    beta: float = 0.1
    """β of Huber's loss, in deviations; authors' code 0.1."""
    adversarial: float = 0.5
    """λ_G; BEAT's code 0.5, Yoon et al. 5. 0: no discriminator."""
    adversarial_from: int = 2640
    """Step of the discriminator's first turn; both from epoch 10 on, which has 264 steps of BEAT's four speakers."""
    diversity: float = 0.01
    """λ_d; BEAT's code 0.01, Yoon et al. 0.05."""
    divergence: float = 0.1
    """λ_k; both 0.1."""
    seed_dropout: float = 0.0
    """Share of training windows without known poses, so that it can begin by itself; ours, as published 0."""
    stroke_timing: float = 0.0
    """Weight of the distance in time of rises and falls of the speed from the recorded ones; ours, as published 0."""

    def __post_init__(self) -> None:
        low = {"frames": SEEDS + 4, "hidden": 2, "layers": 1, "audio": 1, "text": 1, "speaker": 1, "emotion": 0, "face": 0}
        low |= {"word_width": 1, "dropout": 0, "slope": 0, "reconstruction": 0, "adversarial": 0, "adversarial_from": 0}
        check_least(
            self, "a multi-context network", low | {"diversity": 0, "divergence": 0, "seed_dropout": 0, "stroke_timing": 0}
        )
        if not (self.dropout < 1 and self.seed_dropout <= 1 and self.beta > 0 and self.face != 1):
            problem = f"dropout {self.dropout}, seed_dropout {self.seed_dropout}, beta {self.beta}, face {self.face}"
            raise InputError(f"a multi-context network with {problem}", "shares; beta > 0; a face of 2 or more, or none")


# parts ---------------------------------------------------------------------------------------------------------------


# the model -----------------------------------------------------------------------------------------------------------


class MultiContext(ManyInputs, AdversarialWindows):
    """Multi-context (Yoon et al. 2020, in BEAT's form): one motion for one speech, from sound, words and speaker.

    Poses and audio are standardised vectors.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech.
        speakers: S.
        text: width of the store's word vectors; 0: it has ids of subwords.

    Raises:
        InputError: no pose, no speech, no speaker.
    """

    arrays: tuple[str, ...] = ("pose", "audio", "text")
    dimensions = ("pose", "audio", "speakers", "text")
    Config = MultiContextConfig
    normal_noise = True
    config: MultiContextConfig

    def __init__(self, config: MultiContextConfig, *, pose: int, audio: int, speakers: int, text: int = 0) -> None:
        super().__init__()
        if min(pose, audio, speakers) < 1:
            problem = f"a multi-context network of {speakers} speakers from {audio} numbers of speech to {pose} of a pose"
            raise InputError(problem, "all are positive")
        self.config, self.arrays = config, self.arrays_for(config)
        self._measures(pose, audio, speakers, word_embedding(text, config.word_width), config.speaker)
        self.speaker = SpeakerLatent(speakers, config.speaker, config.slope)
        self.text = TextTcn(self.embedding.width, config.hidden, config.text, config.dropout)
        self.speech = speech_encoder(audio, config.audio)
        self.emotion = EmotionEncoder(config.emotion) if config.emotion else None
        self.face = face_encoder(config.face) if config.face else None
        width = pose + 1 + config.audio + config.text + config.speaker + config.emotion + config.face
        self.both_ways = BothWaysGru(width, config.hidden, config.layers, config.dropout)
        half = config.hidden // 2
        self.out = nn.Sequential(nn.Conv1d(config.hidden, half, 1), nn.LeakyReLU(config.slope), nn.Conv1d(half, pose, 1))
        self.discriminator = WindowDiscriminator(pose, config.frames, config.slope) if config.adversarial else None

    @classmethod
    def arrays_for(cls, config: MultiContextConfig) -> tuple[str, ...]:
        """With emotion and face, where it has encoders of them."""
        widths = {"emotion": config.emotion, "face": config.face}
        return (*cls.arrays, *(name for name, width in widths.items() if width))

    def forward(self, inputs: ModalityInputs, noise: Tensor) -> Tensor:
        """Inputs of T frames, and ε, (B, T, width of z) → (B, T, D)."""
        return self._generate(inputs, noise).pose

    def _generate(self, inputs: ModalityInputs, noise: Tensor) -> SampledWindows:
        """``noise``: (B, T or 1, width of z) of N(0, 1), ε."""
        mean, variance = self.speaker(inputs.speaker)
        z = mean + torch.exp(variance / 2) * noise.mT
        parts = [inputs.seed.mT, self.speech(inputs.audio.mT), self.text(inputs.words.mT, Memory()), z]
        parts += [] if self.emotion is None else [self.emotion(inputs.emotion)]
        parts += [] if self.face is None else [self.face(inputs.face.mT)]
        return SampledWindows(self.out(self.both_ways(torch.cat(parts, 1))).mT, z, mean, variance)

    def recurrent_layers(self) -> tuple[BothWaysGru, ...]:
        """Its one recurrent layer."""
        return (self.both_ways,)

    # what is optimised -----------------------------------------------------------------------------------------------

    def _diversity(self, batch: Batch, inputs: ModalityInputs, sample: SampledWindows) -> Tensor:
        """How much the motion of another, random speaker differs, relative to the difference of z."""
        speaker = (batch.chance.uniform(len(batch)) * self.speakers).long().clamp_max(self.speakers - 1)
        weights = weights_of(speaker, self.speakers).unsqueeze(1).expand_as(inputs.speaker)
        other = self._generate_in_training(batch, inputs._replace(speaker=weights))
        return pose_diversity(sample.pose, other.pose, sample.z, other.z, self.config.beta)
