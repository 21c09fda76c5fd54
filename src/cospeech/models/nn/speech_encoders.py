"""Speech encoders of Chain of Generation, which make audio features Â; each reads one array of a store."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from torch import Tensor, nn

from ...errors import InputError
from .speech_encoder import load_transformer
from .temporal import CausalConv, Conv, ConvStack, Memory

__all__ = ["SPEECH_ENCODERS", "OwnSpeechEncoder", "SpeechEncoderConfig", "Wav2VecSpeechEncoder"]

_KERNEL = 3  # ours


class OwnSpeechEncoder(nn.Module):
    """Ours, small: mel powers and prosody, four temporal convolutions. (B, A, T) → (B, latent, T).

    Args:
        audio: A.
        latent: numbers of a frame of Â.
        conv: makes the convolutions.
    """

    array = "audio"

    def __init__(self, audio: int, latent: int, conv: Conv) -> None:
        super().__init__()
        self.inputs = audio
        self.convs = ConvStack(conv, (audio, *[latent] * 4), _KERNEL)

    def forward(self, audio: Tensor, memory: Memory) -> Tensor:
        out: Tensor = self.convs(audio, memory)
        return out


class Wav2VecSpeechEncoder(nn.Module):
    """The paper's: of wav2vec 2.0 the transformer, then a linear layer. (B, 512, T) → (B, latent, T).

    The store keeps its inputs, the features of the CNN, which is frozen.

    Args:
        encoder: folder or name of the pretrained one, with which its transformer begins.
        latent: numbers of a frame of Â.

    Raises:
        InputError: it cannot be loaded.
    """

    array = "wav2vec"

    def __init__(self, encoder: str, latent: int) -> None:
        super().__init__()
        self.transformer = load_transformer(encoder)
        self.inputs = self.transformer.inputs
        self.linear = nn.Linear(self.transformer.outputs, latent)

    def forward(self, features: Tensor, memory: Memory) -> Tensor:
        out: Tensor = self.linear(self.transformer(features.mT)).mT
        return out


class SpeechEncoderConfig(Protocol):
    """Settings of a network that a speech encoder needs."""

    @property
    def latent(self) -> int: ...
    @property
    def encoder(self) -> str: ...


def _own(config: SpeechEncoderConfig, audio: int, conv: Conv) -> OwnSpeechEncoder:
    return OwnSpeechEncoder(audio, config.latent, conv)


def _wav2vec(config: SpeechEncoderConfig, audio: int, conv: Conv) -> Wav2VecSpeechEncoder:
    if conv is CausalConv:
        raise InputError(
            "wav2vec 2.0 hears all of a speech before it says anything", "a network that streams has the speech encoder 'own'"
        )
    return Wav2VecSpeechEncoder(config.encoder, config.latent)


SPEECH_ENCODERS: dict[str, Callable[[SpeechEncoderConfig, int, Conv], OwnSpeechEncoder | Wav2VecSpeechEncoder]] = {
    "own": _own,
    "wav2vec": _wav2vec,
}
"""Name → (settings, numbers of a frame of audio, maker of convolutions) → a module with ``array``, the array that it reads, and
``inputs``, its numbers per frame."""
