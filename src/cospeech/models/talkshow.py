"""TalkSHOW: Yi et al. 2023, "Generating Holistic 3D Human Motion from Speech": a face from the speech, and body and
hands drawn from a distribution given the speech.

    speech ─► encoder ─► 256, with the speaker ─► 6 convolutions ─► face (B, T, 52)

    body  ─► E_b ─► z ─► nearest of 2048 codes ─► D_b ─► body        four frames are a step
    hands ─► E_h ─► z ─► nearest of 2048 codes ─► D_h ─► hands

    speech ─► encoder, a quarter of the rate ─┐
    speaker ──────────────────────────────────┴─► gated PixelCNN ─► p(body code), then p(hand code | body code), step by step

Three things are minimised. First the two autoencoders (m̂ = D(z_q); models/nn/quantise.py):

    L_vq = E |m − m̂| + E |Δm − Δm̂| + β E (z − sg[e])²,   m the body, and likewise m the hands

then, with the autoencoders fixed, the prior of the next code (models/nn/pixel_cnn.py); and in all steps the face:

    L_prior = −E ln p(b_t | b_<t, h_<t, speech, speaker) / 2 − E ln p(h_t | b_≤t, h_<t, speech, speaker) / 2
    L_face = E (F − F*)²

Followed, changed, not said in the paper: docs/models/talkshow.md, by number.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from ..errors import InputError, nearest
from .nn.cascade import FACE
from .nn.coder import STRIDE, Down, Up
from .nn.configuration import SMALL_RECURRENT, ModelConfig
from .nn.export import ExportGraph, Shape
from .nn.modalities import check_lacks, weights_of
from .nn.objective import Batch, Objective
from .nn.pixel_cnn import GatedPixelCnn
from .nn.quantise import Quantiser
from .nn.sampled import Sampled, at_rest, fill_up, hold
from .nn.settings import check_least
from .nn.speech_encoders import SPEECH_ENCODERS
from .nn.temporal import Memory, SameConv

__all__ = ["TalkShow", "TalkShowConfig"]

PARTS = 2  # body and hands
SPEAKER_WIDTH = 64  # numbers of a speaker in the face's network; authors' code
SLOPE = 0.2  # of LeakyReLU of the face; authors' code


@dataclass(frozen=True)
class TalkShowConfig(ModelConfig):
    """Sizes and weights; the defaults are the paper's, or, where it is silent, the authors' code's."""

    TINY: ClassVar[Mapping[str, Any]] = {
        "frames": 36, "codes": 12, "code": 6, "hidden": 16, "heard": 16, "width": 8, "layers": 2, "latent": 8, "prior_from": 40,
    }  # fmt: skip
    SMALL: ClassVar[Mapping[str, Any]] = {
        "frames": 36, "codes": 128, "code": 16, "hidden": 96, "heard": 64, "width": 32, "layers": 5, "latent": 64,
        "prior_from": 300,
    }  # fmt: skip
    SMALL_TRAIN: ClassVar[Mapping[str, Any]] = SMALL_RECURRENT

    frames: int = 88
    """T of a training window; authors' code 88 at 30 per second. A multiple of 4."""
    codes: int = 2048
    """Of each codebook; authors' code 2048."""
    code: int = 64
    """Numbers of a code; authors' code 64."""
    hidden: int = 1024
    """Widest channels of the autoencoders; authors' code 1024."""
    commitment: float = 0.25
    """β; authors' code 0.25."""
    velocity: float = 1.0
    """Weight of the step from frame to frame; authors' code 1."""
    heard: int = 256
    """Of the features of speech for the prior; authors' code 256."""
    width: int = 256
    """Of the gated PixelCNN; authors' code 256."""
    layers: int = 15
    """Of the gated PixelCNN; authors' code 15."""
    prior_from: int = 52800
    """Steps of the first stage; authors' code 100 epochs."""
    latent: int = 256
    """Of the features of speech for the face; section 3.2."""
    face: float = 1.0
    """Weight of L_face, which trains a network of its own."""
    speech_encoder: str = "own"
    """Encoder of speech for the face, one of models/nn/speech_encoders.py; the paper's is wav2vec."""
    encoder: str = "facebook/wav2vec2-base-960h"
    """Of the speech encoder wav2vec: a name on Hugging Face's hub, or a folder; authors' code."""

    def __post_init__(self) -> None:
        low = {"frames": 2 * STRIDE, "codes": 2, "code": 1, "hidden": 4, "heard": 4, "width": 1, "layers": 2, "latent": 1}
        check_least(self, "a TalkSHOW", low | {"commitment": 0, "velocity": 0, "prior_from": 0, "face": 0})
        if self.frames % STRIDE:
            raise InputError(f"a TalkSHOW with windows of {self.frames} frames", f"a multiple of {STRIDE}")
        if self.speech_encoder not in SPEECH_ENCODERS:
            hint = nearest(self.speech_encoder, SPEECH_ENCODERS)
            raise InputError(f"no speech encoder is called {self.speech_encoder!r}"[:200], hint)


