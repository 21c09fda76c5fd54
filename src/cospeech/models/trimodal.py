"""Trimodal context: Yoon et al. 2020, "Speech Gesture Generation from the Trimodal Context of Text, Audio, and Speaker
Identity", in its own form, on TED: the speech is a waveform, and each window begins with the last poses of the one before.

    waveform ─► 4 strided convolutions ───────────────────► (32) ──┐
    words ────► 8 causal convolutions, skips ─────────────► (32) ──┤
    speaker ──► embedding ─► linear ─► μ, σ ─► z = μ + σ ε (16) ───┼─► GRU × 4, both directions, summed ─► MLP ─► ŷ (B, T, D)
    first 4 poses, flag ───────────────────────────────(D + 1) ────┘                                           │
                                                                   real or made? ◄─ GRU × 4 ◄─ conv 3 × 3 ◄────┘

    G   λ E Huber(y, ŷ) − λ_G E log D(ŷ) − λ_d E min(1000, Σ Huber(ŷ', ŷ) / |z' − z|₁) + λ_k KL(N(μ, σ) ‖ N(0, 1))
    D   − E log D(y) − E log(1 − D(ŷ)),       ŷ' of another speaker's z'

Followed, changed, not said in the paper: docs/models/trimodal.md, by number. The form of BEAT's tables is multi_context.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from ..errors import InputError
from .nn.configuration import SMALL_RECURRENT, ModelConfig
from .nn.modalities import SEEDS, weights_of
from .nn.objective import Batch
from .nn.recurrent import BothWaysGru
from .nn.seeded_windows import SeededWindows, WindowInputs
from .nn.settings import check_least
from .nn.speaker_latent import SpeakerLatent, pose_diversity
from .nn.temporal import Memory, TextTcn
from .nn.waveform_encoder import STRIDES, WaveformEncoder
from .nn.window_discriminator import AdversarialWindows, SampledWindows, WindowDiscriminator
from .nn.words import word_embedding

__all__ = ["Trimodal", "TrimodalConfig"]


@dataclass(frozen=True)
class TrimodalConfig(ModelConfig):
    """Sizes and weights; the defaults are the paper's, or, where it is silent, the authors' code's."""

    TINY: ClassVar[Mapping[str, Any]] = {
        "hidden": 8, "layers": 2, "word_width": 5, "strides": (5, 1, 1, 1), "adversarial_from": 5,
    }  # fmt: skip
    SMALL: ClassVar[Mapping[str, Any]] = {"hidden": 64, "layers": 2, "word_width": 32, "adversarial_from": 60}
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_RECURRENT

    frames: int = 34
    """T of a training window; section 4.2: 34 at 15 per second, of which 4 are known."""
    hidden: int = 300
    """Of each direction of the GRU, and of the convolutions of words; section 3.2 300."""
    layers: int = 4
    """Of the GRU; section 3.2 4."""
    dropout: float = 0.3
    """Between layers of the GRU and in the convolutions of words; authors' code 0.3."""
    strides: tuple[int, ...] = STRIDES
    """Of the convolutions of the waveform; authors' code. Their product is the number of samples of a frame."""
    audio: int = 32
    """Of speech; section 3.1 32."""
    text: int = 32
    """Of words; section 3.1 32."""
    speaker: int = 16
    """Of z; authors' code 16."""
    word_width: int = 300
    """Of a word where the network learns it; section 3.1 300."""
    slope: float = 1.0
    """Of LeakyReLU in the MLP and the discriminator; authors' ``LeakyReLU(True)`` is a slope of 1, which is none at all."""
    reconstruction: float = 500.0
    """λ; authors' code 500."""
    beta: float = 0.1
    """β of Huber's loss, in deviations; authors' code 0.1."""
    adversarial: float = 5.0
    """λ_G; authors' code 5. 0: no discriminator."""
    adversarial_from: int = 17193
    """Step of the discriminator's first turn; authors' code after 11 epochs, each of 1,563 steps of TED."""
    diversity: float = 0.05
    """λ_d; authors' code 0.05."""
    diversity_beta: float = 0.05
    """β of Huber's loss there; authors' code 0.05."""
    divergence: float = 0.1
    """λ_k; authors' code 0.1."""
    seed_dropout: float = 0.0
    """Share of training windows without known poses, so that it can begin by itself; ours, as published 0."""
    stroke_timing: float = 0.0
    """Weight of the distance in time of rises and falls of the speed from the recorded ones; ours, as published 0."""

    def __post_init__(self) -> None:
        low = {"frames": SEEDS + 4, "hidden": 2, "layers": 1, "audio": 1, "text": 1, "speaker": 1, "word_width": 1}
        low |= {"dropout": 0, "slope": 0, "reconstruction": 0, "adversarial": 0, "adversarial_from": 0, "diversity": 0}
        check_least(self, "a trimodal network", low | {"divergence": 0, "seed_dropout": 0, "stroke_timing": 0})
        if not (self.dropout < 1 and self.seed_dropout <= 1 and min(self.beta, self.diversity_beta) > 0):
            problem = f"dropout {self.dropout}, seed_dropout {self.seed_dropout}, β {self.beta} and {self.diversity_beta}"
            raise InputError(f"a trimodal network with {problem}", "shares; β > 0")


