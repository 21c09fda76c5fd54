"""What makes audio features Â of speech in Chain of Generation: each for the array of a store that it hears."""

from __future__ import annotations

from collections.abc import Callable

from torch import Tensor, nn

from .temporal import Conv, ConvStack, Memory

__all__ = ["EARS", "OwnEar"]

_KERNEL = 3  # ours


class OwnEar(nn.Module):
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

    def forward(self, heard: Tensor, memory: Memory) -> Tensor:
        out: Tensor = self.convs(heard, memory)
        return out


EARS: dict[str, Callable[[int, int, Conv], OwnEar]] = {"own": OwnEar}
"""Name → (numbers of a frame of audio, of Â, what makes convolutions) → a module with ``array``, that which it hears, and
``inputs``, its numbers per frame."""
