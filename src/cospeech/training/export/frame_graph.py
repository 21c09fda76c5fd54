"""The graph that a bundle holds, written from the graph that PyTorch exports; it computes the same, quickly.

Values over frames, (n, C, T) or (n, T, C), become pictures (n, C, 1, T): onnxruntime has its fastest convolutions for pictures
with time along their rows. Values that are the same for all takes are computed for one take. Weights lie outside of the graph.
`cospeech.training.export.frame_operators` writes each operator.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from onnx import NodeProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator

from ...errors import InputError
from ...motion.rotations import Array
from ...runtime.bundles.graph_builder import GraphBuilder

__all__ = ["Dims", "FrameGraph", "Joined", "Padded", "Value", "attributes", "refuse"]

Dims = tuple[int | str, ...]
"""A shape: numbers, and names of sizes that vary."""
_REARRANGE = ("Concat", "ConstantOfShape", "Expand", "Reshape", "Slice", "Split", "Squeeze", "Transpose", "Unsqueeze")


@dataclass(frozen=True)
class Value:
    """A value of the new graph."""

    name: str
    layout: str
    """``waves``: (n, C, 1, T), which PyTorch has as (n, C, T); ``rows``: the same, there (n, T, C); ``plain``: as there."""
    shared: bool
    """Whether it is the same for all takes, and computed for one."""


@dataclass(frozen=True)
class Joined:
    """Channels side by side, some of which are the same for all takes."""

    parts: tuple[tuple[Value, int], ...]
    """Values of one layout, and how many channels each has."""
    shared = False


@dataclass(frozen=True)
class Padded:
    """A value with zeros before its first frame and after its last."""

    value: Value
    before: int
    after: int


class FrameGraph(GraphBuilder):
    """The new graph, with the nodes that its outputs need.

    Args:
        model: the graph that PyTorch exported; each input has N takes.
        inputs: name → shape; a first size of 1: the input is the same for all takes.
        store: the weights are added to it.
        prefix: of their names.
    """

    def __init__(self, model: Any, inputs: Mapping[str, Dims], store: dict[str, Array], prefix: str) -> None:
        super().__init__(store)
        self._store, self._prefix, self._inputs = store, prefix, inputs
        graph = model.graph
        self._nodes: list[NodeProto] = [*graph.node]
        self._producers: dict[str, NodeProto] = {name: node for node in graph.node for name in node.output}
        self._constants: dict[str, Array | None] = {each.name: numpy_helper.to_array(each) for each in graph.initializer}
        self._dims = {each.name: _dims(each) for each in (*graph.input, *graph.output, *graph.value_info)}
        self._uses: dict[str, int] = {}
        for node in graph.node:
            for name in node.input:
                self._uses[name] = self._uses.get(name, 0) + 1
        self._values: dict[str, Any] = {}
        self._outputs: dict[str, str] = {}  # value → the output that it has become
        self._pictures: dict[tuple[str, str], Value] = {}

    # the exported graph ---------------------------------------------------------------------------------------------

    def dims(self, name: str) -> Dims:
        """The shape that a value has in PyTorch."""
        constant = self.constant(name)
        return tuple(constant.shape) if constant is not None else self._dims[name]

    def constant(self, name: str) -> Array | None:
        """The array of a value that does not depend on any input; None: it does."""
        if name not in self._constants:
            node, results = self._producers.get(name), None
            inputs = None if node is None else [self.constant(each) for each in node.input if each]
            if node is not None and inputs is not None and all(each is not None for each in inputs):
                feeds = dict(zip([each for each in node.input if each], inputs, strict=True))
                results = dict(zip(node.output, ReferenceEvaluator(node).run(None, feeds), strict=True))
            for each in [name] if results is None or node is None else node.output:
                self._constants[each] = None if results is None else results[each]
        return self._constants[name]

    def shape_in(self, name: str) -> Dims | None:
        """The shape that a value holds, if it is computed from shapes of others; None: it is not."""
        constant, node = self.constant(name), self._producers.get(name)
        if constant is not None:
            return tuple(constant.ravel().tolist())
        if node is None:
            return None
        if node.op_type == "Shape":
            own = attributes(node)
            return self.dims(node.input[0])[own.get("start", 0) : own.get("end")]
        parts = [self.shape_in(each) for each in node.input]
        if any(part is None for part in parts):
            return None
        first, *others = [part for part in parts if part is not None]
        if node.op_type == "Concat":
            return sum(others, first)
        if node.op_type == "Slice":
            return first[int(others[0][0]) : int(others[1][0])]
        if node.op_type == "Mul" and all(isinstance(size, int) for size in first + others[0]):
            return tuple(int(a) * int(b) for a, b in zip(first, others[0], strict=True))
        return first if node.op_type in ("Reshape", "Squeeze", "Unsqueeze") else None

    def maker(self, name: str) -> NodeProto | None:
        """The node that makes a value, if the value is read only once; else None."""
        return self._producers.get(name) if self._uses.get(name) == 1 else None

    def is_zero(self, name: str) -> bool:
        """Whether a value is zeros whatever the inputs are."""
        constant, node = self.constant(name), self._producers.get(name)
        if constant is not None:
            return not constant.any()
        if node is None or node.op_type not in _REARRANGE:
            return False
        if node.op_type == "ConstantOfShape":
            return not any(numpy_helper.to_array(each.t).any() for each in node.attribute)
        return all(self.is_zero(each) for each in (node.input if node.op_type == "Concat" else node.input[:1]))

    # values of the new graph ----------------------------------------------------------------------------------------

    def write(self, outputs: Mapping[str, Dims]) -> set[str]:
        """Write all nodes and outputs; return the names of outputs that are the same for all takes.

        Raises:
            InputError: an operator has no place in a bundle.
        """
        from .frame_operators import OPERATORS, plain

        live, waiting = set[str](), [*outputs]
        while waiting:
            name = waiting.pop()
            if name not in live and name in self._producers and self.constant(name) is None:
                live.add(name)
                waiting += self.inputs_of(self._producers[name])
        for node in self._nodes:
            if live & {*node.output} and not all(0 in self.dims(name) for name in node.output):
                self._values.update(zip(node.output, OPERATORS.get(node.op_type, plain)(self, node), strict=False))
        return {name for name, shape in outputs.items() if self._write_output(name, shape)}

    def inputs_of(self, node: NodeProto) -> list[str]:
        """The inputs on which a node's result depends: no shapes, which are constants, and no first states that are zeros."""
        if node.op_type in ("Reshape", "Expand"):
            return [node.input[0]]
        if node.op_type == "Concat":
            return [name for name in node.input if not self.is_zero(name)] or [*node.input]
        return [name for name in node.input if name and not (node.op_type in ("LSTM", "GRU") and self.is_zero(name))]

    def value(self, name: str) -> Any:
        """The new value of a value in PyTorch: a `Value`, a `Joined`, or None where it has no width."""
        if name not in self._values:
            if 0 in self.dims(name):
                self._values[name] = None
            elif (constant := self.constant(name)) is not None:
                self._values[name] = Value(self.hold(constant), "plain", True)
            else:
                self._values[name] = Value(name, "plain", self._inputs[name][0] == 1)
        return self._values[name]

    def hold(self, value: Array) -> str:
        """The name of a constant: a weight, or, for a single number and other types than float32, a constant of the graph."""
        value = np.asarray(value)
        if value.dtype != np.float32 or value.size == 1:
            return self.const(value, value.dtype)
        for name, array in self._store.items():
            if array.shape == value.shape and np.array_equal(array, value):
                return self.weight(name)
        name = f"{self._prefix}.{sum(key.startswith(f'{self._prefix}.') for key in self._store)}"
        self._store[name] = np.ascontiguousarray(value)
        return self.weight(name)

    def reshape(self, name: str, shape: Sequence[int]) -> str:
        """A value in another shape."""
        return str(self.node("Reshape", name, self.const(shape, np.int64)))

    def lift(self, value: Any, layout: str) -> Value:
        """A value over frames as a picture."""
        value = self.whole(value)
        if value.layout == layout:
            return value  # type: ignore[no-any-return]
        key = (value.name, layout)
        if key not in self._pictures:
            if value.layout != "plain":  # frames become channels
                name = self.node("Transpose", value.name, perm=[0, 3, 2, 1])
            else:
                rows = value.name if layout == "waves" else self.node("Transpose", value.name, perm=[0, 2, 1])
                name = self.reshape(rows, [0, 0, 1, -1])
            self._pictures[key] = Value(name, layout, value.shared)
        return self._pictures[key]

    def plain(self, value: Any, order: Sequence[int] | None = None) -> Value:
        """A value as PyTorch has it; ``order``: with its axes in this order."""
        value = self.whole(value)
        name, axes = value.name, list(order or ())
        if value.layout != "plain":
            name = self.reshape(name, [0, 0, -1])
            if value.layout == "rows":
                axes = [(0, 2, 1)[axis] for axis in axes or (0, 1, 2)]
        if axes and axes != sorted(axes):
            name = self.node("Transpose", name, perm=axes)
        return Value(name, "plain", value.shared)

    def whole(self, value: Any) -> Value:
        """The value with its concatenation or padding written out."""
        if isinstance(value, Padded):
            pads = self.const([0, 0, 0, value.before, 0, 0, 0, value.after], np.int64)
            return Value(self.node("Pad", value.value.name, pads), value.value.layout, value.value.shared)
        if isinstance(value, Joined):
            parts = [self.spread(part) for part, _ in value.parts]
            return Value(self.node("Concat", *(part.name for part in parts), axis=1), parts[0].layout, False)
        return value  # type: ignore[no-any-return]

    def spread(self, value: Value, rank: int = 4) -> Value:
        """Repeat a value that is the same for all takes for each of them.

        Args:
            value: a picture, or a plain value.
            rank: how many axes it has.
        """
        if not value.shared:
            return value
        name, shape = next((name, shape) for name, shape in self._inputs.items() if shape[0] != 1)
        edges = [self.const([k] * (len(shape) - 1), np.int64) for k in (0, 1)]
        first = self.node("Slice", name, *edges, self.const(range(1, len(shape)), np.int64))
        zero = self.node("Reshape", self.node("Mul", first, self.const(0.0)), self.const([0, *[1] * (rank - 1)], np.int64))
        return Value(self.node("Add", value.name, zero), value.layout, False)

    def _write_output(self, name: str, shape: Dims) -> bool:
        """Write an output of PyTorch as one of the new graph.

        Returns:
            Whether it is the same for all takes.
        """
        value = self.value(name)
        value = self.whole(value)
        if value.shared and shape[0] != 1:
            value = self.spread(self.lift(value, "rows"))
        output = self.plain(value)
        if output.name in self._outputs or output.name in self._inputs:  # a value of another name needs a node
            output = Value(self.reshape(self._outputs.get(output.name, output.name), [0] * len(shape)), "plain", output.shared)
        for node in self.nodes:
            for names in (node.input, node.output):
                names[:] = [name if each == output.name else each for each in names]
        self._outputs[output.name] = name
        return output.shared


def attributes(node: NodeProto) -> dict[str, Any]:
    """Attributes of a node, by name."""
    return {each.name: helper.get_attribute_value(each) for each in node.attribute}


def refuse(node: NodeProto) -> InputError:
    """What to raise for a node that has no place in a bundle."""
    return InputError(f"a network that computes with {node.op_type} ({node.name})"[:200], "no bundle may hold this operator")


def _dims(value: Any) -> Dims:
    """The shape of a value; an unknown size gets a name of its own."""
    sizes = value.type.tensor_type.shape.dim
    return tuple(
        each.dim_value if each.WhichOneof("value") == "dim_value" else each.dim_param or f"{value.name}.{k}"
        for k, each in enumerate(sizes)
    )
