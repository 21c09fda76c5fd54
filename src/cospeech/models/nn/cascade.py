"""The cascaded gesture synthesiser of Chain of Generation (Xu et al. 2024, section 3.2): speech → face → body → hands.

    F = FaceDec(Â)                 F̂ = TFFDec(F)                                      (1)
    C = CW-Attn([Â : T̂ : F̂])                                                          (2)
    M = StyleInject(C, S)          B̂ = BodyDec(M)         B = BodyMlp(B̂)              (3)
    Ĉ = CW-Attn([M : B̂])                                                              (4)
    M̂ = StyleInject(Ĉ, S)          Ĥ = HandDec(M̂)         H = HandMlp(Ĥ)

What it is built of, layers that see both ways or layers that play as speech comes, is given to it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from ...audio.emotions import EMOTIONS as NAMES
from ...errors import InputError
from ...motion.skeletons.arkit import ARKIT
from .gesture_norm import GestureAdaLN, HyperNetwork
from .temporal import SLOPE, Conv, ConvStack, Memory, TextTcn

__all__ = ["EMOTIONS", "FACE", "Cascade", "CascadeOutput", "Layers", "Signals", "Through", "Widths"]

EMOTIONS, FACE = len(NAMES), len(ARKIT)
"""How many emotions there are, BEAT's; and weights of a face as a store has them (BEAT has 51 of them)."""
_KERNEL = 3  # not stated; ours
_FACE_LAYERS, _FEATURE_LAYERS = 3, 4  # section 3.2


@dataclass(frozen=True)
class Layers:
    """The layers of a cascade, which decide how much of time it sees.

    Args:
        conv: (inputs, outputs, kernel) → a convolution.
        attention: channels → channel attention.
        recurrent: inputs → an LSTM, ``hidden`` numbers out.
        hidden: of those.
        style: (channels, width) → what a style does to features.
        features: numbers of B̂ and Ĥ, a linear layer after the LSTM; 0: none, they are the LSTM's ``hidden`` numbers.
    """

    conv: Conv
    attention: Callable[[int], nn.Module]
    recurrent: Callable[[int], nn.Module]
    hidden: int
    style: Callable[[int, int], nn.Module] = GestureAdaLN
    features: int = 0


@dataclass(frozen=True)
class Widths:
    """Numbers per frame.

    Args:
        word: of a word.
        text: channels of the network that reads words.
        latent: of Â, T̂, F̂ and S; 128.
        speakers: S.
        extra: of what both decoders get beside their features: seed poses and their flag, and noise.
    """

    word: int
    text: int
    latent: int
    speakers: int
    extra: int


class Signals(NamedTuple):
    """What a cascade is given, (B, ·, T) each."""

    heard: Tensor
    """Â, audio features, ``latent`` of them."""
    words: Tensor
    """Zeros where nothing is said, or nothing of it known."""
    style: Tensor
    """Weights of the speakers, then of the emotions, each with the sum 1."""
    extra: Tensor
    """Seed poses and their flag, and noise."""


class CascadeOutput(NamedTuple):
    """What a cascade makes, (B, ·, T) each."""

    pose: Tensor
    face: Tensor
    """F, weights of a face as FaceDec has them, not yet cut to 0 … 1."""
    features: Tensor
    """F̂."""


class Through(nn.Module):
    """Returns its features unchanged; stands for attention or style in the paper's ablations."""

    def forward(self, x: Tensor, other: Memory | Tensor) -> Tensor:
        return x


class _Decoder(nn.Module):
    """LSTM and MLP: features and what comes with them → B̂ (B, features or hidden, T), B (B, outputs, T)."""

    def __init__(self, layers: Layers, inputs: int, latent: int, outputs: int) -> None:
        super().__init__()
        self.recurrent = layers.recurrent(inputs)
        self.features = nn.Conv1d(layers.hidden, layers.features, 1) if layers.features else nn.Identity()
        made = layers.features or layers.hidden
        self.mlp = nn.Sequential(nn.Conv1d(made, latent, 1), nn.LeakyReLU(SLOPE), nn.Conv1d(latent, outputs, 1))

    def forward(self, x: Tensor, memory: Memory) -> tuple[Tensor, Tensor]:
        state = self.features(self.recurrent(x, memory))
        return state, self.mlp(state)


class Cascade(nn.Module):
    """Equations 1 to 5.

    Args:
        layers: what it is built of.
        widths: numbers per frame.
        pose: D.
        hands: columns of a pose that are hands; the others are the body.
        dropout: of the network that reads words.

    Raises:
        InputError: a pose of hands alone, of a body alone, or with other columns.
    """

    order: Tensor

    def __init__(self, layers: Layers, widths: Widths, *, pose: int, hands: Sequence[int], dropout: float) -> None:
        super().__init__()
        known = {*hands}
        body = [k for k in range(pose) if k not in known]
        if not body or len(body) + len(hands) != pose or not hands:
            raise InputError(f"{len(hands)} columns of hands in a pose of {pose}"[:200], "some, each once, and not all")
        latent, extra = widths.latent, widths.extra
        both = 3 * latent + (layers.features or layers.hidden)
        self.text = TextTcn(widths.word, widths.text, latent, dropout)
        self.face = ConvStack(layers.conv, (*[latent] * _FACE_LAYERS, FACE), _KERNEL)
        self.face_features = ConvStack(layers.conv, (FACE, *[latent] * _FEATURE_LAYERS), _KERNEL)
        self.style = HyperNetwork(widths.speakers, EMOTIONS, latent, layers.conv)
        self.body_attention, self.hand_attention = layers.attention(3 * latent), layers.attention(both)
        self.body_style, self.hand_style = layers.style(3 * latent, latent), layers.style(both, latent)
        self.body = _Decoder(layers, extra + 3 * latent, latent, len(body))
        self.hands = _Decoder(layers, extra + both, latent, len(hands))
        self.columns = (body, list(hands))
        """Of a pose: those of the body, those of the hands."""
        self.register_buffer("order", torch.tensor([*body, *hands]).argsort(), persistent=False)

    def forward(self, given: Signals, memory: Memory, face: Callable[[Tensor], Tensor] = lambda own: own) -> CascadeOutput:
        """Poses and faces of all frames.

        Args:
            given: what is heard, said, who and how, and what came before.
            memory: of causal layers.
            face: of the face that was made, that which TFFDec sees: itself, or where one is known, that.
        """
        made = self.face(given.heard, memory)
        features = self.face_features(face(made), memory)
        said, style = self.text(given.words, memory), self.style(given.style, memory)
        x = self.body_attention(torch.cat([given.heard, said, features], 1), memory)  # C
        x = self.body_style(x, style)  # M
        state, body = self.body(torch.cat([given.extra, x], 1), memory)
        x = self.hand_attention(torch.cat([x, state], 1), memory)  # Ĉ
        _, hands = self.hands(torch.cat([given.extra, self.hand_style(x, style)], 1), memory)
        return CascadeOutput(torch.cat([body, hands], 1).index_select(1, self.order), made, features)
