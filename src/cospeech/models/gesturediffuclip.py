"""GestureDiffuCLIP-like: after Ao et al. 2023, "GestureDiffuCLIP: Gesture Diffusion Model with CLIP Latents". Their code was
never published, and CLIP's weights are not used: a small encoder of labels and motion, trained here, takes CLIP's place.

    motion ─► encoder ─► z (L numbers for four frames) ─► decoder ─► motion

    words ──► 8 causal convolutions ─► t ─┐ contrast, step by step
    z ──────► 2 convolutions ───────► g ──┘
    label, speaker ─► e ─┐ contrast, clip by clip           style s: e of a label, or e of an example clip
    motion ────────► e ──┘

    speech ─► encoder ─► a ─┐
    t ──────────────────────┼─► transformer, steered by s and φ through AdaIN ─► v̂
    x_φ ────────────────────┘

Three things are minimised, one after the other:

    L_motion    = E |m − m̂| + E |Δm − Δm̂|,                     m̂ of z + δ, δ ~ N(0, 0.1²)
    L_align     = (NCE(t, g) + NCE(g, t)) / 2 + NCE(e_motion, e_emotions) + NCE(e_motion, e_speakers)
                  NCE(q, k)ᵢ = −ln exp(cos(qᵢ, kᵢ) / τ) / Σⱼ exp(cos(qᵢ, kⱼ) / τ)
    L_diffusion = E (v̂(x_φ, φ, a, t, s) − v)²,  v = cos φ · ε − sin φ · z          models/nn/diffusion.py

It is played in some steps of DDIM from noise. Followed, changed, not said: docs/models/gesturediffuclip.md, by number.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..audio.emotions import EMOTIONS as NAMES
from ..audio.features.words import subword_rows
from ..errors import InputError
from .nn.coder import STRIDE, Down, Up
from .nn.conditioning import StyleEncoder
from .nn.configuration import SMALL_RECURRENT, ModelConfig
from .nn.contrast import choice_nce, info_nce, unit
from .nn.diffusion import add_noise, denoise, level_features, velocity
from .nn.export import ExportGraph, Shape
from .nn.modalities import check_lacks, weights_of
from .nn.norm import BatchNorm1d
from .nn.objective import Batch, Objective
from .nn.sampled import Sampled, at_rest, fill_up, hold
from .nn.settings import check_least
from .nn.temporal import Memory, TextTcn
from .nn.transformer import StyledTransformer
from .nn.words import SubwordTable, word_embedding

__all__ = ["GestureDiffuClip", "GestureDiffuClipConfig"]

LATENT_NOISE = 0.1  # deviation of δ, so that the decoder makes motion of latents that are only nearly right; ours
LEVELS = 8  # multiples of φ whose cosines and sines tell the level of noise; ours
LABEL_SHARE, NO_STYLE_SHARE = 0.5, 0.1  # share of training windows with a label for the style, and with none; ours


@dataclass(frozen=True)
class GestureDiffuClipConfig(ModelConfig):
    """Sizes and weights; [ours] where nothing else is said: the paper has another skeleton, another rate, and CLIP."""

    TINY: ClassVar[Mapping[str, Any]] = {
        "hidden": 16, "latent": 6, "heard": 16, "text_channels": 6, "text": 6, "word_width": 5, "style": 6, "width": 8,
        "layers": 1, "heads": 2, "steps": 3, "align_from": 40, "diffusion_from": 50,
    }  # fmt: skip
    SMALL: ClassVar[Mapping[str, Any]] = {
        "hidden": 96, "latent": 16, "heard": 64, "text": 32, "text_channels": 32, "word_width": 32, "style": 16, "width": 64,
        "layers": 3, "align_from": 200, "diffusion_from": 250,
    }  # fmt: skip
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_RECURRENT

    frames: int = 36
    """T of a training window: the 34 of BEAT's systems, filled up to a multiple of 4."""
    hidden: int = 512
    """Channels of the autoencoder's widest layers."""
    latent: int = 64
    """L, numbers of a step of z."""
    velocity: float = 1.0
    """Weight of the step from frame to frame, of the autoencoder."""
    heard: int = 256
    """Of the speech."""
    text: int = 128
    """Of t and g."""
    text_channels: int = 256
    """Of the network of words, as CaMN's."""
    word_width: int = 300
    """Of a word where the network learns it; fastText's 300."""
    style: int = 64
    """Of e and s; CLIP's is 512."""
    temperature: float = 0.1
    """τ."""
    width: int = 256
    """Of the transformer."""
    layers: int = 8
    """Of the transformer."""
    heads: int = 4
    """Of the transformer's attention."""
    steps: int = 20
    """Of DDIM, when it plays."""
    align_from: int = 26400
    """Step at which the autoencoder is done: 100 epochs of BEAT's four speakers in batches of 256."""
    diffusion_from: int = 52800
    """Step at which both contrastive encoders are done."""

    def __post_init__(self) -> None:
        low = {"frames": 2 * STRIDE, "hidden": 4, "latent": 1, "heard": 4, "text": 1, "text_channels": 1, "word_width": 1}
        low |= {"style": 1, "width": 1, "layers": 1, "heads": 1, "steps": 1, "velocity": 0, "align_from": 0}
        check_least(self, "a GestureDiffuClip", low | {"diffusion_from": self.align_from})
        if self.frames % STRIDE or self.width % self.heads or not self.temperature > 0:
            problem = f"frames {self.frames}, width {self.width} of {self.heads} heads, temperature {self.temperature}"
            raise InputError(f"a GestureDiffuClip with {problem}", f"multiples of {STRIDE} and of the heads; above 0")


