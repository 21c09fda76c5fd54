"""Networks of many inputs as graphs that play without PyTorch: Chain of Generation, CaMN, multi-context; nothing trained.

    make      rows (1, T, A + W) of speech and words, style (N, T, S + 8), mode_noise (N, T, Z), left out where Z is 0;
              and where it was trained with them, face (1, T, 52 + 1): weights and how far they are given, and
              seed (1, T, D + 1): poses and whether they are given
              → poses (N, T, D)
    live      the same of one frame, rows (1, A + W), style (N, S + 8), mode_noise (N, Z), states → poses (N, D), next states
    classify  rows (1, T, A) → logits (1, T, S + 8)

What does not depend on style, all that is heard, read and seen of the face, is worked out once for all N takes.
"""

from __future__ import annotations

from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from ...models.camn import SLOPE as HEARD_SLOPE
from ...models.camn import Camn, EmotionEncoder, SpeakerEncoder
from ...models.chain_live import ChainLive
from ...models.chain_of_generation import ChainOfGeneration
from ...models.multi_context import MultiContext
from ...models.nn.basic_block import BasicBlock
from ...models.nn.cascade import EMOTIONS, FACE, Cascade
from ...models.nn.channel_attention import ChannelAttention, PastAttention
from ...models.nn.gesture_norm import GestureAdaLN, HyperNetwork
from ...models.nn.modalities import ManyInputs
from ...models.nn.norm import BatchNorm1d
from ...models.nn.recurrent import BothWays, Forwards
from ...models.nn.temporal import SLOPE, CausalConv, ConvStack, SameConv, TextTcn
from ...models.speech_classifier import SpeechClassifier
from ...motion.rotations import Array
from ...runtime.chain_engine import ChainSizes
from .recurrent_graph import RecurrentGraph, Wave
from .window_graph import fold_norm

__all__ = ["LoweredChain", "lower_chain"]


class LoweredChain(NamedTuple):
    """What `cospeech.runtime.chain_engine.ChainEngine` is made of."""

    sizes: ChainSizes
    weights: dict[str, Array]
    graphs: dict[str, bytes]


class Inputs(NamedTuple):
    """Signals that poses are made of."""

    rows: Wave
    """Speech, then words."""
    style: Wave
    """Speakers, then emotions."""
    noise: Wave
    face: Wave = Wave("", 0, False)
    """Weights, and how far they take the place of FaceDec's own."""
    seed: Wave = Wave("", 0, False)
    """Poses, and whether they are given."""


@torch.no_grad()
def lower_chain(net: ChainOfGeneration | ManyInputs) -> LoweredChain:
    """A network, as it evaluates, as graphs; of a `ChainLive` its teacher's and its own."""
    weights: dict[str, Array] = {}
    whole: Any = net.teacher if isinstance(net, ChainLive) else net
    graphs = {"make": _graph(whole, weights, "make")}
    if isinstance(net, ChainLive):
        graphs["live"] = _graph(net, weights, "live")
    reach = 0
    if isinstance(whole, ChainOfGeneration):
        reach = whole.classifier.reach
        b = RecurrentGraph(weights, "classify")
        b.as_rows(_classify(b, b.rows("rows", whole.speech_encoder.inputs, many=False), whole.classifier), "logits")
        graphs["classify"] = b.serialise({"rows": (1, "T", whole.speech_encoder.inputs)}, {"logits": (1, "T", whole.styles)})
    words = (whole.word if isinstance(whole, ChainOfGeneration) else whole.embedding).width
    sizes = ChainSizes(
        pose=whole.pose, audio=whole.audio - words, words=words, speakers=whole.styles - EMOTIONS, noise=whole.modes,
        window=whole.window, reach=reach, look_ahead=net.delay if isinstance(net, ChainLive) else 0,
        **_optional(whole),
    )  # fmt: skip
    return LoweredChain(sizes, weights, graphs)


def _optional(net: Any) -> dict[str, int]:
    """Of `ChainSizes`: numbers of a face and frames of seed poses that it was trained to be given, and to do without."""
    if not isinstance(net, ChainOfGeneration):
        return {}
    return {"faces": FACE * net.accepts_face, "seeds": net.config.seeds * net.accepts_seeds}


