"""Encoders of Mix-StAGE: audio content, pose content, and style.

The paper calls all three TCNs; channels and kernels are the authors' code's, here as multiples of one width: 256 is theirs.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from torch import Tensor, nn
from torch.nn import functional as F

from ...errors import InputError
from .export import fold_norm
from .norm import BatchNorm1d
from .unet1d import SLOPE, conv_block

__all__ = ["STYLE_FRAMES", "AudioContent", "PoseContent", "StyleLogits"]

STYLE_FRAMES = 64  # the least number of frames of which six halvings leave one
BANDS = 16  # the least number of bands for three halvings and a kernel of 8; fewer are padded with zeros, ours
LAST = (3, 8)  # kernel of the last convolution over (frames, bands), with padding (1, 3); authors' code


class _Block2d(nn.Module):
    """Convolution over (frames, bands), batch norm, leaky ReLU."""

    def __init__(self, inputs: int, outputs: int, kernel: tuple[int, int], stride: int, padding: tuple[int, int]) -> None:
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, kernel, stride, padding)
        self.norm = BatchNorm1d(outputs)

    def forward(self, x: Tensor) -> Tensor:
        y = self.conv(x)
        return F.leaky_relu(self.norm(y.flatten(2)).view_as(y), SLOPE)


class AudioContent(nn.Module):
    """A log-mel spectrogram as a picture → content: (B, T, A) → (B, channels, T), for T ≥ 8.

    Kernels 3, and 4 with stride 2, in turns, three of each; then 3, then 3 × 8; then bilinear back to T frames and one band.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        few, more = max(1, channels // 4), max(1, channels // 2)
        plain, down = ((3, 3), 1, (1, 1)), ((4, 4), 2, (1, 1))
        plan = [
            (1, few, *plain), (few, few, *down),
            (few, more, *plain), (more, more, *down),
            (more, channels, *plain), (channels, channels, *down),
            (channels, channels, *plain), (channels, channels, LAST, 1, (1, 3)),
        ]  # fmt: skip
        self.blocks = nn.Sequential(*(_Block2d(*row) for row in plan))

    def forward(self, audio: Tensor) -> Tensor:
        frames, bands = audio.shape[1:]
        picture = F.pad(audio, (0, max(0, BANDS - bands))).unsqueeze(1)
        return F.interpolate(self.blocks(picture), size=(frames, 1), mode="bilinear").squeeze(-1)

    def for_inference(self) -> nn.Module:
        """The same for T a multiple of 8, time along the rows of the picture."""
        return _AudioContentInference(self)


class _AudioContentInference(nn.Module):
    """`AudioContent` as it plays: norms are folded, and of the last bands only the middle ones, which count, are computed."""

    def __init__(self, net: AudioContent) -> None:
        super().__init__()
        self.convs = nn.ModuleList(fold_norm(block.conv, block.norm) for block in net.blocks)  # type: ignore[union-attr]
        for conv in self.convs:
            conv.weight = nn.Parameter(conv.weight.detach().mT.contiguous())  # type: ignore[union-attr,operator]

    def forward(self, audio: Tensor) -> Tensor:
        x = F.pad(audio.mT, (0, 0, 0, max(0, BANDS - audio.shape[2]))).unsqueeze(1)
        convs: list[Any] = [*self.convs]
        last = convs.pop()
        for conv in convs:
            frames, high = conv.padding
            x = F.leaky_relu(F.conv2d(x, conv.weight, conv.bias, conv.stride[::-1], (high, frames)), SLOPE)
        (frames, high), kernel, bands = last.padding, last.kernel_size[1], x.shape[2]
        count = bands + 2 * high - kernel + 1
        first, end = (count - 1) // 2 - high, count // 2 + kernel - high  # of the bands that the middle is made of
        x = F.pad(x[:, :, max(0, first) : min(bands, end)], (0, 0, max(0, -first), max(0, end - bands)))
        x = F.leaky_relu(F.conv2d(x, last.weight, last.bias, 1, (0, frames)), SLOPE).mean(2, keepdim=True)
        return F.interpolate(x, scale_factor=(1.0, 8.0), mode="bilinear").squeeze(2)


class PoseContent(nn.Sequential):
    """Poses → content: (B, D, T) → (B, channels, T); six convolutions with kernel 3."""

    def __init__(self, pose: int, channels: int) -> None:
        few, more = max(1, channels // 4), max(1, channels // 2)
        super().__init__(*(conv_block(a, b) for a, b in pairwise((pose, few, few, more, more, channels, channels))))


class StyleLogits(nn.Module):
    """Poses → how similar they are to those of each speaker: (B, D, T) → (B, S) logits, for T ≥ 64.

    As in the authors' code the last convolution too has batch norm and leaky ReLU; the mean over time is the logit.
    """

    def __init__(self, pose: int, channels: int, speakers: int) -> None:
        super().__init__()
        few, more = max(1, channels // 4), max(1, channels // 2)
        widths = (few, few, more, more, channels, channels, speakers)
        self.blocks = nn.Sequential(conv_block(pose, few), *(conv_block(a, b, down=True) for a, b in pairwise(widths)))

    def forward(self, pose: Tensor) -> Tensor:
        if pose.shape[-1] < STYLE_FRAMES:
            raise InputError(f"{pose.shape[-1]} frames to tell a style from", f"{STYLE_FRAMES} at least")
        logits: Tensor = self.blocks(pose).mean(-1)
        return logits