# parts ---------------------------------------------------------------------------------------------------------------


class _Labels(nn.Module):
    """Labels of a style: an emotion, by the subwords of its name, and a speaker; one vector for each."""

    names: Tensor

    def __init__(self, config: GestureDiffuClipConfig, speakers: int) -> None:
        super().__init__()
        self.table = SubwordTable(config.word_width)
        self.text = nn.Sequential(
            nn.Linear(config.word_width, config.text_channels), nn.ReLU(), nn.Linear(config.text_channels, config.style)
        )
        self.speakers = nn.Parameter(torch.randn(speakers, config.style))
        self.register_buffer("names", torch.from_numpy(subword_rows([*NAMES])), persistent=False)

    def emotions(self) -> Tensor:
        """(8, C) vectors of the emotions."""
        return self.of_words(self.names)

    def of_words(self, ids: Tensor) -> Tensor:
        """(n, GRAMS) ids of subwords → (n, C)."""
        vectors: Tensor = self.text(self.table(ids.unsqueeze(0)))[0]
        return vectors

    def forward(self, speaker: Tensor, emotion: Tensor) -> Tensor:
        """(B, S) and (B, 8) weights → (B, C) styles; of no weights zeros."""
        style = speaker @ unit(self.speakers) + emotion @ unit(self.emotions())
        is_known = (speaker.sum(1) + emotion.sum(1) > 0).unsqueeze(1)
        return torch.where(is_known, unit(style), 0.0)


class _Denoiser(nn.Module):
    """x_φ, the noise's level, speech with words, and a style → v̂; (B, ·, S)."""

    def __init__(self, config: GestureDiffuClipConfig) -> None:
        super().__init__()
        self.widths = [config.heard, config.text]
        self.level = nn.Sequential(nn.Conv1d(2 * LEVELS, config.width, 1), nn.ReLU(), nn.Conv1d(config.width, config.width, 1))
        self.style = nn.Conv1d(config.style, config.width, 1, bias=False)
        self.transformer = StyledTransformer(
            config.latent + config.heard, config.latent, width=config.width, words=config.text, layers=config.layers,
            heads=config.heads,
        )  # fmt: skip

    def forward(self, features: Tensor, style: Tensor, latent: Tensor, level: Tensor) -> Tensor:
        speech, words = features.split(self.widths, 1)
        condition = self.level(level) + self.style(style)
        estimate: Tensor = self.transformer(torch.cat([latent, speech], 1), words, condition)
        return estimate