def _graph(net: Any, weights: dict[str, Array], name: str) -> bytes:
    """The graph ``make``, or ``live``."""
    b, frames = RecurrentGraph(weights, name), name == "make"
    own = ("T",) if frames else ()
    shapes: dict[str, tuple[Any, ...]] = {"rows": (1, *own, net.audio), "style": ("N", *own, net.styles)}
    shapes |= {"mode_noise": ("N", *own, net.modes)} if net.modes else {}
    able = _optional(net) if frames else {}
    alike = {"face": (1, "T", FACE + 1)} if able.get("faces") else {}
    alike |= {"seed": (1, "T", net.pose + 1)} if able.get("seeds") else {}
    given = [b.rows(key, shape[-1], many=key != "rows", frames=frames) for key, shape in shapes.items()]
    more = {key: b.rows(key, shape[-1], many=False) for key, shape in alike.items()}
    shapes |= alike
    inputs = Inputs(*given, *([] if net.modes else [Wave("", 0, True)]), **more)
    b.as_rows(_poses(net, b, inputs), "poses", frames=frames)
    return b.serialise(shapes, {"poses": ("N", *own, net.pose)})


# networks -----------------------------------------------------------------------------------------------------------


@singledispatch
def _poses(net: nn.Module, b: RecurrentGraph, given: Inputs) -> Wave:
    """The poses that it makes."""
    raise NotImplementedError(type(net).__name__)


@_poses.register
def _(net: ChainOfGeneration, b: RecurrentGraph, given: Inputs) -> Wave:
    speech_encoder: Any = net.speech_encoder
    speech, words = b.parts(given.rows, speech_encoder.inputs, net.word.width)
    heard = _convs(b, speech, speech_encoder.convs)
    skipped = (net.pose + 1) * (net.config.seeds > 0) - given.seed.channels
    return _cascade(b, net.cascade, heard, words, given, skipped)


def _cascade(b: RecurrentGraph, net: Cascade, heard: Wave, words: Wave, given: Inputs, skipped: int) -> Wave:
    """`cospeech.models.nn.cascade.Cascade`; of its extra inputs the first, seeds, may be ``skipped``: zeros."""
    features = _convs(b, _override_face(b, _convs(b, heard, net.face), given.face), net.face_features)
    style = _hyper(b, given.style, net.style)
    x = _attend(b, b.concatenate(heard, _read(b, words, net.text), features), net.body_attention)
    x = _apply_style(b, x, style, net.body_style)
    state = _recurrent(b, b.concatenate(given.seed, given.noise, x), net.body.recurrent, skipped)
    body = _framewise(b, state, net.body.mlp)
    x = _apply_style(b, _attend(b, b.concatenate(x, state), net.hand_attention), style, net.hand_style)
    state = _recurrent(b, b.concatenate(given.seed, given.noise, x), net.hands.recurrent, skipped)
    return b.select_channels(b.concatenate(body, _framewise(b, state, net.hands.mlp)), net.order.tolist())


def _override_face(b: RecurrentGraph, own: Wave, given: Wave) -> Wave:
    """The face that TFFDec sees: FaceDec's own, as far as no other is given."""
    if not given.channels:
        return own
    face, share = b.parts(given, own.channels, 1)
    apart = b.both("Add", face, b.number("Mul", own, -1.0))
    return b.both("Add", own, b.both("Mul", apart, share))


@_poses.register
def _(net: Camn, b: RecurrentGraph, given: Inputs) -> Wave:
    speech, words = b.parts(given.rows, net.audio - net.embedding.width, net.embedding.width)
    who, how = b.parts(given.style, net.speakers, EMOTIONS)
    speaker, emotion, text = _speaker(b, who, net.speaker), _emotion(b, how, net.emotion), _read(b, words, net.text)
    heard = _framewise(b, b.concatenate(_framewise(b, speech, net.speech), emotion, speaker, text), net.speech_fusion)
    face = _framewise(b, _no_face(b, speech), net.face)
    face = _framewise(b, b.concatenate(face, heard, emotion, speaker, text), net.face_fusion)
    x = b.concatenate(speaker, emotion, text, heard, face)
    body = _framewise(b, _recurrent(b, x, net.body, net.pose + 1), net.body_out)
    hands = _framewise(b, _recurrent(b, b.concatenate(x, body), net.hands, net.pose + 1), net.hands_out)
    return b.select_channels(b.concatenate(body, hands), net.order.tolist())


