"""The encoder of the waveform of Yoon et al. 2020: strided convolutions over samples, one vector for each frame."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import prod

from torch import Tensor, nn
from torch.nn import functional as F

from ...errors import InputError
from .norm import BatchNorm1d

__all__ = ["STRIDES", "WaveformEncoder"]

STRIDES = (5, 6, 6, 6)  # authors' code; the product is the samples of a frame
_CHANNELS, _KERNEL, _SLOPE = (16, 32, 64), 15, 0.3  # authors' code
_BEFORE = 1600 / 1945  # authors' code pads 1600 samples before the sound; as a share of all the padding that T frames need


class WaveformEncoder(nn.Module):
    """(B, T, samples of a frame) → (B, width, T).

    Args:
        samples: of a frame.
        strides: of the convolutions.
        width: of the output.

    Raises:
        InputError: the strides do not make one vector of each frame.
    """

    def __init__(self, samples: int, strides: Sequence[int], width: int) -> None:
        super().__init__()
        if prod(strides) != samples:
            problem = f"{samples} columns of speech for strides {', '.join(map(str, strides))}"
            raise InputError(problem, 'it hears the samples of each frame: data.audio = "waveform"')
        reach = 1 + sum((_KERNEL - 1) * prod(strides[:k]) for k in range(len(strides)))
        before = round((reach - samples) * _BEFORE)
        self.padding = (before, reach - samples - before)
        channels = (1, *_CHANNELS[: len(strides) - 1], width)
        layers: list[nn.Module] = []
        for (inputs, outputs), stride in zip(pairwise(channels), strides, strict=True):
            layers += [nn.Conv1d(inputs, outputs, _KERNEL, stride), BatchNorm1d(outputs), nn.LeakyReLU(_SLOPE)]
        self.layers = nn.Sequential(*layers[:-2])  # the last convolution is the end

    def forward(self, waveform: Tensor) -> Tensor:
        samples = F.pad(waveform.flatten(1).unsqueeze(1), self.padding)
        features: Tensor = self.layers(samples)
        return features
