"""ONNX of a flow's generating direction, one frame of N takes at a time.

    speech  windows of speech of a whole chunk → their share of the gates of all K steps, one big product
    past    [history, global feature, style] · W_past + speech → the gates of all steps, but for z₁ and the hidden states
    frame   the same for one frame, and then
            for k = K−1 … 0:  hidden = cells(past_k + z₁ · W_kept, hidden · W_hh)    recurrent cells as plain products
                              shift, s = hidden · W_out;   z₂ ← z₂ / (σ(s + 2) + 1e-6) − shift
                              z ← [z₁, z₂] · M_k − bias_k,   M_k = (exp(−logs_k) W_k⁻¹)ᵀ, worked out beforehand
    style   a stretch of poses → its style code, for a network that has them

so that per step only W_hh and W_ih of upper layers are read. The weights (`cospeech.runtime.flow.weights`) lie in no graph:
they are handed over by name when a session is opened, and the engine reads the same ones.

Where weights are quantised, hidden states, which lie in −1 … 1, become bytes at a fixed scale of 1/127; other inputs become
two bytes per number, scaled by the largest of their row. No scale depends on another row: a take is the same alone and among
others.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...motion.rotations import Array
from ..bundles.graph_builder import GraphBuilder
from .weights import SCALE_FLOOR, STEP_GAIN, FlowSizes, state_kinds

__all__ = ["build_graphs"]

FINE = 254.0  # the second byte's unit: half a step of the first, in 127 parts
LIMIT = 1e4  # ours: no latent of standardised poses comes near; keeps a hostile network from infinity


def build_graphs(weights: Mapping[str, Array], sizes: FlowSizes) -> dict[str, bytes]:
    """Name → ONNX file; needs the package onnx.

    speech: windows (F, W·A) → gates (F, K·G) and, with an encoder, code (F, channels). past: history (F, τ·D), gates, code,
    style → share (F, K·G). frame: z (N, D), history (N, τ·D), gates (1, K·G), code (1, channels), style (N, style), states,
    low and high (1, D) → pose (N, D) within low … high, and the next states, called next_…. style: poses (1, S, D) → style.
    """
    graphs = {
        "speech": _speech_graph(weights, sizes),
        "past": _past_graph(weights, sizes),
        "frame": _frame_graph(weights, sizes),
    }
    return graphs | ({"style": _style_graph(weights, sizes)} if sizes.style else {})


class _Builder(GraphBuilder):
    """A graph builder with the operations of flows."""

    def __init__(self, weights: Mapping[str, Array], sizes: FlowSizes) -> None:
        super().__init__(weights)
        self.sizes = sizes

    def linear(self, x: str, name: str, add: str) -> str:
        """x · W + add, float32."""
        return self.node("Gemm", x, self.weight(name), add)

    def to_bytes(self, x: str, unit: float) -> str:
        return self.node("QuantizeLinear", x, self.const(unit), self.const(128, np.uint8))

    def multiply_states(self, state: str, name: str) -> str:
        """Hidden states (bytes, where quantised) · W + bias."""
        if not self.sizes.int8:
            return self.linear(state, name, self.weight(f"{name}.bias"))
        return self.node(
            "MatMulIntegerToFloat", state, self.weight(f"{name}.q"), self.const(1 / 127), self.weight(f"{name}.s"),
            self.const(128, np.uint8), "", self.weight(f"{name}.bias"),
        )  # fmt: skip

    def wide(self, x: str, name: str, add: str, outputs: int | tuple[str, ...] = 1) -> str:
        """x · W + add for any inputs: two bytes per number, the low ones as rows of their own, so that W is read once."""
        if not self.sizes.int8:
            return str(self.node("Gemm", x, self.weight(name), add, outputs=outputs))
        size = self.node("Max", self.node("ReduceMax", self.node("Abs", x), self.const([1], np.int64)), self.const(1e-20))
        unit = self.node("Div", x, size)
        zero = self.const(128, np.uint8)
        high = self.to_bytes(unit, 1 / 127)
        rest = self.node("Sub", unit, self.node("DequantizeLinear", high, self.const(1 / 127), zero))
        both = self.node("Concat", high, self.to_bytes(rest, 1 / 127 / FINE), axis=0)
        weight, scale = self.weight(f"{name}.q"), self.weight(f"{name}.s")
        product = self.node("MatMulIntegerToFloat", both, weight, self.const(1 / 127), scale, zero)
        high, low = self.node("Split", product, outputs=2, axis=0, num_outputs=2)
        sum_ = self.node("Add", high, self.node("Mul", low, self.const(1 / FINE)))
        return str(self.node("Add", self.node("Mul", sum_, size), add, outputs=outputs))

    def tcn(self, x: str, side: str, width: int) -> str:
        """(N, width · channels) a window, frame by frame → (N, 64)."""
        values = self.node("Reshape", x, self.const([0, width, -1], np.int64))
        values = self.node("Transpose", values, perm=[0, 2, 1])
        values = self.node("Relu", self.conv(values, f"{side}.first", strides=[2]))
        for n in range(self.sizes.blocks):
            values = self.node("Relu", self.node("Add", self.conv(values, f"{side}.blocks.{n}", strides=[1]), values))
        values = self.conv(values, f"{side}.last", strides=[2])
        if self.sizes.encoder_relu:
            values = self.node("Relu", values)
        if self.sizes.oldest:
            return self.node("Gather", values, self.const(0, np.int64), axis=2)
        return self.node("ReduceMean", values, self.const([2], np.int64), keepdims=0)

    def conv(self, x: str, name: str, **attributes: Any) -> str:
        return self.node("Conv", x, self.weight(name), self.weight(f"{name}.bias"), pads=[1, 1], **attributes)

    def model(self, inputs: dict[str, tuple[Any, ...]], outputs: dict[str, tuple[Any, ...]]) -> bytes:
        """The file; shapes by name, bytes for what is called q or next_q."""
        return self.file("flow", inputs, outputs, in_bytes=("q", "next_q"))


def _speech_graph(weights: Mapping[str, Array], sizes: FlowSizes) -> bytes:
    b = _Builder(weights, sizes)
    outputs: dict[str, tuple[Any, ...]] = {"gates": ("F", sizes.steps * sizes.gates)}
    b.wide("windows", "speech", b.weight("speech.bias"), outputs=("gates",))
    if sizes.feature:
        code = b.tcn("windows", "speech", sizes.speech_frames)
        b.node("Gemm", code, b.weight("full0.speech"), b.weight("full0.bias"), outputs=("code",))
        outputs["code"] = ("F", sizes.channels)
    return b.model({"windows": ("F", sizes.speech_frames * sizes.audio)}, outputs)


def _style_graph(weights: Mapping[str, Array], sizes: FlowSizes) -> bytes:
    b = _Builder(weights, sizes)
    x = b.node("Transpose", "poses", perm=[0, 2, 1])
    for n in range(3):
        x = b.node("Relu", b.conv(x, f"style.{n}", strides=[2]))
    over = b.const([2], np.int64)
    mean = b.node("ReduceMean", x, over, keepdims=1)
    apart = b.node("Sub", x, mean)
    spread = b.node("Add", b.node("ReduceMean", b.node("Mul", apart, apart), over, keepdims=0), b.const(1e-6))
    both = b.node("Concat", b.node("Reshape", mean, b.const([0, -1], np.int64)), b.node("Sqrt", spread), axis=1)
    b.node("Tanh", b.linear(both, "style.full", b.weight("style.full.bias")), outputs=("style",))
    return b.model({"poses": (1, "S", sizes.pose)}, {"style": (1, sizes.style)})


def _past(b: _Builder, outputs: int | tuple[str, ...] = 1) -> str:
    """The gates of all steps, as far as they follow from history, its global feature and the speech."""
    parts = _steps(b) if b.sizes.steps_seen and b.sizes.history > 1 else ["history"]
    if b.sizes.feature:
        full = b.node("Relu", b.linear(b.tcn("history", "poses", b.sizes.history), "full0.poses", "code"))
        full = b.node("Relu", b.linear(full, "full1", b.weight("full1.bias")))
        parts.append(b.linear(full, "full2", b.weight("full2.bias")))
    if b.sizes.style:
        parts.append("style")
    return b.wide(b.node("Concat", *parts, axis=1) if len(parts) > 1 else "history", "past", "gates", outputs)


def _steps(b: _Builder) -> list[str]:
    """`cospeech.models.nn.conditioning.as_steps` of the history.

    It is not folded into W_past: weights that differ from pose to pose by `STEP_GAIN` times what steps need would be rounded as
    coarsely, and poses are nearly equal; measured, 7 % of a frame's step in place of 1 %.
    """
    rest = (b.sizes.history - 1) * b.sizes.pose
    early, last = b.split("history", rest, b.sizes.pose)
    late = b.split("history", b.sizes.pose, rest)[1]
    return [last, b.node("Mul", b.node("Sub", late, early), b.const(STEP_GAIN))]


def _past_graph(weights: Mapping[str, Array], sizes: FlowSizes) -> bytes:
    b, width = _Builder(weights, sizes), sizes.steps * sizes.gates
    _past(b, ("share",))
    inputs: dict[str, tuple[Any, ...]] = {"history": ("F", sizes.history * sizes.pose), "gates": ("F", width)}
    if sizes.feature:
        inputs["code"] = ("F", sizes.channels)
    if sizes.style:
        inputs["style"] = ("F", sizes.style)
    return b.model(inputs, {"share": ("F", width)})


def _frame_graph(weights: Mapping[str, Array], sizes: FlowSizes) -> bytes:
    b, width = _Builder(weights, sizes), sizes.steps * sizes.gates
    inputs: dict[str, tuple[Any, ...]] = {"z": ("N", sizes.pose), "history": ("N", sizes.history * sizes.pose)}
    inputs |= {"gates": (1, width), "low": (1, sizes.pose), "high": (1, sizes.pose)}
    if sizes.feature:
        inputs["code"] = (1, sizes.channels)
    if sizes.style:
        inputs["style"] = ("N", sizes.style)
    gates = b.split(_past(b), *[sizes.gates] * sizes.steps)
    kinds = state_kinds(sizes)
    inputs |= {kind: ("N", sizes.states) for kind in kinds}
    cells = sizes.steps * sizes.layers
    states = {kind: b.split(kind, *[sizes.hidden] * cells) for kind in kinds}
    z1, z2 = b.split("z", sizes.first_half, sizes.pose - sizes.first_half)
    for k in reversed(range(sizes.steps)):
        top = _cells(b, k, b.linear(z1, f"{k}.kept", gates[k]), states)
        shift, scale = b.split(b.linear(top, f"{k}.out", b.weight(f"{k}.out.bias")), *[sizes.pose - sizes.first_half] * 2)
        scale = b.node("Add", b.node("Sigmoid", scale), b.const(SCALE_FLOOR))
        z2 = b.node("Sub", b.node("Div", z2, scale), shift)
        z = b.linear(b.node("Concat", z1, z2, axis=1), f"{k}.mix", b.weight(f"{k}.mix.bias"))
        if k:
            z1, z2 = b.split(
                b.node("Clip", z, b.const(-LIMIT), b.const(LIMIT)), sizes.first_half, sizes.pose - sizes.first_half
            )
    if sizes.residual:
        rest = (sizes.history - 1) * sizes.pose
        last = b.split("history", rest, sizes.pose)[1] if rest else "history"
        z = b.node("Add", z, last)
        if sizes.inertia:
            before = b.split("history", *([rest - sizes.pose] if rest > sizes.pose else []), sizes.pose, sizes.pose)[-2]
            z = b.node("Add", z, b.node("Mul", b.node("Sub", last, before), b.const(sizes.inertia)))
    b.node("Min", b.node("Max", z, "low"), "high", outputs=("pose",))
    for kind in kinds:
        b.node("Concat", *states[kind], outputs=(f"next_{kind}",), axis=1)
    outputs = {"pose": ("N", sizes.pose)} | {f"next_{kind}": ("N", sizes.states) for kind in kinds}
    return b.model(inputs, outputs)


def _cells(b: _Builder, k: int, x: str, states: dict[str, list[str]]) -> str:
    """All layers of a step's recurrent net; replaces their states; the top's output, float32."""
    sizes, kind = b.sizes, "q" if b.sizes.int8 else "h"
    for layer in range(sizes.layers):
        at = k * sizes.layers + layer
        if layer:
            x = b.multiply_states(states[kind][at - 1], f"{k}.{layer}.ih")
        h = b.multiply_states(states[kind][at], f"{k}.{layer}.hh")
        if sizes.cell == "gru":
            output = states["h"][at] = _gru(b, x, h, states["h"][at])
        else:
            states["c"][at], output = _lstm(b, x, h, states["c"][at])
            if "h" in states:
                states["h"][at] = output
        if "q" in states:
            states["q"][at] = b.to_bytes(output, 1 / 127)
    return output


def _gru(b: _Builder, x: str, h: str, state: str) -> str:
    """r, u = σ(xᵣᵤ + hᵣᵤ); n = tanh(xₙ + r hₙ); n + u (state − n)."""
    size = b.sizes.hidden
    (x_gates, x_new), (h_gates, h_new) = b.split(x, 2 * size, size), b.split(h, 2 * size, size)
    reset, update = b.split(b.node("Sigmoid", b.node("Add", x_gates, h_gates)), size, size)
    new = b.node("Tanh", b.node("Add", x_new, b.node("Mul", reset, h_new)))
    return b.node("Add", new, b.node("Mul", update, b.node("Sub", state, new)))


def _lstm(b: _Builder, x: str, h: str, cell: str) -> tuple[str, str]:
    """i, f, o = σ(…), g = tanh(…); c = f cell + i g; h = o tanh(c)."""
    size = b.sizes.hidden
    gates, new = b.split(b.node("Add", x, h), 3 * size, size)
    take, keep, show = b.split(b.node("Sigmoid", gates), size, size, size)
    cell = b.node("Add", b.node("Mul", keep, cell), b.node("Mul", take, b.node("Tanh", new)))
    return cell, b.node("Mul", show, b.node("Tanh", cell))
