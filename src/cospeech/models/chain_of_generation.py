"""Chain of Generation: Xu et al. 2024, "Chain of Generation: Multi-Modal Gesture Synthesis via Cascaded Conditional Control".

From speech first a face, then with it the body, then with both the hands; whose style and which mood is heard in the speech
too, so that nothing but speech and words is needed to play it. What is known besides is used.

    speech ──► enc ──► Â ──► FaceDec ──► F ──► TFFDec ──► F̂ ─┐
        │              ├─────────────────────────────────────┤
        │    words ──► TCN ──► T̂ ────────────────────────────┴─► CW-Attn ─► AdaLN ─► body ──► B
        └──► classifier ──► E, I ──► HyNet ──► S ─────────────────────────────┴───► hands ──► H      (models/nn/cascade.py)

    ℓ = λ_Rhy ℓ_Rhy + λ_Mse ℓ_Mse + λ_Rec (ℓ_B + α ℓ_H)     (9), λ = 1, 1000, 500

ℓ_Rhy of F̂ and Â (6, models/nn/contrast.py), ℓ_Mse = (F − F̂*)² of the recorded face (7), ℓ_B and ℓ_H the L1 distances of body
and hands (8). In a first stage of ``classifier_steps`` the classifier alone is trained (10, models/speech_classifier.py); then
it is frozen, and what it says is what the style is made of. Both decoders get the seed poses, the first four frames, with a
flag.

Followed, changed, not said: docs/models/chain_of_generation.md. Ours, off by default: clips without words or seeds, with the
style of their labels or with their recorded face, so that all of these may be missing or given when it plays; smooth noise, by
which takes differ; and, as a distance to one recording is least for the mean of all poses, a discriminator
(models/nn/pose_discriminator.py) and a loss of how large and how fast a clip moves, also to the speech of somebody else.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from ..errors import InputError, nearest
from .chain_config import ChainConfig
from .nn.adversarial_losses import ADVERSARIAL_LOSSES
from .nn.cascade import EMOTIONS, Cascade, CascadeOutput, Layers, Signals, Through, Widths
from .nn.channel_attention import ChannelAttention
from .nn.contrast import RhythmIdentity
from .nn.gain_augmentation import GainAugmentation
from .nn.gumbel import smooth_gumbel
from .nn.modalities import INPUTS
from .nn.motion_statistics_loss import motion_statistics
from .nn.objective import Batch, Objective
from .nn.patch import PATCH_FRAMES
from .nn.pose_discriminator import PoseDiscriminator
from .nn.recurrent import BothWays
from .nn.speech_encoders import SPEECH_ENCODERS
from .nn.temporal import Memory, SameConv
from .nn.windowed import Windowed
from .nn.words import word_embedding
from .speech_classifier import SpeechClassifier, SpeechClassifierConfig

__all__ = ["INPUTS", "Chain", "ChainConfig", "ChainOfGeneration", "Turn"]


class Turn(NamedTuple):
    """Of a batch in a step: what the cascade makes of it, and whose style and speech the discriminator compares it with."""

    made: CascadeOutput
    """Of the clip's own frames."""
    heard: Tensor
    """Â of all that was heard."""
    features: Tensor
    """F̂ of the same."""
    recorded: Batch
    """As the batch, as loud as it was heard."""
    played: Batch
    """As the batch, but with the speech, words and faces that were played to."""
    own: Tensor
    """(B, 1, 1) whether these are the clip's own."""
    style: Tensor
    """(B, S + 8, T)."""
    words: Tensor
    """(B, W, T)."""
    noise: Tensor
    """(B, Z, T)."""