class Trimodal(SeededWindows, AdversarialWindows):
    """Trimodal context (Yoon et al. 2020): one motion for one speech, from the waveform, words and speaker.

    Poses and audio are standardised. A style is [μ, log σ²] of a speaker's z, so that any number of speakers is possible.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose.
        audio: samples of a frame.
        speakers: S.
        text: width of the store's word vectors; 0: it has ids of subwords.

    Raises:
        InputError: no pose, no speaker; samples that the strides do not fit.
    """

    dimensions = ("pose", "audio", "speakers", "text")
    Config = TrimodalConfig
    normal_noise = True
    config: TrimodalConfig

    def __init__(self, config: TrimodalConfig, *, pose: int, audio: int, speakers: int, text: int = 0) -> None:
        super().__init__()
        if min(pose, speakers) < 1:
            raise InputError(f"a trimodal network of {speakers} speakers, {pose} numbers of a pose", "one at least")
        self.config, self.speakers = config, speakers
        self.measure(pose, audio, word_embedding(text, config.word_width))
        assert self.embedding is not None
        self.styles, self.modes = 2 * config.speaker, config.speaker
        self.speaker = SpeakerLatent(speakers, config.speaker)
        self.text = TextTcn(self.embedding.width, config.hidden, config.text, config.dropout)
        self.speech = self.build_speech_encoder(audio)
        self.known, width = self.build_pose_encoder()
        total = width + config.audio + config.text + config.speaker
        self.both_ways = BothWaysGru(total, config.hidden, config.layers, config.dropout)
        half = config.hidden // 2
        self.out = nn.Sequential(nn.Conv1d(config.hidden, half, 1), nn.LeakyReLU(config.slope), nn.Conv1d(half, pose, 1))
        self.discriminator = self.build_discriminator() if config.adversarial else None

    def build_speech_encoder(self, audio: int) -> nn.Module:
        """(B, T, A) → (B, width of speech, T)."""
        return WaveformEncoder(audio, self.config.strides, self.config.audio)

    def build_pose_encoder(self) -> tuple[nn.Module, int]:
        """An encoder, (B, D + 1, T) known poses and flag → (B, ·, T), and its numbers of a frame; here it changes nothing."""
        return nn.Identity(), self.pose + 1

    def build_discriminator(self) -> nn.Module:
        """(B, T, D) → (B,) logits."""
        return WindowDiscriminator(self.pose, self.config.frames, self.config.slope)

    def poses(self, inputs: WindowInputs, noise: Tensor) -> Tensor:
        """See `SeededWindows`; the noise is ε."""
        return self._generate(inputs, noise).pose

    def _generate(self, inputs: WindowInputs, noise: Tensor) -> SampledWindows:
        mean, variance = inputs.style.mT.chunk(2, 1)
        z = mean + torch.exp(variance / 2) * noise.mT
        parts = [self.known(inputs.seed.mT), self.speech(inputs.audio), self.text(inputs.words.mT, Memory()), z]
        return SampledWindows(self.out(self.both_ways(torch.cat(parts, 1))).mT, z, mean, variance)

    def speaker_style(self, speaker: Tensor) -> Tensor:
        """(B,) numbers → (B, 2 · width of z): μ and log σ²."""
        mean, variance = self.speaker(weights_of(speaker, self.speakers).unsqueeze(1))
        return torch.cat([mean, variance], 1).squeeze(2)

    @torch.no_grad()
    def speaker_styles(self, stretches: Tensor) -> Tensor:
        """(S, n, T, D) → (S, 2 · width of z)."""
        return self.speaker_style(torch.arange(self.speakers, device=stretches.device))

    # what is optimised -----------------------------------------------------------------------------------------------

    def _diversity(self, batch: Batch, inputs: WindowInputs, sample: SampledWindows) -> Tensor:
        """Of the motion of another, random speaker, which is taken as a constant (authors' code)."""
        speaker = (batch.chance.uniform(len(batch)) * self.speakers).long().clamp_max(self.speakers - 1)
        with torch.no_grad():
            style = self.speaker_style(speaker)[:, None].expand_as(inputs.style)
            other = self._generate_in_training(batch, inputs._replace(style=style))
        return pose_diversity(sample.pose, other.pose, sample.z, other.z, self.config.diversity_beta)
