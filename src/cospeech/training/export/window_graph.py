"""Networks that make a whole window at once, as graphs that play without PyTorch: batch norms folded, nothing trained.

`lower` gives two ONNX graphs and their weights:

    make    rows (1, T, A), style (N, T, styles), mode_noise (N, T, modes) → poses (N, T, D); inputs without width are left
            out, and N is 1 where both are
    style   poses (1, T, D) → style (1, styles), for a network that recognises styles

What does not depend on style, the content of speech and the U-Net, is worked out once for all N takes.
"""

from __future__ import annotations

from functools import singledispatch
from math import isinf
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from ...models.mix_stage import MixGan, MixStage
from ...models.munit import Munit
from ...models.nn.content import BANDS, AudioContent
from ...models.nn.mixture import ModeLogits, SubGenerators
from ...models.nn.unet1d import SLOPE, UNet1d
from ...models.nn.windowed import Windowed
from ...models.speech2gesture import Speech2Gesture
from ...models.speech_to_face import SLOPE as FACE_SLOPE
from ...models.speech_to_face import SpeechToFace
from ...motion.rotations import Array
from ...runtime.window_engine import WindowSizes
from .conv_graph import ConvGraph, Signal

__all__ = ["Lowered", "fold_norm", "lower"]


class Lowered(NamedTuple):
    """What `cospeech.runtime.window_engine.WindowEngine` is made of."""

    sizes: WindowSizes
    weights: dict[str, Array]
    graphs: dict[str, bytes]


@torch.no_grad()
def lower(net: Windowed) -> Lowered:
    """A network, as it evaluates, as graphs."""
    weights: dict[str, Array] = {}
    b = ConvGraph(weights, "make", net.multiple)
    inputs: dict[str, tuple[Any, ...]] = {"rows": (1, "T", net.audio)}
    inputs |= {"style": ("N", "T", net.styles)} if net.styles else {}
    inputs |= {"mode_noise": ("N", "T", net.modes)} if net.modes else {}
    poses = _make(net, b)
    b.as_rows(poses, "poses")
    graphs = {"make": b.serialise(inputs, {"poses": ("N" if len(inputs) > 1 else 1, "T", net.pose)})}
    if net.encodes_style:
        b = ConvGraph(weights, "style", net.multiple)
        _recognise(net, b, b.rows("poses", net.pose))
        graphs["style"] = b.serialise({"poses": (1, "T", net.pose)}, {"style": (1, net.styles)})
    window: Any = net.window
    sizes = WindowSizes(
        pose=net.pose, audio=net.audio, styles=net.styles, modes=net.modes, window=window, multiple=net.multiple,
        reach=None if isinf(poses.reach) else int(poses.reach),
    )  # fmt: skip
    return Lowered(sizes, weights, graphs)


# networks -----------------------------------------------------------------------------------------------------------


@singledispatch
def _make(net: nn.Module, b: ConvGraph) -> Signal:
    """The poses that it makes of ``rows``, ``style`` and ``mode_noise``."""
    raise NotImplementedError(type(net).__name__)


@_make.register
def _(net: MixGan, b: ConvGraph) -> Signal:
    content = _unet(b, _audio_content(b, net.audio_content, net.audio), net.unet)
    style = _Style(b.rows("style", net.styles), net.style.matrix) if isinstance(net, MixStage) else None
    made = _sub_generators(b, content, style, net.generators)
    if net.mode_logits is None:
        return made
    logits = b.add(_mode_logits(b, content, style, net.mode_logits), b.rows("mode_noise", net.modes))
    return b.mix_generators(made, b.softmax(logits))


@_make.register
def _(net: Speech2Gesture, b: ConvGraph) -> Signal:
    x = _unet(b, _audio_content(b, net.encoder, net.audio), net.unet)
    for block in net.decoder:
        x = _block(b, x, block)
    return _conv(b, x, net.out)


