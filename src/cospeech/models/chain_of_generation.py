"""Chain of Generation: Xu et al. 2024, "Chain of Generation: Multi-Modal Gesture Synthesis via Cascaded Conditional Control".

It makes a face from speech, then the body with the face, then the hands with both. It also estimates speaker and emotion from
the speech, so that speech, words and four seed poses are enough to play it.

    speech ──► encoder ──► Â ──► FaceDec ──► F ──► TFFDec ──► F̂ ─┐
        │                  ├──────────────────────────────────────┤
        │        words ──► TCN ──► T̂ ─────────────────────────────┴─► CW-Attn ─► AdaLN ─► body ──► B
        └──► classifier ──► E, I ──► HyNet ──► S ──────────────────────────────────┴───► hands ──► H

    F = FaceDec(Â),  F̂ = TFFDec(F)                                                  (1)   models/nn/cascade.py
    C = CW-Attn([Â : T̂ : F̂])                                                        (2)   models/nn/channel_attention.py
    M = StyleInject(C, S),  B̂ = BodyDec(M),  B = BodyMlp(B̂)                         (3)
    Ĉ = CW-Attn([M : B̂]),  H = HandMlp(HandDec(StyleInject(Ĉ, S)))                  (4)
    S = HyNet(E, I),  StyleInject(X, S) = f(S) · X + g(S)                           (5)   models/nn/gesture_norm.py
    ℓ_Rhy = −1/N Σᵢ ln exp(cos(f(F̂ᵢ), g(Âᵢ)) / τ) / Σⱼ exp(cos(f(F̂ᵢ), g(Âⱼ)) / τ)   (6)   models/nn/contrast.py
    ℓ_Mse = 1/N Σᵢ (Fᵢ − F*ᵢ)²,  F* the recorded face                               (7)
    ℓ_Rec = ℓ_B + α ℓ_H,  ℓ_B = |B − B*|₁,  ℓ_H = |H − H*|₁                         (8)
    ℓ = λ_Rhy ℓ_Rhy + λ_Mse ℓ_Mse + λ_Rec ℓ_Rec                                     (9)   λ = 1, 1000, 500
    ℓ_cls = CCE(E) + CCE(I)                                                         (10)  models/speech_classifier.py

In a first stage of ``classifier_steps`` the classifier alone is trained (10). Then it is frozen, its probabilities are the
style, and all other parts are trained (9). Both decoders get the seed poses, the first four frames, with a flag.

Followed, changed, not said: docs/models/chain_of_generation.md. This file is the paper; what we add to it is in
`cospeech.models.chain_of_generation_extended`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import torch
from torch import Tensor
from torch.nn import functional as F

from ..errors import InputError, nearest
from .chain_export import chain_graphs
from .nn.cascade import EMOTIONS, Cascade, CascadeOutput, Layers, Signals, Through, Widths
from .nn.channel_attention import ChannelAttention
from .nn.configuration import SMALL_RECURRENT, ModelConfig
from .nn.contrast import RhythmIdentity
from .nn.export import ExportGraph
from .nn.modalities import INPUTS
from .nn.objective import Batch, Objective
from .nn.recurrent import BothWays
from .nn.settings import check_least
from .nn.speech_encoders import SPEECH_ENCODERS
from .nn.temporal import Memory, SameConv
from .nn.windowed import Windowed
from .nn.words import SubwordTable, WordEmbedding, word_embedding
from .speech_classifier import SpeechClassifier, SpeechClassifierConfig

__all__ = ["INPUTS", "ChainConfig", "ChainOfGeneration"]

_SIZES = (
    "latent", "hidden", "layers", "word_width", "text_channels", "reduction", "classifier_channels",
    "pose", "audio", "speakers",
)  # fmt: skip


@dataclass(frozen=True)
class ChainConfig(ModelConfig):
    """Sizes and weights; the defaults are the paper's, or, where it is silent, those of CaMN's code, which it builds on."""

    TINY: ClassVar[Mapping[str, Any]] = {
        "hidden": 8, "layers": 2, "word_width": 5, "latent": 8, "classifier_channels": 6, "classifier_steps": 10,
    }  # fmt: skip
    SMALL: ClassVar[Mapping[str, Any]] = {
        "hidden": 64, "layers": 2, "word_width": 32, "latent": 64, "classifier_steps": 150, "classifier_channels": 64,
    }  # fmt: skip
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_RECURRENT

    frames: int = 34
    """N; section 4.1."""
    seeds: int = 4
    """Frames at the beginning whose poses are given; section 4.1. 0, which is [ours]: there is no such input."""
    latent: int = 128
    """Of audio, text, face features and style; section 4.1."""
    hidden: int = 256
    """Of each LSTM, and, without ``gesture_features``, of B̂; not stated, CaMN's code 256."""
    gesture_features: int = 0
    """Of B̂ and Ĥ, by a linear layer after the LSTM; section 4.1: 128. 0: the LSTM's own numbers, as in CaMN's code."""
    layers: int = 4
    """Of each LSTM; not stated, CaMN's code 4."""
    dropout: float = 0.3
    """Between layers of LSTMs and in the text network; not stated, CaMN's code 0.3."""
    reduction: int = 8
    """Factor by which channel attention narrows; not stated, ours."""
    speech_encoder: str = "own"
    """Encoder of speech that makes Â, one of models/nn/speech_encoders.py; the paper's is wav2vec."""
    encoder: str = "facebook/wav2vec2-base-960h"
    """Of the speech encoder wav2vec: a name on Hugging Face's hub, or a folder; appendix A.2."""
    word_width: int = 300
    """Numbers of a word where the network learns them; appendix A.3: 300 of fastText's."""
    text_channels: int = 256
    """Of the text network; not stated, CaMN's code 256."""
    classifier_steps: int = 2000
    """Of the first stage; not stated, ours."""
    classifier_channels: int = 128
    """Not stated, ours."""
    classifier_kernel: int = 3
    """Frames that each of its convolutions sees; not stated, ours."""
    reconstruction: float = 500.0
    """λ_Rec; section 3.4."""
    hands: float = 1.0
    """α, weight of hands beside the body; not stated, ours."""
    face: float = 1000.0
    """λ_Mse; section 3.4."""
    rhythm: float = 1.0
    """λ_Rhy; section 3.4."""
    temperature: float = 0.1
    """τ of equation 6; section 4.1."""
    attention: bool = True
    """Whether it has CW-Attn; table 2 has rows without."""
    style_injection: bool = True
    """Whether styles are injected; table 2 has rows without."""


