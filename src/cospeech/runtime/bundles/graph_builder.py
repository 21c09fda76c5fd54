"""Builds ONNX graphs whose weights lie outside of them; what the builders of our networks share. Needs the package onnx."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from ...motion.rotations import Array
from .graph_check import WEIGHTS

__all__ = ["GraphBuilder"]

_KINDS = {"float32": "FLOAT", "int64": "INT64", "uint8": "UINT8", "int8": "INT8"}


class GraphBuilder:
    """Nodes and the weights that they use; every value has a name.

    Args:
        weights: name → array, from which `weight` takes type and shape.
    """

    def __init__(self, weights: Mapping[str, Array]) -> None:
        from onnx import TensorProto, helper

        self.weights, self.helper, self.types = weights, helper, TensorProto
        self.nodes: list[Any] = []
        self.used: dict[str, Any] = {}

    def node(self, op: str, *inputs: str, outputs: int | tuple[str, ...] = 1, **attributes: Any) -> Any:
        """Add a node; the name of its output, or a list of names."""
        number = len(self.nodes)
        names = list(outputs) if isinstance(outputs, tuple) else [f"v{number}.{n}" for n in range(outputs)]
        domain = "com.microsoft" if op == "MatMulIntegerToFloat" else ""
        self.nodes.append(self.helper.make_node(op, list(inputs), names, domain=domain, **attributes))
        return names[0] if len(names) == 1 else names

    def weight(self, name: str) -> str:
        """A weight, handed over when the session is opened."""
        if name not in self.used:
            value = self.weights[name]
            proto = self.types(name=name, dims=value.shape, data_location=self.types.EXTERNAL)
            proto.data_type = getattr(self.types, _KINDS[value.dtype.name])
            proto.external_data.add(key="location", value=WEIGHTS)
            self.used[name] = proto
        return name

    def const(self, value: Any, dtype: Any = np.float32) -> str:
        """A small number or shape that lies in the graph."""
        array = np.asarray(value, dtype)
        name = f"c.{array.dtype}.{array.ndim}.{'.'.join(map(repr, array.ravel().tolist()))}"
        if name not in self.used:
            kind = getattr(self.types, _KINDS[array.dtype.name])
            self.used[name] = self.helper.make_tensor(name, kind, array.shape, array.ravel())
        return name

    def split(self, value: str, *widths: int) -> list[str]:
        """Columns of a matrix."""
        return (
            [value]
            if len(widths) == 1
            else self.node("Split", value, self.const(widths, np.int64), outputs=len(widths), axis=1)
        )

    def file(
        self,
        name: str,
        inputs: Mapping[str, tuple[Any, ...]],
        outputs: Mapping[str, tuple[Any, ...]],
        in_bytes: Collection[str] = (),
    ) -> bytes:
        """The graph as a file.

        Args:
            name: of the graph.
            inputs, outputs: name → shape; float32.
            in_bytes: names of those that are bytes instead.
        """

        def values(shapes: Mapping[str, tuple[Any, ...]]) -> list[Any]:
            kinds = {name: self.types.UINT8 if name in in_bytes else self.types.FLOAT for name in shapes}
            return [self.helper.make_tensor_value_info(name, kinds[name], shape) for name, shape in shapes.items()]

        graph = self.helper.make_graph(self.nodes, name, values(inputs), values(outputs), list(self.used.values()))
        opsets = [self.helper.make_opsetid("", 21), self.helper.make_opsetid("com.microsoft", 1)]
        data: bytes = self.helper.make_model(graph, opset_imports=opsets, ir_version=10).SerializeToString()
        return data