# parts ---------------------------------------------------------------------------------------------------------------


class _Coder(nn.Module):
    """The VQ-VAE of a part of the pose."""

    def __init__(self, pose: int, config: TalkShowConfig) -> None:
        super().__init__()
        self.down = nn.Sequential(Down(pose, config.hidden), nn.Conv1d(config.hidden, config.code, 1))
        self.quantiser = Quantiser(config.codes, config.code, config.commitment)
        self.up = Up(config.code, config.hidden, pose)

    def forward(self, pose: Tensor) -> tuple[Tensor, Tensor]:
        """(B, D, T) → the pose decoded from its codes, and the commitment loss."""
        z, commitment = self.quantiser(self.down(pose))
        return self.up(z), commitment

    def encode(self, pose: Tensor) -> Tensor:
        """(B, D, T) → (B, T / 4) numbers of codes."""
        return self.quantiser.indices(self.down(pose))

    def decode(self, weights: Tensor) -> Tensor:
        """(B, K, T / 4) weights of the codes → (B, D, T)."""
        poses: Tensor = self.up(self.quantiser.codes.mT @ weights)
        return poses


class _Face(nn.Module):
    """(B, A, T) of speech and (B, S, T) weights of the speakers → (B, 52, T)."""

    def __init__(self, config: TalkShowConfig, audio: int, speakers: int) -> None:
        super().__init__()
        self.encoder = SPEECH_ENCODERS[config.speech_encoder](config, audio, SameConv)
        self.speaker = nn.Conv1d(speakers, SPEAKER_WIDTH, 1)
        widths = [config.latent + SPEAKER_WIDTH, *[config.latent] * 6]
        self.layers = nn.ModuleList(
            nn.Sequential(nn.Conv1d(a, b, 3, padding=1), nn.GroupNorm(1, b), nn.LeakyReLU(SLOPE)) for a, b in pairwise(widths)
        )
        self.out = nn.Conv1d(config.latent, FACE, 1)

    def forward(self, speech: Tensor, who: Tensor) -> Tensor:
        x = torch.cat([self.encoder(speech, Memory()), self.speaker(who)], 1)
        for k, layer in enumerate(self.layers):
            x = layer(x) + (x if k else 0)
        face: Tensor = self.out(x)
        return face


def pick(logits: Tensor, uniform: Tensor) -> Tensor:
    """(B, K) logits and (B,) numbers of [0, 1] → (B,): the code at that place of the cumulative distribution; for 0 the most
    likely code."""
    cumulative = logits.softmax(-1).cumsum(-1)
    index = (cumulative < uniform.unsqueeze(-1) * cumulative[:, -1:]).sum(-1).clamp_max(logits.shape[-1] - 1)
    return torch.where(uniform > 0, index, logits.argmax(-1))


# the model -----------------------------------------------------------------------------------------------------------