class ChainOfGeneration(Windowed):
    """Chain of Generation (Xu et al. 2024): estimates speaker and emotion from the voice, then makes face, body, hands in turn.

    It uses all of a clip, before and after a frame. Poses and speech are standardised vectors.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose; 141 as published.
        audio: A, numbers of a frame of speech.
        speakers: S; 4 as published.
        hands: columns of a pose that are hands.
        text: width of the store's word vectors, 300 as published; 0: it has ids of subwords.

    Raises:
        InputError: sizes that do not fit each other.
    """

    Config = ChainConfig
    config: ChainConfig
    arrays: tuple[str, ...] = ("pose", "audio", "text", "face", "emotion")
    optional_arrays = ("text", "face", "emotion")
    dimensions = ("pose", "audio", "speakers", "hands", "text")
    estimates_speaker = True

    def __init__(
        self, config: ChainConfig, *, pose: int, audio: int, speakers: int, hands: Collection[int], text: int = 0
    ) -> None:
        super().__init__()
        values = vars(config) | {"pose": pose, "audio": audio, "speakers": speakers}
        check_least(values, "a Chain of Generation", dict.fromkeys(_SIZES, 1) | {"gesture_features": 0})
        if config.frames < config.seeds + 1 or config.seeds < 0:
            raise InputError(f"clips of {config.frames} frames"[:200], "more than the seeds")
        if config.speech_encoder not in SPEECH_ENCODERS:
            raise InputError(
                f"no speech encoder is called {config.speech_encoder!r}"[:200], nearest(config.speech_encoder, SPEECH_ENCODERS)
            )
        layers = self.layers(config)
        if not config.attention:
            layers = replace(layers, attention=lambda channels: Through())
        if not config.style_injection:
            layers = replace(layers, style=lambda channels, width: Through())
        self.config, self.pose, self.arrays = config, pose, self.arrays_for(config)
        self.speech_encoder = SPEECH_ENCODERS[config.speech_encoder](config, audio, layers.conv)
        self.word = word_embedding(text, config.word_width)
        self.audio, self.styles, self.modes = self.speech_encoder.inputs + self.word.width, speakers + EMOTIONS, 0
        self.multiple = self.shortest = 1
        self.classifier = SpeechClassifier(
            SpeechClassifierConfig(config.frames, config.classifier_channels, config.classifier_kernel),
            audio=self.speech_encoder.inputs, speakers=speakers,
        )  # fmt: skip
        widths = Widths(self.word.width, config.text_channels, config.latent, speakers, self.extra_width)
        self.cascade = Cascade(layers, widths, pose=pose, hands=sorted(hands), dropout=config.dropout)
        self.rhythm = RhythmIdentity(config.latent, config.temperature)

    @classmethod
    def layers(cls, config: ChainConfig) -> Layers:
        """The layers of the cascade, which see a clip in both directions."""
        return Layers(
            conv=SameConv,
            attention=lambda channels: ChannelAttention(channels, config.reduction),
            recurrent=lambda inputs: BothWays(inputs, config.hidden, config.layers, config.dropout),
            hidden=config.hidden,
            features=config.gesture_features,
        )

    @classmethod
    def encoder_for(cls, config: ChainConfig) -> str | None:
        """The paper's wav2vec 2.0, where it is the speech encoder."""
        return config.encoder if config.speech_encoder == "wav2vec" else None

    @classmethod
    def arrays_for(cls, config: ChainConfig) -> tuple[str, ...]:
        """With the features of wav2vec 2.0 in place of ``audio``, where it is the speech encoder."""
        return tuple("wav2vec" if name == "audio" and cls.encoder_for(config) else name for name in cls.arrays)

    @property
    def extra_width(self) -> int:
        """Numbers of a frame that both decoders get beside their features: a seed pose and its flag."""
        return (self.pose + 1) * (self.config.seeds > 0)

    @property
    def accepts_face(self) -> bool:
        """Whether it was trained with given faces."""
        return False

    @property
    def accepts_seeds(self) -> bool:
        """Whether it was trained with seed poses."""
        return self.config.seeds > 0

    @property
    def word_embedding(self) -> SubwordTable | WordEmbedding:
        """The embedding of words."""
        return self.word

    # equations 1 to 5 -----------------------------------------------------------------------------------------------

    def words(self, text: Tensor) -> Tensor:
        """(B, T, GRAMS) ids, or (B, T, ·) vectors → (B, T, W), zeros where there is no word."""
        vectors: Tensor = self.word(text)
        return vectors

    def classify(self, audio: Tensor) -> Tensor:
        """(B, T, A) → (B, T, S + 8) logits of speakers and emotions per frame; their mean over time is a clip's."""
        logits: Tensor = self.classifier(audio)
        return logits

    def estimate_style(self, audio: Tensor) -> Tensor:
        """(B, T, A) → (B, S + 8) weights of a clip's speaker and emotion; no gradient passes."""
        training = self.classifier.training
        self.classifier.eval()
        weights = self.classifier.weights(audio)
        self.classifier.train(training)
        return weights

    def mask_seeds(self, pose: Tensor) -> Tensor:
        """(B, D, T) poses → (B, D + 1, T): the first four and a flag, then zeros."""
        first = torch.arange(pose.shape[-1], device=pose.device) < self.config.seeds
        return torch.where(first, torch.cat([pose, torch.ones_like(pose[:, :1])], 1), 0.0)

    def extra(self, seeds: Tensor, noise: Tensor) -> Tensor:
        """Further inputs of both decoders: (B, D + 1, T) of `mask_seeds`. The paper has no ``noise``."""
        return seeds if self.config.seeds else seeds[:, :0]

    def forward(
        self, speech: Tensor, words: Tensor, style: Tensor, extra: Tensor, memory: Memory, face: Tensor | None = None
    ) -> tuple[CascadeOutput, Tensor]:
        """Equations 1 to 5 of all frames: face, body and hands, and Â.

        Args:
            speech: (B, A, T).
            words: (B, W, T).
            style: (B, S + 8, T) E and I, weights of speakers, then of emotions; each sums to 1.
            extra: (B, ·, T), see `extra`.
            memory: blank; only causal layers keep states in it.
            face: (B, 52, T) known faces that TFFDec sees, NaN where it sees FaceDec's own; None: always FaceDec's own.
        """
        audio = self.speech_encoder(speech, memory)
        choose_face = (lambda own: own) if face is None else (lambda own: torch.where(face.isnan(), own, face))
        return self.cascade(Signals(audio, words, style, extra), memory, choose_face), audio

    # what is optimised ----------------------------------------------------------------------------------------------

    @property
    def preliminary_steps(self) -> int:
        """Those of the classifier."""
        return self.config.classifier_steps

    def objectives(self) -> dict[str, Objective]:
        """First the classifier alone; then all other parts, with the classifier fixed."""
        first = self.config.classifier_steps
        others = [p for name, p in self.named_parameters() if not name.startswith("classifier.")]
        return {
            "classifier": Objective(self.classifier.parameters(), self.classifier_loss, stop=first),
            "gestures": Objective(others, self.gesture_loss, start=first),
        }

    def classifier_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Equation 10."""
        return self.classifier.losses(batch[self.speech_encoder.array], batch["speaker"], batch["emotion"])

    def gesture_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Equation 9: its terms, weighted."""
        speech, pose = batch[self.speech_encoder.array], batch["pose"].mT
        style = self.estimate_style(speech).unsqueeze(1).expand(-1, speech.shape[1], -1).mT
        extra = self.extra(self.mask_seeds(pose), pose[:, :0])
        output, audio = self(speech.mT, self.words(batch["text"]).mT, style, extra, Memory())
        return self.losses(output, audio, pose, batch["face"].mT)

    def losses(self, output: CascadeOutput, audio: Tensor, pose: Tensor, face: Tensor) -> dict[str, Tensor]:
        """The terms of equation 9.

        Args:
            output: of the cascade.
            audio: (B, L, T) Â.
            pose: (B, D, T) recorded.
            face: (B, 52, T) recorded; NaN where it was not recorded: such frames do not count.
        """
        c = self.config
        terms = self.distances("", output.pose, pose, c.reconstruction)  # equation 8
        terms["face"] = c.face * torch.where(face.isnan(), 0.0, output.face - face.nan_to_num()).square().mean()  # equation 7
        terms["rhythm"] = c.rhythm * self.rhythm(output.features, audio)  # equation 6
        return terms

    def distances(self, name: str, output: Tensor, pose: Tensor, weight: float) -> dict[str, Tensor]:
        """Equation 8: L1 of body and hands between (B, D, T) poses; ``name`` begins the names of the terms."""
        body, hands = ((output[:, columns] - pose[:, columns]).abs().mean() for columns in self.cascade.columns)
        return {f"{name}body": weight * body, f"{name}hands": weight * self.config.hands * hands}

    # generation -----------------------------------------------------------------------------------------------------

    def poses(self, rows: Tensor, style: Tensor, noise: Tensor, seeds: Tensor, face: Tensor | None = None) -> CascadeOutput:
        """Output of the cascade for whole clips: ``rows`` (B, A + W, T) are speech and words; the others as in `forward`."""
        speech, words = rows.split((self.speech_encoder.inputs, self.word.width), 1)
        return self(speech, words, style, self.extra(seeds, noise), Memory(), face)[0]

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor) -> Tensor:
        """Poses of speech and words, without seeds.

        Args:
            audio: (B, T, A + W) speech, then words (`words`).
            style: (B, T, S + 8) weights of speakers, then of emotions; each sums to 1.
            mode_noise: (B, T, modes) noise; the paper has no modes.

        Returns:
            (B, T, D).
        """
        rows, frames = audio.shape[:2]
        return self.poses(audio.mT, style.mT, mode_noise.mT, audio.new_zeros(rows, self.pose + 1, frames)).pose.mT

    @torch.no_grad()
    def play(
        self,
        arrays: Mapping[str, Tensor],
        lacks: Collection[str] = (),
        noise: Tensor | None = None,
        given: Collection[str] = (),
    ) -> dict[str, Tensor]:
        """Generate for the clips of a batch; as published from speech, words and seed poses.

        Args:
            arrays: ``audio`` (B, T, A), ``text``, ``pose`` (its first frames), and those of ``given``.
            lacks: names of `INPUTS` that are left out.
            noise: (B, T, modes); None: zeros.
            given: names, of face, emotion and speaker, that are taken from ``arrays`` where they are known there. All others
                are estimated from the speech.

        Returns:
            ``pose`` (B, T, D), standardised, and ``face`` (B, T, 52), 0 … 1.

        Raises:
            InputError: there is no such input.
        """
        for name in (*lacks, *given):
            if name not in INPUTS:
                raise InputError(f"no input is called {name!r}", nearest(name, INPUTS))
        fixed_inputs, speech = {*given} - {*lacks}, arrays[self.speech_encoder.array]
        rows, frames, speakers = *speech.shape[:2], self.styles - EMOTIONS
        words = speech.new_zeros(rows, frames, self.word.width) if "text" in lacks else self.words(arrays["text"])
        who, how = self.estimate_style(speech)[:, None].expand(-1, frames, -1).split((speakers, EMOTIONS), 2)
        if "speaker" in fixed_inputs:
            who = F.one_hot(arrays["speaker"], speakers)[:, None].expand(-1, frames, -1).to(who)
        if "emotion" in fixed_inputs:
            label = arrays["emotion"].unsqueeze(2)
            how = torch.where(label < 0, how, F.one_hot(label.squeeze(2).clamp_min(0), EMOTIONS).to(how))
        seeds = speech.new_zeros(rows, self.pose + 1, frames)
        if "seed" not in lacks and self.config.seeds:
            seeds = self.mask_seeds(arrays["pose"].mT)
        face = arrays["face"].mT if "face" in fixed_inputs else None
        noise = speech.new_zeros(rows, frames, self.modes) if noise is None else noise
        output = self.poses(torch.cat([speech, words], 2).mT, torch.cat([who, how], 2).mT, noise.mT, seeds, face)
        final_face = output.face if face is None else torch.where(face.isnan(), output.face, face)
        return {"pose": output.pose.mT, "face": final_face.mT.clamp(0, 1)}

    def export_module(self) -> dict[str, ExportGraph]:
        """``make`` and ``classify``; see `cospeech.models.chain_export`."""
        return chain_graphs(self)

    @torch.no_grad()
    def speaker_styles(self, stretches: Tensor) -> Tensor:
        """(S, n, T, D) poses of the speakers → (S, S + 8): each speaker alone, neutral."""
        speakers = self.styles - EMOTIONS
        return torch.cat([torch.eye(speakers), F.one_hot(torch.zeros(speakers, dtype=torch.long), EMOTIONS)], 1).to(stretches)