@_make.register
def _(net: Munit, b: ConvGraph) -> Signal:
    encoder, decoder = net.speech.content, net.motion.decoder
    x = b.leaky(b.normalise(_conv(b, b.rows("rows", net.audio), encoder.first)), 0)
    for conv in encoder.down:
        x = b.leaky(b.normalise(_conv(b, x, conv)), 0)
    for block in encoder.blocks:
        x = _residual(b, x, block, None)
    code = b.first_frame("style")
    for layer in decoder.mlp:
        code = b.full(code, _array(layer.weight), _array(layer.bias)) if isinstance(layer, nn.Linear) else b.node("Relu", code)
    moves = b.columns(code, [x.channels] * (4 * len(decoder.blocks)))
    for k, block in enumerate(decoder.blocks):
        x = _residual(b, x, block, moves[4 * k : 4 * k + 4])
    return _decode_munit(b, x, decoder.grow)


@_make.register
def _(net: SpeechToFace, b: ConvGraph) -> Signal:
    first: Any = net.first
    last: Any = net.out
    weight, bias = _array(first.weight)[:, :, None], _array(first.bias)
    heard = b.conv(b.rows("rows", net.audio), weight[:, : net.audio], bias)
    x = b.leaky(b.add(heard, b.conv(b.rows("style", net.styles), weight[:, net.audio :], None)), FACE_SLOPE)
    blocks: list[Any] = [*net.blocks]
    for block in blocks:
        y = _over_time(b, x, block.over_time, _array(block.over_time.weight), _array(block.over_time.bias), block.pads)
        x = b.add(x, _conv(b, b.leaky(y, FACE_SLOPE), block.mix))
    alive = _array(net.alive)
    return b.conv(x, _array(last.weight)[:, :, None] * alive[:, None, None, None], _array(last.bias) * alive)


@singledispatch
def _recognise(net: nn.Module, b: ConvGraph, poses: Signal) -> None:
    """The output ``style`` of ``poses``."""
    raise NotImplementedError(type(net).__name__)


@_recognise.register
def _(net: MixStage, b: ConvGraph, poses: Signal) -> None:
    for block in net.style.encoder.blocks:
        poses = _block(b, poses, block)
    b.node("Softmax", b.over_frames(poses), outputs=("style",), axis=1)


@_recognise.register
def _(net: Munit, b: ConvGraph, poses: Signal) -> None:
    layers: list[Any] = [*net.motion.style]
    last = layers.pop()
    for layer in layers[:-1]:  # but for the mean
        poses = _conv(b, poses, layer) if isinstance(layer, nn.Conv1d) else b.leaky(poses, 0)
    b.full(b.over_frames(poses), _array(last.weight)[:, :, 0], _array(last.bias), output="style")


# parts --------------------------------------------------------------------------------------------------------------


class _Style(NamedTuple):
    """What Z has beside the content: weights of the speakers, and a row of numbers for each."""

    weights: Signal
    matrix: Tensor


def _array(x: Tensor) -> Array:
    """In double precision, in which batch norms are folded."""
    return x.detach().double().numpy()


def fold_norm(conv: Any, norm: Any) -> tuple[Array, Array]:
    """Weight and bias of a convolution with the batch norm after it."""
    gain = _array(norm.weight) / np.sqrt(_array(norm.running_var) + norm.eps)
    weight = _array(conv.weight)
    bias = (_array(conv.bias) - _array(norm.running_mean)) * gain + _array(norm.bias)
    return weight * gain.reshape(-1, *[1] * (weight.ndim - 1)), bias


def _block(b: ConvGraph, x: Signal, block: Any) -> Signal:
    """`cospeech.models.nn.unet1d.conv_block`."""
    conv, norm, relu = block
    weight, bias = fold_norm(conv, norm)
    return b.leaky(_over_time(b, x, conv, weight, bias), relu.negative_slope)


def _over_time(
    b: ConvGraph, x: Signal, conv: Any, weight: Array, bias: Array | None, around: tuple[int, int] | None = None
) -> Signal:
    """A convolution over frames with these weights in place of its own; ``around``: zeros before and after, where uneven."""
    pad, reflected = int(conv.padding[0]), conv.padding_mode == "reflect"
    x = b.pad_reflect(x, pad) if reflected and pad else x
    before, after = around or ((0, 0) if reflected else (pad, pad))
    return b.conv(x, weight[:, :, None], bias, stride=(1, conv.stride[0]), pads=(0, before, 0, after), groups=conv.groups,
                  dilation=conv.dilation[0])  # fmt: skip