# the model -----------------------------------------------------------------------------------------------------------


class GestureDiffuClip(Sampled):
    """GestureDiffuCLIP-like (after Ao et al. 2023): motion drawn by diffusion, in the style of a label or of an example.

    Poses and audio are standardised vectors. In `make` the diffusion begins with the noise, normal numbers. Zeros give a motion
    in the middle of the possible ones.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech.
        speakers: S.
        text: width of the store's word vectors; 0: it has ids of subwords.

    Raises:
        InputError: no pose, no speech, no speaker.
    """

    arrays = ("pose", "audio", "text", "emotion")
    optional_arrays = ("text", "emotion")
    dimensions = ("pose", "audio", "speakers", "text")
    encodes_style = True
    Config = GestureDiffuClipConfig
    config: GestureDiffuClipConfig

    def __init__(self, config: GestureDiffuClipConfig, *, pose: int, audio: int, speakers: int, text: int = 0) -> None:
        super().__init__()
        if min(pose, audio, speakers) < 1:
            problem = f"a GestureDiffuClip of {speakers} speakers from {audio} numbers of speech to {pose} of a pose"
            raise InputError(problem, "all are positive")
        self.config, self.pose, self.embedding = config, pose, word_embedding(text, config.word_width)
        self.audio, self.speakers = audio + self.embedding.width, speakers
        self.styles, self.modes = config.style, config.latent
        self.heard, self.latent = config.heard + config.text, config.latent
        self.down = nn.Sequential(Down(pose, config.hidden), nn.Conv1d(config.hidden, config.latent, 1))
        self.norm = BatchNorm1d(config.latent, affine=False)  # a latent is as large as the noise
        self.up = Up(config.latent, config.hidden, pose)
        self.reader = TextTcn(self.embedding.width, config.text_channels, config.text, 0.0)
        self.gesture = nn.Sequential(
            nn.Conv1d(config.latent, config.text, 3, padding=1), nn.ReLU(), nn.Conv1d(config.text, config.text, 1)
        )
        self.labels = _Labels(config, speakers)
        self.example = StyleEncoder(pose, channels=config.heard, style=config.style, norm=False)
        self.speech = Down(audio, config.heard)
        self.denoiser = _Denoiser(config)

    # encoders --------------------------------------------------------------------------------------------------------

    def read(self, text: Tensor) -> Tensor:
        """(B, T, GRAMS) ids, or (B, T, ·) vectors → t, (B, text, T / 4)."""
        return self._read(self.embedding(text).mT)

    def _read(self, words: Tensor) -> Tensor:
        """Embedded words (B, W, T) → t."""
        return F.avg_pool1d(self.reader(words, Memory()), STRIDE)

    def hear(self, audio: Tensor) -> Tensor:
        """(B, A + W, T) speech, then words → a and t, (B, heard + text, T / 4)."""
        speech, words = audio.split([self.audio - self.embedding.width, self.embedding.width], 1)
        return torch.cat([self.speech(speech), self._read(words)], 1)

    def encode(self, pose: Tensor) -> Tensor:
        """(B, T, D) → z, (B, L, T / 4)."""
        with at_rest(self.down, self.norm):
            z: Tensor = self.norm(self.down(pose.mT))
        return z

    def decode(self, latent: Tensor) -> Tensor:
        """See `Sampled`."""
        poses: Tensor = self.up(latent)
        return poses

    def style_of(self, poses: Tensor) -> Tensor:
        """(B, T, D) poses of an example, 8 frames at least → (B, style)."""
        return unit(self.example(poses))

    @torch.no_grad()
    def style_of_label(self, label: str) -> Tensor:
        """(style,) the style that words describe, each read as a name of an emotion; for other words it is a guess."""
        ids = torch.from_numpy(subword_rows(label.split() or [None])).to(self.labels.names)
        return unit(unit(self.labels.of_words(ids)).mean(0))

    @torch.no_grad()
    def speaker_styles(self, stretches: Tensor) -> Tensor:
        """(S, n, T, D) → (S, style): the mean style of each speaker's poses."""
        return torch.stack([unit(self.style_of(own).mean(0)) for own in stretches])

    @torch.no_grad()
    def label_styles(self) -> dict[str, Tensor]:
        """The emotions' labels."""
        return {name: self.style_of_label(name) for name in NAMES}

    # what is optimised -----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """The autoencoder; then the contrastive encoders; then, with all of these fixed, the diffusion."""
        c = self.config
        stages: list[Sequence[nn.Module]] = [
            (self.down, self.up), (self.embedding, self.reader, self.gesture, self.labels, self.example),
            (self.speech, self.denoiser),
        ]  # fmt: skip
        motion, align, diffusion = ([p for module in modules for p in module.parameters()] for modules in stages)
        return {
            "motion": Objective(motion, self.motion_loss, stop=c.align_from),
            "align": Objective(align, self.align_loss, start=c.align_from, stop=c.diffusion_from),
            "diffusion": Objective(diffusion, self.diffusion_loss, start=c.diffusion_from),
        }

    def motion_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L_motion."""
        pose = batch["pose"].mT
        z = self.norm(self.down(pose))
        noisy = z + LATENT_NOISE * batch.chance.normal(len(z), *z.shape[1:])
        motion = self.up(noisy)
        return {
            "pose": (motion - pose).abs().mean(),
            "velocity": self.config.velocity * (motion.diff(dim=-1) - pose.diff(dim=-1)).abs().mean(),
        }

    def align_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L_align: words beside gestures, labels beside motion."""
        text, gestures = self.read(batch["text"]), self.gesture(self.encode(batch["pose"]))
        tau, style = self.config.temperature, self.style_of(batch["pose"])
        return {
            "words": (info_nce(text, gestures, tau) + info_nce(gestures, text, tau)) / 2,
            "emotion": choice_nce(style, self.labels.emotions(), self._emotion(batch.arrays), tau),
            "speaker": choice_nce(style, self.labels.speakers, batch["speaker"], tau),
        }

    def diffusion_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L_diffusion, at an angle drawn for each window."""
        z, chance, rows = self.encode(batch["pose"]), batch.chance, len(batch)
        with at_rest(self.embedding, self.reader, self.labels, self.example):
            text, style = self.read(batch["text"]), self._training_style(batch)
        angle, noise = pi / 2 * chance.uniform(rows), chance.normal(rows, *z.shape[1:])
        features = torch.cat([self.speech(batch["audio"].mT), text], 1)
        estimate = self._estimate(features, style, add_noise(z, noise, angle), angle)
        return {"velocity": (estimate - velocity(z, noise, angle)).square().mean()}

    def _emotion(self, arrays: Mapping[str, Tensor]) -> Tensor:
        """(B,) label of each window's first frame; −1: unknown."""
        return arrays["emotion"][:, 0] if "emotion" in arrays else torch.full_like(arrays["speaker"], -1)

    def _training_style(self, batch: Batch) -> Tensor:
        """(B, style): of the window's own motion, of its labels, or no style."""
        coin = batch.chance.uniform(len(batch), 1)
        speaker, emotion = weights_of(batch["speaker"], self.speakers), weights_of(self._emotion(batch.arrays), len(NAMES))
        style = torch.where(coin < LABEL_SHARE, self.labels(speaker, emotion), self.style_of(batch["pose"]))
        return torch.where(coin > 1 - NO_STYLE_SHARE, 0.0, style)

    def _estimate(self, features: Tensor, style: Tensor, latent: Tensor, angle: Tensor) -> Tensor:
        """v̂ of (B, L, S) latents at angles (B,), in styles (B, style)."""
        steps = latent.shape[-1]
        conditions = (x.unsqueeze(-1).expand(-1, -1, steps) for x in (style, level_features(angle, LEVELS)))
        step_style, level = conditions
        estimate: Tensor = self.denoiser(features, step_style, latent, level)
        return estimate

    # generation ------------------------------------------------------------------------------------------------------

    @torch.no_grad()
    def draw(self, features: Tensor, style: Tensor, noise: Tensor, prefix: Tensor | None = None) -> Tensor:
        """(B, S, L) latents from noise of that shape, for speech and words (B, heard + text, S), in styles (B, style).

        Args:
            features: of speech and words.
            style, noise: as above.
            prefix: (B, k, L) known latents of the first steps.
        """

        def estimate(x: Tensor, angle: float) -> Tensor:
            return self._estimate(features, style, x.mT, torch.full((len(x),), angle, device=x.device)).mT

        return denoise(estimate, noise, self.config.steps, prefix)

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor) -> Tensor:
        """(B, T, A + W), (B, T, style), of which the first frame's holds throughout, (B, T, L) of noise → (B, T, D)."""
        return self.decode(self.draw(self.hear(audio.mT), style[:, 0], mode_noise[:, ::STRIDE]).mT).mT

    @torch.no_grad()
    def play(self, arrays: Mapping[str, Tensor], lacks: Collection[str] = (), noise: Tensor | None = None) -> dict[str, Tensor]:
        """Poses for the arrays of a batch, of any length, in the style of its labels.

        Args:
            arrays: ``audio``, ``text``, ``speaker``, ``emotion``, and ``pose``, of which the first four frames are used.
            lacks: names of `cospeech.models.nn.modalities.INPUTS` that are left out.
            noise: (B, T, L) of N(0, 1); none: drawn, always the same.

        Returns:
            ``pose``: (B, T, D), standardised.

        Raises:
            InputError: there is no such input.
        """
        check_lacks(lacks)
        frames, words = arrays["audio"].shape[1], self.embedding(arrays["text"])
        words = torch.zeros_like(words) if "text" in lacks else words
        speech = fill_up(torch.cat([arrays["audio"], words], -1))
        features = self.hear(speech.mT)
        speaker, emotion = weights_of(arrays["speaker"], self.speakers), weights_of(self._emotion(arrays), len(NAMES))
        style = self.labels(speaker * ("speaker" not in lacks), emotion * ("emotion" not in lacks))
        step_noise = fill_up(self.draw_noise(arrays["audio"]) if noise is None else noise)[:, ::STRIDE]
        prefix = None if "seed" in lacks else self.encode(hold(arrays["pose"][:, :STRIDE], speech.shape[1]))[..., :1].mT
        return {"pose": self.decode(self.draw(features, style, step_noise, prefix).mT).mT[:, :frames]}

    def sampler(self) -> dict[str, ExportGraph]:
        """``denoise``."""
        latent: Shape = ("N", "S", self.latent)
        inputs: dict[str, Shape] = {"heard": (1, "S", self.heard), "style": ("N", "S", self.styles), "latent": latent}
        inputs["level"] = (1, "S", 2 * LEVELS)
        return {
            "denoise": ExportGraph(
                _Denoising(self), inputs, {"velocity": latent}, frames=8 * STRIDE, multiple=STRIDE, shortest=STRIDE,
                window=self.window, steps=self.config.steps,
            )
        }  # fmt: skip


class _Denoising(nn.Module):
    """The denoiser on (B, S, ·)."""

    def __init__(self, net: GestureDiffuClip) -> None:
        super().__init__()
        self.denoiser = net.denoiser

    def forward(self, features: Tensor, style: Tensor, latent: Tensor, level: Tensor) -> Tensor:
        estimate: Tensor = self.denoiser(features.mT, style.mT, latent.mT, level.mT).mT
        return estimate
