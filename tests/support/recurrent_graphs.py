"""Small graphs with memory over time, written by hand for tests of what plays them; needs the package onnx, not torch.

A signal is (N or 1, C, T) as in the networks themselves. What a causal layer keeps from one call to the next is an input
``state0``, ``state1`` … (N or 1, width) and an output ``next.state0`` …, in the order in which layers ask for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cospeech.motion.rotations import Array
from cospeech.runtime.graph_builder import GraphBuilder

__all__ = ["RecurrentGraph", "Wave"]

_LSTM = (0, 3, 1, 2)  # PyTorch's gates are input, forget, cell, output; ONNX' input, output, forget, cell


@dataclass(frozen=True)
class Wave:
    """A value of a graph: (N or 1, channels, T)."""

    name: str
    channels: int
    many: bool
    """Whether it is of N takes; else it is the same for all."""


@dataclass
class RecurrentGraph(GraphBuilder):
    """Layers, their weights gathered in ``store`` under ``prefix``."""

    store: dict[str, Array]
    prefix: str
    states: dict[str, tuple[Any, int]] = field(default_factory=dict)
    """Name → (1 or "N", width)."""

    def __post_init__(self) -> None:
        super().__init__(self.store)

    # ends -----------------------------------------------------------------------------------------------------------

    def rows(self, name: str, channels: int, *, many: bool, frames: bool = True) -> Wave:
        """An input (N or 1, T, channels), or of one frame (N or 1, channels)."""
        turned = self.node("Transpose", name, perm=[0, 2, 1]) if frames else self.shaped(name, 0, channels, 1)
        return Wave(str(turned), channels, many)

    def as_rows(self, x: Wave, name: str, *, frames: bool = True) -> None:
        """A signal → the output (N or 1, T, channels), or of one frame (N or 1, channels)."""
        if frames:
            self.node("Transpose", x.name, outputs=(name,), perm=[0, 2, 1])
        else:
            self.node("Reshape", x.name, self.const([0, x.channels], np.int64), outputs=(name,))

    def made(self, inputs: Mapping[str, tuple[Any, ...]], outputs: Mapping[str, tuple[Any, ...]]) -> bytes:
        """The file, its states among inputs and outputs."""
        after = {f"next.{name}": shape for name, shape in self.states.items()}
        return self.file("recurrent", {**inputs, **self.states}, {**outputs, **after})

    def state(self, width: int, many: bool) -> str:
        """The next state, (N or 1, width)."""
        name = f"state{len(self.states)}"
        self.states[name] = ("N" if many else 1, width)
        return name

    # layers ---------------------------------------------------------------------------------------------------------

    def held(self, value: Array) -> str:
        """A weight of its own."""
        name = f"{self.prefix}.{sum(key.startswith(f'{self.prefix}.') for key in self.store)}"
        self.store[name] = np.ascontiguousarray(value, np.float32)
        return self.weight(name)

    def conv(self, x: Wave, weight: Array, bias: Array | None, *, pads: tuple[int, int] = (0, 0), dilation: int = 1) -> Wave:
        """(outputs, inputs, kernel), with zeros before the first frame and after the last."""
        given = [self.held(weight)] + ([] if bias is None else [self.held(bias)])
        name = self.node("Conv", x.name, *given, pads=list(pads), dilations=[dilation])
        return Wave(str(name), len(weight), x.many)

    def each(self, op: str, x: Wave, **attributes: Any) -> Wave:
        """An operator on every number: Relu, LeakyRelu, Sigmoid, Exp."""
        return Wave(str(self.node(op, x.name, **attributes)), x.channels, x.many)

    def both(self, op: str, x: Wave, y: Wave) -> Wave:
        """Add or Mul of two signals; one may have one frame."""
        return Wave(str(self.node(op, x.name, y.name)), x.channels, x.many or y.many)

    def joined(self, *parts: Wave) -> Wave:
        """Channels one behind the other; those that are the same for all takes are repeated where others are not."""
        parts = tuple(part for part in parts if part.channels)
        many = next((part for part in parts if part.many), None)
        if many is not None:
            edges = [self.const([value], np.int64) for value in (0, 1, 1)]
            zero = self.node("Mul", self.node("Slice", many.name, *edges), self.const(0.0))
            parts = tuple(part if part.many else self.both("Add", part, Wave(str(zero), 1, True)) for part in parts)
        name = parts[0].name if len(parts) == 1 else str(self.node("Concat", *(part.name for part in parts), axis=1))
        return Wave(name, sum(part.channels for part in parts), many is not None)

    def pooled(self, x: Wave, op: str) -> Wave:
        """ReduceMean or ReduceMax over all frames."""
        return Wave(str(self.node(op, x.name, self.const([2], np.int64), keepdims=1)), x.channels, x.many)

    def sliding(self, x: Wave, op: str, frames: int) -> Wave:
        """AveragePool or MaxPool over so many frames, where there are all of them."""
        return Wave(str(self.node(op, x.name, kernel_shape=[frames])), x.channels, x.many)

    def behind(self, x: Wave, frames: int) -> Wave:
        """What came before it, so many frames, then it; of a signal of one frame."""
        if not frames:
            return x
        name = self.state(x.channels * frames, x.many)
        whole = self.node("Concat", self.shaped(name, 0, x.channels, frames), x.name, axis=2)
        edges = [self.const([value], np.int64) for value in (1, frames + 1, 2)]
        kept = self.node("Slice", whole, *edges)
        self.node("Reshape", kept, self.const([0, x.channels * frames], np.int64), outputs=(f"next.{name}",))
        return Wave(str(whole), x.channels, x.many)

    def lstm(self, x: Wave, weights: Mapping[str, Array], *, ways: int, layers: int, stateful: bool = False) -> Wave:
        """Stacked layers of PyTorch's `LSTM`, two directions summed at the end.

        Args:
            x: what is heard.
            weights: of the module, by PyTorch's names.
            ways: 1 or 2 directions.
            layers: how many.
            stateful: whether it goes on from the call before, of one frame.
        """
        hidden = weights["weight_hh_l0"].shape[1]
        state = self.state(2 * layers * hidden, x.many) if stateful else ""
        kept = self.split(state, *[hidden] * (2 * layers)) if stateful else []
        after: list[str] = []
        y = str(self.node("Transpose", x.name, perm=[2, 0, 1]))
        for k in range(layers):
            given = self._recurrent_weights(weights, k, ways, _LSTM)
            begun = [self.shaped(kept[k + part * layers], 1, -1, hidden) for part in (0, 1)] if stateful else []
            made = self.node("LSTM", y, *given, "", *begun, outputs=3, hidden_size=hidden, direction=_WAYS[ways])
            after += made[1:]
            y = self._layer_end(made[0], ways, k == layers - 1)
        if stateful:
            order = [after[2 * k + part] for part in (0, 1) for k in range(layers)]
            flat = [self.shaped(each, -1, hidden) for each in order]
            self.node("Concat", *flat, outputs=(f"next.{state}",), axis=1)
        return Wave(str(self.node("Transpose", y, perm=[1, 2, 0])), hidden, x.many)

    def shaped(self, name: str, *shape: int) -> str:
        """In another shape."""
        return str(self.node("Reshape", name, self.const(shape, np.int64)))

    def _recurrent_weights(self, weights: Mapping[str, Array], layer: int, ways: int, gates: tuple[int, ...]) -> list[str]:
        """W, R and B of a layer as ONNX has them: (ways, gates · hidden, inputs) and so on."""
        ends = ["", "_reverse"][:ways]
        w, r, *biases = (
            np.stack([_gated(weights[f"{kind}_l{layer}{end}"], gates) for end in ends])
            for kind in ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
        )
        return [self.held(w), self.held(r), self.held(np.concatenate(biases, 1))]

    def _layer_end(self, made: str, ways: int, last: bool) -> str:
        """(T, ways, N, hidden) → (T, N, ways · hidden), of the last layer the sum (T, N, hidden)."""
        if ways == 2 and last:
            ahead, back = self.split(made, 1, 1)
            made = str(self.node("Add", ahead, back))
        return self.shaped(str(self.node("Transpose", made, perm=[0, 2, 1, 3])), 0, 0, -1)


_WAYS = {1: "forward", 2: "bidirectional"}


def _gated(value: Array, order: tuple[int, ...]) -> Array:
    """Blocks of gates in another order."""
    blocks = np.split(value, len(order))
    return np.concatenate([blocks[k] for k in order])