def _conv(b: ConvGraph, x: Signal, conv: Any) -> Signal:
    """A convolution over frames as it is."""
    return _over_time(b, x, conv, _array(conv.weight), None if conv.bias is None else _array(conv.bias))


def _audio_content(b: ConvGraph, net: AudioContent, bands: int) -> Signal:
    """`cospeech.models.nn.content.AudioContent`, of whose last bands only those in the middle are worked out: they alone are
    kept."""
    x = b.more_bands(b.picture("rows", bands), BANDS)
    blocks: list[Any] = [*net.blocks]
    for number, block in enumerate(blocks):
        weight, bias = fold_norm(block.conv, block.norm)
        frames, high = block.conv.padding
        pads = (high, frames, high, frames)
        if number == len(blocks) - 1:
            made, kernel = x.bands + 2 * high - block.conv.kernel_size[1] + 1, block.conv.kernel_size[1]
            first, last = (made - 1) // 2 - high, made // 2 + kernel - high  # of the bands that the middle is made of
            pads = (max(0, -first), frames, max(0, last - x.bands), frames)
            x = b.bands(x, max(0, first), min(x.bands, last))
        x = b.conv(x, weight.transpose(0, 1, 3, 2), bias, stride=block.conv.stride[::-1], pads=pads)
        x = b.leaky(x, SLOPE)
    return b.upsample_linear(b.band_mean(x))


def _unet(b: ConvGraph, x: Signal, net: UNet1d) -> Signal:
    skips = []
    for block in net.first:
        x = _block(b, x, block)
    for block in net.down:
        skips.append(x)
        x = _block(b, x, block)
    for block, skip in zip(net.up, reversed(skips), strict=True):
        x = _block(b, b.add(b.upsample_nearest(x), skip), block)
    return x


def _of_z(b: ConvGraph, content: Signal, style: _Style | None, block: Any) -> Signal:
    """A block of [content, weights · matrix]: the content's share once for all takes, the matrix in the weights."""
    if style is None:
        return _block(b, content, block)
    conv, norm, relu = block
    weight, bias = fold_norm(conv, norm)
    heard = _over_time(b, content, conv, weight[:, : content.channels], bias)
    own = np.einsum("oek,se->osk", weight[:, content.channels :], _array(style.matrix))
    return b.leaky(b.add(heard, _over_time(b, style.weights, conv, own, None)), relu.negative_slope)


def _sub_generators(b: ConvGraph, content: Signal, style: _Style | None, net: SubGenerators) -> Signal:
    first, *others = net.blocks
    x = _of_z(b, content, style, first)
    for block in others:
        x = _block(b, x, block)
    return _conv(b, x, net.out)


def _mode_logits(b: ConvGraph, content: Signal, style: _Style | None, net: ModeLogits) -> Signal:
    first, *others, last = net
    x = _of_z(b, content, style, first)
    for block in others:
        x = _block(b, x, block)
    return _conv(b, x, last)


def _residual(b: ConvGraph, x: Signal, block: Any, moves: list[str] | None) -> Signal:
    """A residual block of MUNIT; ``moves``: shift and scale after the first norm and after the second."""
    y = b.normalise(_conv(b, x, block.first))
    y = b.leaky(y if moves is None else b.scale_shift(y, moves[1], moves[0]), 0)
    z = b.normalise(_conv(b, y, block.second))
    return b.add(x, z if moves is None else b.scale_shift(z, moves[3], moves[2]))


def _decode_munit(b: ConvGraph, x: Signal, layers: Any) -> Signal:
    """The end of MUNIT's decoder."""
    for layer in layers:
        if isinstance(layer, nn.Upsample):
            x = b.upsample_nearest(x)
        elif isinstance(layer, nn.Conv1d):
            x = _conv(b, x, layer)
        elif isinstance(layer, nn.GroupNorm):
            scale, shift = (b.add_weight(_array(value)[:, None, None]) for value in (layer.weight, layer.bias))
            x = b.scale_shift(b.normalise(x, together=True), scale, shift)
        else:
            x = b.leaky(x, 0)
    return x