@_poses.register
def _(net: MultiContext, b: RecurrentGraph, given: Inputs) -> Wave:
    speech, words = b.parts(given.rows, net.audio - net.embedding.width, net.embedding.width)
    who, how = b.parts(given.style, net.speakers, EMOTIONS)
    known = _framewise(b, _mix_rows(b, who, net.speaker.embedding), net.speaker.encoder)
    spread = b.each("Exp", b.number("Mul", _linear(b, known, net.speaker.variance), 0.5))
    person = b.both("Add", _linear(b, known, net.speaker.mean), b.both("Mul", spread, given.noise))
    parts = [_framewise(b, speech, net.speech), _read(b, words, net.text), person]
    parts += [] if net.emotion is None else [_emotion(b, how, net.emotion)]
    parts += [] if net.face is None else [_framewise(b, _no_face(b, speech), net.face)]
    gru = net.both_ways.gru
    weights = {name: _array(value) for name, value in gru.named_parameters()}
    weights["weight_ih_l0"], weights["weight_ih_l0_reverse"] = (
        weights[name][:, net.pose + 1 :] for name in ("weight_ih_l0", "weight_ih_l0_reverse")
    )
    return _framewise(b, b.gru(b.concatenate(*parts), weights, ways=2, layers=gru.num_layers), net.out)


def _classify(b: RecurrentGraph, x: Wave, net: SpeechClassifier) -> Wave:
    for conv in net.convs:
        x = b.each("LeakyRelu", _conv(b, x, conv), alpha=SLOPE)
    return b.concatenate(*(_linear(b, x, head) for head in net.heads))


# parts --------------------------------------------------------------------------------------------------------------


def _array(x: Tensor) -> Array:
    """In double precision, in which norms are folded."""
    return x.detach().double().numpy()


def _conv(b: RecurrentGraph, x: Wave, conv: Any, weight: Array | None = None, bias: Array | None = None) -> Wave:
    """A convolution over frames; with the weights that are given, in place of its own."""
    if weight is None:
        weight, bias = _array(conv.weight), None if conv.bias is None else _array(conv.bias)
    dilation = conv.dilation[0]
    if not isinstance(conv, CausalConv):
        return b.conv(x, weight, bias, pads=(conv.padding[0],) * 2, dilation=dilation)
    if b.prefix == "live":
        return b.conv(b.behind(x, conv.past), weight, bias, dilation=dilation)
    return b.conv(x, weight, bias, pads=(conv.past, 0), dilation=dilation)


def _linear(b: RecurrentGraph, x: Wave, layer: Any) -> Wave:
    return b.conv(x, _array(layer.weight)[:, :, None], _array(layer.bias))


def _convs(b: RecurrentGraph, x: Wave, net: ConvStack) -> Wave:
    for k, conv in enumerate(net.convs):
        x = _conv(b, b.each("LeakyRelu", x, alpha=SLOPE) if k else x, conv)
    return x


def _read(b: RecurrentGraph, x: Wave, net: TextTcn) -> Wave:
    blocks: Any = net.blocks
    for block in blocks:
        y = x
        for conv in block.convs:
            y = b.each("Relu", _conv(b, y, conv))
        skip = x if isinstance(block.skip, nn.Identity) else _conv(b, x, block.skip)
        x = b.each("Relu", b.both("Add", y, skip))
    return _conv(b, x, net.out)