class Chain(Windowed):
    """Equations 1 to 10, for layers of whichever kind.

    Args:
        config: sizes and weights.
        layers: what the cascade is built of.
        pose: D, numbers of a pose, standardised.
        audio: A, numbers of a frame of speech, standardised.
        speakers: S.
        hands: columns of a pose that are hands.
        text: width of the store's word vectors; 0: it has ids of subwords.
        louder: (A,) by how much each number of speech grows with 10 dB, for ``gain_augmentation``.
        delay: frames that a pose comes after its speech.

    Raises:
        InputError: sizes that do not fit each other.
    """

    arrays: tuple[str, ...] = ("pose", "audio", "text", "face", "emotion")
    """And ``speaker`` (B,), which every batch has."""
    spare = ("text", "face", "emotion")
    """What a clip may lack: then NaN, −1, or no word."""

    def __init__(
        self, config: ChainConfig, layers: Layers, *, pose: int, audio: int, speakers: int, hands: Collection[int],
        text: int, louder: Sequence[float], delay: int = 0,
    ) -> None:  # fmt: skip
        super().__init__()
        sizes = (config.latent, config.hidden, config.layers, config.word_width, config.text_channels, pose, audio, speakers)
        if min(*sizes, config.reduction, config.classifier_channels, config.discriminator_channels) < 1 or config.noise < 0:
            raise InputError(f"a chain of {config}"[:200], "sizes are positive")
        if config.frames < max(1, config.seeds + 1, PATCH_FRAMES * (config.adversarial > 0)) or config.seeds < 0:
            raise InputError(
                f"clips of {config.frames} frames"[:200], f"more than the seeds, {PATCH_FRAMES} at least to be judged"
            )
        if config.speech_encoder not in SPEECH_ENCODERS:
            raise InputError(
                f"no speech encoder is called {config.speech_encoder!r}"[:200], nearest(config.speech_encoder, SPEECH_ENCODERS)
            )
        if not config.attention:
            layers = replace(layers, attention=lambda channels: Through())
        if not config.style_injection:
            layers = replace(layers, style=lambda channels, width: Through())
        self.config, self.pose, self.delay = config, pose, delay
        self.speech_encoder = SPEECH_ENCODERS[config.speech_encoder](config, audio, layers.conv)
        self.arrays = tuple(self.speech_encoder.array if name == "audio" else name for name in self.arrays)
        self.word = word_embedding(text, config.word_width)
        self.audio, self.styles, self.modes = self.speech_encoder.inputs + self.word.width, speakers + EMOTIONS, config.noise
        self.multiple = self.shortest = 1
        self.classifier = SpeechClassifier(
            SpeechClassifierConfig(config.frames, config.classifier_channels, config.classifier_kernel),
            audio=self.speech_encoder.inputs, speakers=speakers,
        )  # fmt: skip
        self.gain_augmentation = GainAugmentation(config.gain_augmentation, self.speech_encoder.inputs, louder)
        extra = (pose + 1) * (config.seeds > 0) + config.noise
        widths = Widths(self.word.width, config.text_channels, config.latent, speakers, extra)
        self.cascade = Cascade(layers, widths, pose=pose, hands=sorted(hands), dropout=config.dropout)
        self.rhythm = RhythmIdentity(config.latent, config.temperature)
        heard, adversarial = self.speech_encoder.inputs, config.adversarial > 0
        self.discriminator = (
            PoseDiscriminator(pose, heard, config.discriminator_channels, speakers, EMOTIONS) if adversarial else None
        )
        self._shared_forward: tuple[Batch, Turn] | None = None

    @property
    def window(self) -> int:
        """Frames of a training window: a clip, and what is heard after it."""
        return self.config.frames + self.delay

    # the parts ------------------------------------------------------------------------------------------------------

    def words(self, text: Tensor) -> Tensor:
        """(B, T, GRAMS) ids, or (B, T, ·) vectors → (B, T, W), zeros where there is no word."""
        found: Tensor = self.word(text)
        return found

    def classify(self, audio: Tensor) -> Tensor:
        """(B, T, A) → (B, T, S + 8) logits of speakers and emotions per frame; their mean over time is a clip's."""
        logits: Tensor = self.classifier(audio)
        return logits

    def estimate_style(self, audio: Tensor) -> Tensor:
        """(B, T, A) → (B, S + 8) weights of a clip's speaker and emotion; nothing flows back."""
        training = self.classifier.training
        self.classifier.eval()
        weights = self.classifier.weights(audio)
        self.classifier.train(training)
        return weights

    def run(
        self, heard: Tensor, words: Tensor, style: Tensor, noise: Tensor, seeds: Tensor, memory: Memory,
        face: Tensor | None = None,
    ) -> tuple[CascadeOutput, Tensor]:  # fmt: skip
        """All frames of a piece, or of a clip with its delay: what the cascade makes, and Â.

        Args:
            heard: (B, A, T).
            words: (B, W, T).
            style: (B, S + 8, T).
            noise: (B, Z, T).
            seeds: (B, D + 1, T) poses and their flag, delayed, see `mask_seeds`.
            memory: blank, or of the piece before.
            face: (B, 52, T) recorded, NaN where FaceDec's own is to stand, of the frames that FaceDec makes.
        """
        features = self.speech_encoder(heard, memory)
        extra = torch.cat([seeds, noise] if self.config.seeds else [noise], 1)
        given = Signals(features, words, style, extra)
        seen = (lambda own: own) if face is None else (lambda own: torch.where(face.isnan(), own, face))
        return self.cascade(given, memory, seen), features

    def mask_seeds(self, pose: Tensor, known: Tensor) -> Tensor:
        """(B, D, T) poses, (B, 1, 1) whether they are known → (B, D + 1, T): the first four and a flag, delayed; else zeros."""
        first = (torch.arange(pose.shape[-1], device=pose.device) < self.config.seeds) & known
        both = torch.where(first, torch.cat([pose, torch.ones_like(pose[:, :1])], 1), 0.0)
        return F.pad(both, (self.delay, 0))[..., : pose.shape[-1]]

    def _cut(self, made: CascadeOutput) -> CascadeOutput:
        """Of the frames that all of their speech was heard of."""
        return CascadeOutput(*(x[..., self.delay :] for x in made))

    # what is optimised ----------------------------------------------------------------------------------------------

    def objectives(self) -> dict[str, Objective]:
        """The classifier; then, while it rests, D, where there is one, and all others."""
        first = self.config.classifier_steps
        parts = {"classifier": Objective(self.classifier.parameters(), self.classifier_loss, stop=first)}
        if self.discriminator is not None:
            parts["discriminator"] = Objective(self.discriminator.parameters(), self.discriminator_loss, start=first)
        others = [p for name, p in self.named_parameters() if name.partition(".")[0] not in ("classifier", "discriminator")]
        return parts | {"gestures": Objective(others, self.gesture_loss, start=first)}

    def classifier_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Equation 10."""
        return self.classifier.losses(
            self.gain_augmentation(batch[self.speech_encoder.array], batch.chance), batch["speaker"], batch["emotion"]
        )

    def _swap_speech(self, batch: Batch) -> tuple[Batch, Tensor]:
        """The batch with some clips' speech, words and faces those of the clip before; (B, 1, 1) which have their own."""
        own = batch.chance.uniform(len(batch), 1, 1) >= self.config.speech_swap * self.training
        names = {self.speech_encoder.array, "text", "face"}
        arrays = {n: torch.where(own, x, x.roll(1, 0)) if n in names else x for n, x in batch.arrays.items()}
        return Batch(arrays, batch.chance), own

    def _draw_style(self, played: Batch, own: Tensor) -> Tensor:
        """(B, S + 8, T) weights of speakers and of emotions."""
        speakers, label = self.styles - EMOTIONS, played["emotion"]
        heard = self.estimate_style(played[self.speech_encoder.array]).unsqueeze(1).expand(-1, label.shape[1], -1)
        told = F.one_hot(played["speaker"], speakers).unsqueeze(1).expand(-1, label.shape[1], -1)
        felt = torch.where((label < 0).unsqueeze(2), heard[..., speakers:], F.one_hot(label.clamp_min(0), EMOTIONS).float())
        coins = played.chance.uniform(len(played), 2, 1, 1) < self.config.label_conditioning * self.training
        who = torch.where(coins[:, 0] | ~own, told.float(), heard[..., :speakers])
        how = torch.where(coins[:, 1] | ~own, felt, heard[..., speakers:])
        return torch.cat([who, how], 2).mT

    def _turn(self, batch: Batch) -> Turn:
        """What both turns of a step need; D's leaves it to that of the others, as it moves nothing of it."""
        if self._shared_forward is not None and self._shared_forward[0] is batch:
            return self._shared_forward[1]
        heard = self.gain_augmentation(batch[self.speech_encoder.array], batch.chance)
        recorded = Batch({**batch.arrays, self.speech_encoder.array: heard}, batch.chance)
        played, own = self._swap_speech(recorded)
        style = self._draw_style(played, own)
        rows, frames = len(batch), style.shape[-1]
        noise = smooth_gumbel(batch.chance, rows, self.config.noise, frames, self.config.persistence)
        coins = batch.chance.uniform(rows, 3, 1, 1)
        coins = coins if self.training else torch.ones_like(coins)
        words = self.words(played["text"]).mT * (coins[:, 0] >= self.config.word_dropout)
        seeds = self.mask_seeds(batch["pose"].mT, coins[:, 1] >= self.config.seed_dropout)
        face = F.pad(played["face"].mT, (self.delay, 0), value=torch.nan)[..., :frames]
        face = torch.where(coins[:, 2] < self.config.face_teacher_forcing, face, torch.nan)
        made, features = self.run(played[self.speech_encoder.array].mT, words, style, noise, seeds, Memory(), face)
        return Turn(self._cut(made), features, made.features, recorded, played, own, style, words, noise)

    def _score(self, pose: Tensor, batch: Batch, shift: int = 0) -> Tensor:
        """D's scores of (B, D, T) poses; ``shift``: to the speech of so many rows before."""
        assert self.discriminator is not None
        heard, emotion = batch[self.speech_encoder.array].roll(shift, 0), batch["emotion"][:, self.config.frames // 2]
        scores: Tensor = self.discriminator(pose, heard[:, : self.config.frames].mT, batch["speaker"], emotion)
        return scores

    def discriminator_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Least squares, for D: recordings are true; what was made, and recordings to the speech of others, false."""
        self._shared_forward = None
        turn = self._turn(batch)
        self._shared_forward = (batch, turn) if torch.is_grad_enabled() else None
        pose, losses = batch["pose"][:, : self.config.frames].mT, ADVERSARIAL_LOSSES["squares"]
        terms = {"true": losses.true(self._score(pose, turn.recorded))}
        terms["false"] = losses.false(self._score(turn.made.pose.detach(), turn.played))
        if len(batch) > 1:
            terms["mismatched"] = losses.false(self._score(pose, turn.recorded, shift=1))
        return terms

    def gesture_loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """The terms of equation 9, weighted, and D's."""
        turn, self._shared_forward = self._turn(batch), None
        return self.terms(batch, turn)

    def terms(self, batch: Batch, turn: Turn) -> dict[str, Tensor]:
        """Of what was made."""
        c, frames, made = self.config, self.config.frames, turn.made
        pose, face = batch["pose"][:, :frames].mT, turn.played["face"][:, :frames].mT
        wanted = torch.where(turn.own, pose, made.pose)  # of no distance where nobody knows what would have been done
        terms = self.distances("", made.pose, wanted, c.reconstruction)  # equation 8
        terms["face"] = c.face * torch.where(face.isnan(), 0.0, made.face - face.nan_to_num()).square().mean()  # equation 7
        terms["rhythm"] = c.rhythm * self.rhythm(turn.features, turn.heard)  # equation 6
        if c.motion_statistics:
            terms["motion_statistics"] = (
                c.motion_statistics * (motion_statistics(made.pose) - motion_statistics(pose)).abs().mean()
            )
        if self.discriminator is not None:
            terms["adv"] = c.adversarial * ADVERSARIAL_LOSSES["squares"].generator_loss(self._score(made.pose, turn.played))
        return terms

    def distances(self, name: str, made: Tensor, pose: Tensor, weight: float) -> dict[str, Tensor]:
        """Equation 8: L1 of body and hands between (B, D, T) poses."""
        body, hands = ((made[:, columns] - pose[:, columns]).abs().mean() for columns in self.cascade.columns)
        return {f"{name}body": weight * body, f"{name}hands": weight * self.config.hands * hands}

    # generation -----------------------------------------------------------------------------------------------------

    def _whole(self, rows: Tensor, style: Tensor, noise: Tensor, seeds: Tensor, face: Tensor | None = None) -> CascadeOutput:
        """(B, ·, T) of all frames; what follows the last is as it is."""
        given = [torch.cat([x, x[..., -1:].expand(-1, -1, self.delay)], -1) for x in (rows, style, noise)]
        heard, words = given[0].split((self.speech_encoder.inputs, self.word.width), 1)
        if face is not None:
            face = F.pad(face, (self.delay, 0), value=torch.nan)
        return self._cut(self.run(heard, words, given[1], given[2], F.pad(seeds, (0, self.delay)), Memory(), face)[0])

    def make(self, audio: Tensor, style: Tensor, mode_noise: Tensor) -> Tensor:
        """Poses of speech and words, without seeds.

        Args:
            audio: (B, T, A + W) speech, then words (`words`).
            style: (B, T, S + 8) weights of speakers, then of emotions; each sums to 1.
            mode_noise: (B, T, Z) noise.

        Returns:
            (B, T, D).
        """
        rows, frames = audio.shape[:2]
        return self._whole(audio.mT, style.mT, mode_noise.mT, audio.new_zeros(rows, self.pose + 1, frames)).pose.mT

    @torch.no_grad()
    def play(
        self,
        arrays: Mapping[str, Tensor],
        lacks: Collection[str] = (),
        noise: Tensor | None = None,
        given: Collection[str] = (),
    ) -> dict[str, Tensor]:
        """Clips as a batch has them: as published, from speech, words and seed poses.

        Args:
            arrays: ``audio`` (B, T, A), ``text``, ``pose`` (its first frames), and what is given.
            lacks: of `INPUTS`, what is missing though it is there.
            noise: (B, T, Z).
            given: of face, emotion and speaker, what is not to be made of the speech; where it is not known, it is.

        Returns:
            ``pose`` (B, T, D), standardised, and ``face`` (B, T, 52), 0 … 1.

        Raises:
            InputError: another name.
        """
        for name in (*lacks, *given):
            if name not in INPUTS:
                raise InputError(f"no input is called {name!r}", nearest(name, INPUTS))
        wanted, heard = {*given} - {*lacks}, arrays[self.speech_encoder.array]
        rows, frames, speakers = *heard.shape[:2], self.styles - EMOTIONS
        words = heard.new_zeros(rows, frames, self.word.width) if "text" in lacks else self.words(arrays["text"])
        who, how = self.estimate_style(heard)[:, None].expand(-1, frames, -1).split((speakers, EMOTIONS), 2)
        if "speaker" in wanted:
            who = F.one_hot(arrays["speaker"], speakers)[:, None].expand(-1, frames, -1).to(who)
        if "emotion" in wanted:
            label = arrays["emotion"].unsqueeze(2)
            how = torch.where(label < 0, how, F.one_hot(label.squeeze(2).clamp_min(0), EMOTIONS).to(how))
        seeds = heard.new_zeros(rows, self.pose + 1, frames)
        if "seed" not in lacks and self.config.seeds:
            seeds = self.mask_seeds(arrays["pose"].mT, seeds.new_ones(1, 1, 1, dtype=torch.bool))
        face = arrays["face"].mT if "face" in wanted else None
        noise = heard.new_zeros(rows, frames, self.modes) if noise is None else noise
        made = self._whole(torch.cat([heard, words], 2).mT, torch.cat([who, how], 2).mT, noise.mT, seeds, face)
        seen = made.face if face is None else torch.where(face.isnan(), made.face, face)
        return {"pose": made.pose.mT, "face": seen.mT.clamp(0, 1)}

    @torch.no_grad()
    def speaker_styles(self, stretches: Tensor) -> Tensor:
        """(S, n, T, D) poses of the speakers → (S, S + 8): each, in a neutral mood."""
        speakers = self.styles - EMOTIONS
        return torch.cat([torch.eye(speakers), F.one_hot(torch.zeros(speakers, dtype=torch.long), EMOTIONS)], 1).to(stretches)


class ChainOfGeneration(Chain):
    """Chain of Generation (Xu et al. 2024): estimates speaker and emotion from the voice, then makes face, body, hands in turn.

    The paper's: it sees all of a clip, both ways.

    Args:
        config: sizes and weights.
        pose: D, numbers of a pose; 141 as published.
        audio: A, numbers of a frame of speech.
        speakers: S; 4 as published.
        hands: columns of a pose that are hands.
        text: width of the store's word vectors, 300 as published; 0: it has ids of subwords.
        louder: see `Chain`.
    """

    Config = ChainConfig

    def __init__(
        self, config: ChainConfig, *, pose: int, audio: int, speakers: int, hands: Collection[int], text: int = 0,
        louder: Sequence[float] = (),
    ) -> None:  # fmt: skip
        layers = Layers(
            conv=SameConv,
            attention=lambda channels: ChannelAttention(channels, config.reduction),
            recurrent=lambda inputs: BothWays(inputs, config.hidden, config.layers, config.dropout),
            hidden=config.hidden,
        )
        super().__init__(config, layers, pose=pose, audio=audio, speakers=speakers, hands=hands, text=text, louder=louder)
