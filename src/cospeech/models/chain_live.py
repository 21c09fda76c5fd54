"""Chain of Generation, live: a pose per frame, ``look_ahead`` frames after the speech that it belongs to; ours.

The equations are those of `cospeech.models.chain_of_generation`, with layers that see only the past: causal convolutions, LSTMs
one way, channel attention pooled over the last 34 frames (N of the paper). Every pose is delayed, so that all layers see
``look_ahead`` frames after it. Pieces of any size give the same poses as the whole (`step`).

It learns from the recordings, and from the output of a trained Chain of Generation, its teacher, for the same speech, style and
noise (Hinton et al. 2015: distillation); ℓ_teacher is the L1 distance to that output. The classifier and the table of words are
those of its teacher, and are not trained.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from ..errors import InputError
from .chain_of_generation import ChainConfig, ChainOfGeneration
from .chain_of_generation_extended import ChainExtendedConfig, ChainOfGenerationExtended, Turn
from .nn.cascade import Layers
from .nn.channel_attention import PastAttention
from .nn.objective import Batch, Objective
from .nn.part_speeds import Parts
from .nn.recurrent import Forwards
from .nn.temporal import CausalConv, Memory

__all__ = ["ChainLive", "ChainLiveConfig"]


@dataclass(frozen=True)
class ChainLiveConfig(ChainExtendedConfig):
    """The settings of its teacher, and those of live play; all of this is ours."""

    seeds: int = 0
    """It has no seed poses."""
    look_ahead: int = 6
    """Frames between speech and pose: 0.4 s at 15 a second."""
    pooling_window: int = 34
    """Frames that channel attention pools."""
    distillation: float = 500.0
    """Weight of the distance to the output of the teacher."""


class ChainLive(ChainOfGenerationExtended):
    """The causal Chain of Generation.

    Args:
        config: sizes and weights.
        pose, audio, speakers, hands, text, louder, parts: as in `ChainOfGeneration`.
        teacher: a trained one; without it everything is learnt from the recordings, the classifier first.
    """

    Config = ChainLiveConfig
    config: ChainLiveConfig

    def __init__(
        self, config: ChainLiveConfig, *, pose: int, audio: int, speakers: int, hands: Collection[int], text: int = 0,
        louder: Sequence[float] = (), parts: Parts = (), teacher: ChainOfGeneration | None = None,
    ) -> None:  # fmt: skip
        if config.look_ahead < 1 or config.pooling_window < 2:
            raise InputError(f"a look-ahead of {config.look_ahead} frames, {config.pooling_window} pooled", "1 and 2 at least")
        super().__init__(config, pose=pose, audio=audio, speakers=speakers, hands=hands, text=text, louder=louder, parts=parts)
        self.delay, self.teacher = config.look_ahead, teacher
        if teacher is not None:
            if (teacher.pose, teacher.audio, teacher.styles, teacher.modes) != (pose, self.audio, self.styles, self.modes):
                raise InputError("a teacher of other sizes", "the same poses, speech, speakers, word_width and noise")
            self.classifier, self.word = teacher.classifier, teacher.word

    @classmethod
    def layers(cls, config: ChainConfig) -> Layers:
        """Causal layers."""
        assert isinstance(config, ChainLiveConfig)
        return Layers(
            conv=CausalConv,
            attention=lambda channels: PastAttention(channels, config.reduction, config.pooling_window),
            recurrent=lambda inputs: Forwards(inputs, config.hidden, config.layers, config.dropout),
            hidden=config.hidden,
            features=config.gesture_features,
        )

    def train(self, mode: bool = True) -> ChainLive:
        """Set the training mode; the teacher stays in evaluation mode."""
        super().train(mode)
        if self.teacher is not None:
            self.teacher.eval()
        return self

    @property
    def preliminary_steps(self) -> int:
        """Those of the classifier; 0 with a teacher, which has a trained one."""
        return 0 if self.teacher is not None else super().preliminary_steps

    def objectives(self) -> dict[str, Objective]:
        """Those of the chain; with a teacher there is no first stage, and the parameters of the teacher are fixed."""
        parts = super().objectives()
        if self.teacher is None:
            return parts
        theirs = {id(p) for p in self.teacher.parameters()}
        return {
            name: Objective([p for p in part.parameters if id(p) not in theirs], part.loss)
            for name, part in parts.items()
            if name != "classifier"
        }

    def terms(self, batch: Batch, turn: Turn) -> dict[str, Tensor]:
        """Those of the chain, and the distance to its teacher."""
        terms = super().terms(batch, turn)
        if self.teacher is not None:
            now, speech = slice(self.delay, None), turn.inputs[self.speech_encoder.array][:, : self.config.frames]
            rows = torch.cat([speech, turn.words[..., : self.config.frames].mT], 2)
            with torch.no_grad():
                target = self.teacher.make(rows, turn.style[..., now].mT, turn.noise[..., now].mT)
            terms |= self.distances("teacher_", turn.output.pose, target.mT, self.config.distillation)
        return terms

    @torch.no_grad()
    def step(
        self, rows: Tensor, style: Tensor, mode_noise: Tensor, states: Sequence[Tensor] = ()
    ) -> tuple[Tensor, list[Tensor]]:
        """The next piece, of any number of frames.

        Args:
            rows: (B, T, A + W), as in `make`.
            style: (B, T, S + 8).
            mode_noise: (B, T, Z).
            states: after the piece before; none: the speech begins.

        Returns:
            (B, T, D) poses of the frames that lie ``look_ahead`` before these; and the states.
        """
        memory = Memory(states)
        speech, words = rows.mT.split((self.speech_encoder.inputs, self.word.width), 1)
        seeds = rows.new_zeros(len(rows), self.pose + 1, rows.shape[1])
        output, _ = self(speech, words, style.mT, self.extra(seeds, mode_noise.mT), memory)
        return output.pose.mT, memory.new_states