def _attend(b: RecurrentGraph, x: Wave, net: nn.Module) -> Wave:
    """`ChannelAttention` or `PastAttention`."""
    assert isinstance(net, ChannelAttention | PastAttention)
    if isinstance(net, ChannelAttention):
        pools = b.pool(x, "ReduceMean"), b.pool(x, "ReduceMax")
    else:
        seen = b.behind(x, net.frames - 1)
        pools = b.sliding(seen, "AveragePool", net.frames), b.sliding(seen, "MaxPool", net.frames)
    gates = [_conv(b, b.each("Relu", _conv(b, pool, net.gate.narrow)), net.gate.wide) for pool in pools]
    return b.both("Mul", x, b.each("Sigmoid", b.both("Add", *gates)))


def _hyper(b: RecurrentGraph, weights: Wave, net: HyperNetwork) -> Wave:
    who, how = _array(net.speakers), _array(net.emotions)
    both = np.block([[who, np.zeros((len(who), how.shape[1]))], [np.zeros((len(how), who.shape[1])), how]])
    return _convs(b, b.conv(weights, both[:, :, None], None), net.convs)


def _apply_style(b: RecurrentGraph, x: Wave, style: Wave, net: nn.Module) -> Wave:
    assert isinstance(net, GestureAdaLN)
    scaled = b.both("Mul", x, b.number("Add", _conv(b, style, net.scale), 1.0))
    return b.both("Add", scaled, _conv(b, style, net.shift))


def _recurrent(b: RecurrentGraph, x: Wave, net: nn.Module, skipped: int) -> Wave:
    """An LSTM, of whose inputs the first ``skipped`` are zeros and left out."""
    assert isinstance(net, BothWays | Forwards)
    weights = {name: _array(value) for name, value in net.lstm.named_parameters()}
    weights |= {name: weights[name][:, skipped:] for name in weights if name.startswith("weight_ih_l0")}
    live = isinstance(net, Forwards)
    return b.lstm(x, weights, ways=1 if live else 2, layers=net.lstm.num_layers, stateful=live)


def _mix_rows(b: RecurrentGraph, weights: Wave, embedding: Any) -> Wave:
    """Weights of rows of an embedding → their mixture."""
    return b.conv(weights, _array(embedding.weight).T[:, :, None], None)


def _speaker(b: RecurrentGraph, weights: Wave, net: SpeakerEncoder) -> Wave:
    return b.each("LeakyRelu", _linear(b, _mix_rows(b, weights, net.embedding), net.linear), alpha=HEARD_SLOPE)


def _emotion(b: RecurrentGraph, weights: Wave, net: EmotionEncoder) -> Wave:
    return _framewise(b, _linear(b, _mix_rows(b, weights, net.embedding), net.linear), net.tail)


def _no_face(b: RecurrentGraph, like: Wave) -> Wave:
    """A face that is missing, for as many frames."""
    return b.conv(like, np.zeros((FACE, like.channels, 1)), None)


def _framewise(b: RecurrentGraph, x: Wave, layers: Any) -> Wave:
    """Layers one after the other, batch norms folded into the convolutions before them."""
    if isinstance(layers, BasicBlock):
        y = b.each("LeakyRelu", _framewise(b, x, layers.first), alpha=layers.bend.negative_slope)
        short = x if isinstance(layers.shortcut, nn.Identity) else _framewise(b, x, layers.shortcut)
        return b.each("LeakyRelu", b.both("Add", _framewise(b, y, layers.second), short), alpha=layers.bend.negative_slope)
    flat = [*layers] if isinstance(layers, nn.Sequential) else [layers]
    for layer, after in zip(flat, [*flat[1:], None], strict=True):
        if isinstance(layer, nn.Sequential | BasicBlock):
            x = _framewise(b, x, layer)
        elif isinstance(layer, nn.Linear):
            x = _linear(b, x, layer)
        elif isinstance(layer, nn.LeakyReLU):
            x = b.each("LeakyRelu", x, alpha=float(layer.negative_slope))
        elif isinstance(layer, nn.Conv1d | SameConv):
            x = _conv(b, x, layer, *(fold_norm(layer, after) if isinstance(after, BatchNorm1d) else ()))
        elif not isinstance(layer, BatchNorm1d):
            raise NotImplementedError(type(layer).__name__)
    return x
