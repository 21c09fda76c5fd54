"""Speech classifier: the speaker and the emotion of speech (Xu et al. 2024, section 3.3 and appendix A.4).

    speech (B, T, A) ─► 3 temporal convolutions ─► linear ─► logits of S speakers
                                              └──► linear ─► logits of 8 emotions

trained by L_cls = H(P_emo, Q_emo) + H(P_id, Q_id) (10), of a clip: the mean of its frames' logits. A clip whose emotion is not
known has no part in the loss of emotions. It is the first stage of a Chain of Generation, and can be trained by itself.
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
from .nn.cascade import EMOTIONS
from .nn.configuration import ModelConfig
from .nn.gain_augmentation import GainAugmentation
from .nn.objective import Batch, Objective
from .nn.settings import check_least
from .nn.temporal import SLOPE, Memory, SameConv
from .nn.trainable import Trainable

__all__ = ["SpeechClassifier", "SpeechClassifierConfig"]

_LAYERS = 3  # appendix A.4


@dataclass(frozen=True)
class SpeechClassifierConfig(ModelConfig):
    """Sizes; the paper gives the number of layers alone."""

    TINY: ClassVar[Mapping[str, Any]] = {"channels": 6}

    frames: int = 34
    """T of a training window; section 4.1."""
    channels: int = 128
    """Of each convolution; the paper's latent size."""
    kernel: int = 3
    """Frames that a convolution sees; ours."""
    dropout: float = 0.0
    """Behind each convolution; ours."""
    gain_augmentation: float = 0.0
    """dB by which training clips are made louder or softer at most; ours: the level of a recording says nothing."""


class SpeechClassifier(Trainable):
    """Estimates speaker and emotion; speech is standardised vectors.

    Args:
        config: sizes.
        audio: A, numbers of a frame of speech.
        speakers: S.
        louder: (A,) by how much each number of speech grows with 10 dB, for ``gain_augmentation``.

    Raises:
        InputError: sizes that are not positive, or an even kernel.
    """

    arrays = ("audio", "emotion")
    optional_arrays = ("emotion",)
    dimensions = ("audio", "speakers")
    Config = SpeechClassifierConfig
    config: SpeechClassifierConfig

    def __init__(self, config: SpeechClassifierConfig, *, audio: int, speakers: int, louder: Sequence[float] = ()) -> None:
        super().__init__()
        sizes = dict.fromkeys(("frames", "channels", "kernel", "audio", "speakers"), 1)
        check_least(vars(config) | {"audio": audio, "speakers": speakers}, "a speech classifier", sizes)
        if config.kernel % 2 == 0:
            raise InputError(f"kernel of a speech classifier is {config.kernel}", "an odd number")
        self.config, self.audio, self.speakers = config, audio, speakers
        widths = (audio, *[config.channels] * _LAYERS)
        self.convs = nn.ModuleList(SameConv(a, b, config.kernel) for a, b in pairwise(widths))
        self.gain_augmentation = GainAugmentation(config.gain_augmentation, audio, louder)
        self.dropout = nn.Dropout(config.dropout)
        self.heads = nn.ModuleList(nn.Linear(config.channels, count) for count in (speakers, EMOTIONS))

    @classmethod
    def dimensions_for(cls, config: SpeechClassifierConfig) -> tuple[str, ...]:
        """With ``louder``, where the gain is augmented."""
        return (*cls.dimensions, "louder") if config.gain_augmentation > 0 else cls.dimensions

    @property
    def reach(self) -> int:
        """Frames to either side that a frame's logits depend on."""
        return _LAYERS * (self.config.kernel // 2)

    def forward(self, audio: Tensor) -> Tensor:
        """(B, T, A) → (B, T, S + 8) logits of the speakers, then of the emotions."""
        x = audio.mT
        for conv in self.convs:
            x = self.dropout(F.leaky_relu(conv(x, Memory()), SLOPE))
        return torch.cat([head(x.mT) for head in self.heads], -1)

    @torch.no_grad()
    def weights(self, audio: Tensor) -> Tensor:
        """(B, T, A) of a clip → (B, S + 8) probabilities of the speakers, then of the emotions; each sums to 1."""
        logits = self(audio).mean(1).split((self.speakers, EMOTIONS), 1)
        return torch.cat([torch.softmax(each, 1) for each in logits], 1)

    def objectives(self) -> dict[str, Objective]:
        """One."""
        return {"classifier": Objective(self.parameters(), self.loss)}

    def loss(self, batch: Batch, step: int) -> dict[str, Tensor]:
        """Equation 10."""
        return self.losses(self.gain_augmentation(batch["audio"], batch.chance), batch["speaker"], batch["emotion"])

    def losses(self, audio: Tensor, speaker: Tensor, emotion: Tensor) -> dict[str, Tensor]:
        """Equation 10 of (B, T, A) speech, (B,) speakers, (B, T) emotions, −1: not known; a clip has its middle frame's."""
        who, how = self(audio).mean(1).split((self.speakers, EMOTIONS), 1)
        emotion_loss = F.cross_entropy(how, emotion[:, emotion.shape[1] // 2], ignore_index=-1, reduction="sum") / len(audio)
        return {"emotion": emotion_loss, "speaker": F.cross_entropy(who, speaker)}

    def validate(self, batch: Batch) -> dict[str, Tensor]:
        """The loss, the share of clips with a wrong speaker, and the share of clips of known emotion with a wrong emotion."""
        audio, speaker, emotion = batch["audio"], batch["speaker"], batch["emotion"][:, self.window // 2]
        terms = self.losses(audio, speaker, batch["emotion"])
        who, how = (w.argmax(1) for w in self.weights(audio).split((self.speakers, EMOTIONS), 1))
        has_label = emotion >= 0
        wrong = ((how != emotion) & has_label).sum() / has_label.sum().clamp_min(1)
        return {
            "loss": terms["emotion"] + terms["speaker"],
            **terms,
            "wrong_emotion": wrong,
            "wrong_speaker": (who != speaker).float().mean(),
        }