class TalkShow(Sampled):
    """TalkSHOW (Yi et al. 2023): a face of the speech; body and hands drawn from a prior over codes, so that takes differ.

    Poses and audio are standardised vectors. In `make` the noise of a step is two numbers of [0, 1], for the body's code and
    the hands'; 0 is the most likely code.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose.
        audio: A, numbers of a frame of speech.
        speakers: S.
        hands: columns of the pose that are hands.

    Raises:
        InputError: no pose, no speech, no speaker; hands that are none or all of the pose.
    """

    arrays: tuple[str, ...] = ("pose", "audio", "face")
    optional_arrays = ("face",)
    dimensions = ("pose", "audio", "speakers", "hands")
    Config = TalkShowConfig
    config: TalkShowConfig
    order: Tensor

    def __init__(self, config: TalkShowConfig, *, pose: int, audio: int, speakers: int, hands: Sequence[int]) -> None:
        super().__init__()
        body = [column for column in range(pose) if column not in {*hands}]
        if min(pose, audio, speakers) < 1 or not 0 < len(body) < pose:
            problem = f"a TalkSHOW of {speakers} speakers, {audio} numbers of speech, {pose} of a pose, {len(hands)} of hands"
            raise InputError(problem, "all are positive, and some of a pose are of hands and others are not")
        self.config, self.pose, self.audio, self.arrays = config, pose, audio, self.arrays_for(config)
        self.styles, self.modes = speakers, PARTS
        self.heard, self.latent = config.heard, PARTS * config.codes
        self.columns = (body, list(hands))
        """Of a pose: those of the body, those of the hands."""
        self.register_buffer("order", torch.tensor([*body, *hands]).argsort(), persistent=False)
        self.body, self.hands = (_Coder(len(columns), config) for columns in self.columns)
        self.speech = Down(audio, config.heard)
        self.prior = GatedPixelCnn(config.codes, config.width, config.layers, config.heard, speakers)
        self.face = _Face(config, audio, speakers)

    @classmethod
    def encoder_for(cls, config: TalkShowConfig) -> str | None:
        """The paper's wav2vec 2.0, where it is the speech encoder of the face."""
        return config.encoder if config.speech_encoder == "wav2vec" else None

    @classmethod
    def arrays_for(cls, config: TalkShowConfig) -> tuple[str, ...]:
        """With the features of wav2vec 2.0, where that is the speech encoder of the face."""
        return (*cls.arrays, "wav2vec") if cls.encoder_for(config) else cls.arrays

    @property
    def coders(self) -> tuple[_Coder, _Coder]:
        """Of body and hands."""
        return self.body, self.hands

    def hear(self, audio: Tensor) -> Tensor:
        """See `Sampled`."""
        features: Tensor = self.speech(audio)
        return features

    def encode(self, pose: Tensor) -> Tensor:
        """(B, T, D) → (B, T / 4, 2) the codes of body and hands."""
        with at_rest(*self.coders):
            pairs = zip(self.coders, self.columns, strict=True)
            codes = [coder.encode(pose[..., columns].mT) for coder, columns in pairs]
        return torch.stack(codes, -1)

    def decode(self, latent: Tensor) -> Tensor:
        """(B, 2 K, T / 4) weights of the codes, of which one of the body's is 1 and one of the hands', → (B, D, T)."""
        weights = latent.split(self.config.codes, 1)
        parts = [coder.decode(x) for coder, x in zip(self.coders, weights, strict=True)]
        return torch.cat(parts, 1).index_select(1, self.order)

    # what is optimised -----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """First the autoencoders; then, with these fixed, the prior; in all steps the face."""
        first, prior = self.config.prior_from, [*self.speech.parameters(), *self.prior.parameters()]
        return {
            "codes": Objective([p for coder in self.coders for p in coder.parameters()], self.code_loss, stop=first),
            "prior": Objective(prior, self.prior_loss, start=first),
            "face": Objective(self.face.parameters(), self.face_loss),
        }

    def code_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L_vq of body and hands."""
        terms = {}
        for name, coder, columns in zip(("body", "hands"), self.coders, self.columns, strict=True):
            pose = batch["pose"][..., columns].mT
            motion, terms[f"{name}_commitment"] = coder(pose)
            terms[name] = (motion - pose).abs().mean()
            terms[f"{name}_velocity"] = self.config.velocity * (motion.diff(dim=-1) - pose.diff(dim=-1)).abs().mean()
        return terms

    def prior_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L_prior."""
        codes, features = self.encode(batch["pose"]), self.hear(batch["audio"].mT)
        who = weights_of(batch["speaker"], self.styles).unsqueeze(-1).expand(-1, -1, codes.shape[1])
        logits = self.prior.logits(codes, features, who)
        each = [F.cross_entropy(x, codes[..., k]) / PARTS for k, x in enumerate(logits)]
        return dict(zip(("body", "hands"), each, strict=True))

    def face_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """L_face; frames without a recorded face (NaN) do not count."""
        speech, face = batch[self.face.encoder.array].mT, batch["face"].mT
        who = weights_of(batch["speaker"], self.styles).unsqueeze(-1).expand(-1, -1, speech.shape[-1])
        off = torch.where(face.isnan(), 0.0, self.face(speech, who) - face.nan_to_num())
        return {"face": self.config.face * off.square().mean()}

    # generation ------------------------------------------------------------------------------------------------------

    @torch.no_grad()
    def draw(self, features: Tensor, who: Tensor, uniform: Tensor, prefix: Tensor | None = None) -> Tensor:
        """Codes, step by step.

        Args:
            features: (B, heard, S) of the speech of S steps.
            who: (B, speakers, S).
            uniform: (B, S, 2) of [0, 1].
            prefix: (B, k, 2) known codes of the first steps.

        Returns:
            (B, S, 2).
        """
        states: list[Tensor] = []
        above = [features.new_zeros(len(features), self.config.width, 1)] * PARTS
        codes = []
        for s in range(features.shape[-1]):
            here, row, own = slice(s, s + 1), list(above), None if prefix is None or s >= prefix.shape[1] else prefix[:, s]
            for k in range(PARTS):
                memory = Memory(states)
                logits = self.prior(above, row, features[..., here], who[..., here], memory)[k].squeeze(-1)
                codes.append(pick(logits, uniform[:, s, k]) if own is None else own[:, k])
                row[k] = self.prior.embedding(codes[-1]).unsqueeze(-1)
            states, above = memory.new_states, row
        return torch.stack(codes, 1).unflatten(1, (-1, PARTS))

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor) -> Tensor:
        """(B, T, A), (B, T, S) weights of the speakers, (B, T, 2) numbers of [0, 1] → (B, T, D)."""
        return self._decode_codes(self.draw(self.hear(audio.mT), style[:, ::STRIDE].mT, mode_noise[:, ::STRIDE]))

    def _decode_codes(self, codes: Tensor) -> Tensor:
        """(B, S, 2) codes → (B, T, D)."""
        return self.decode(F.one_hot(codes, self.config.codes).flatten(2).to(self.order.device, torch.float32).mT).mT

    def draw_noise(self, like: Tensor) -> Tensor:
        """See `Sampled`: uniform."""
        normal = super().draw_noise(like)
        return torch.special.ndtr(normal)

    @torch.no_grad()
    def play(self, arrays: Mapping[str, Tensor], lacks: Collection[str] = (), noise: Tensor | None = None) -> dict[str, Tensor]:
        """Poses and faces for the arrays of a batch, of any length.

        Args:
            arrays: ``audio``, ``speaker``, and ``pose``, of which the first four frames are used.
            lacks: names of `cospeech.models.nn.modalities.INPUTS` that are left out.
            noise: (B, T, 2) numbers of [0, 1]; none: drawn, always the same.

        Returns:
            ``pose``: (B, T, D), standardised; ``face``: (B, T, 52), 0 … 1.

        Raises:
            InputError: there is no such input.
        """
        check_lacks(lacks)
        frames, audio = arrays["audio"].shape[1], fill_up(arrays["audio"])
        speaker = torch.full_like(arrays["speaker"], -1) if "speaker" in lacks else arrays["speaker"]
        who = weights_of(speaker, self.styles).unsqueeze(-1).expand(-1, -1, audio.shape[1])
        uniform = fill_up(self.draw_noise(arrays["audio"]) if noise is None else noise)[:, ::STRIDE]
        prefix = None if "seed" in lacks else self.encode(hold(arrays["pose"][:, :STRIDE], audio.shape[1]))[:, :1]
        codes = self.draw(self.hear(audio.mT), who[..., ::STRIDE], uniform, prefix)
        face = self.face(arrays[self.face.encoder.array].mT, who[..., :frames])
        return {"pose": self._decode_codes(codes)[:, :frames], "face": face.mT.clamp(0, 1)}

    def speaker_styles(self, stretches: Tensor) -> Tensor:
        """(S, n, T, D) → (S, S): each speaker alone."""
        return torch.eye(self.styles, device=stretches.device)

    def sampler(self) -> dict[str, ExportGraph]:
        """``prior``."""
        step = _Step(self)
        codes: Shape = ("N", self.latent)
        inputs: dict[str, Shape] = {"heard": (1, self.heard), "style": ("N", self.styles), "before": codes, "codes": codes}
        return {"prior": ExportGraph(step, inputs, {"logits": codes}, step.states(), groups=PARTS)}


class _Step(nn.Module):
    """``prior``: a step of speech, codes of the step before, codes of this step drawn so far → logits; states are flat."""

    def __init__(self, net: TalkShow) -> None:
        super().__init__()
        self.prior, self.parts = net.prior, [net.config.codes] * PARTS
        self.widths = [net.config.width * past for past in net.prior.pasts for _ in range(PARTS)]

    def states(self) -> dict[str, int]:
        """Name → numbers of a take."""
        return {f"state{k}": width for k, width in enumerate(self.widths)}

    def forward(self, features: Tensor, style: Tensor, before: Tensor, codes: Tensor, *states: Tensor) -> tuple[Tensor, ...]:
        table = self.prior.embedding.weight
        above, row = ([(x @ table).unsqueeze(2) for x in each.split(self.parts, 1)] for each in (before, codes))
        memory = Memory(x.unflatten(1, (table.shape[1], -1)) for x in states)
        logits = self.prior(above, row, features.unsqueeze(2), style.unsqueeze(2), memory)
        return torch.cat(logits, 1).squeeze(2), *(x.flatten(1) for x in memory.new_states)
