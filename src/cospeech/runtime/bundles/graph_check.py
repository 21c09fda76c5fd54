"""Checks an ONNX file before anything runs it: it has only operators that we use, no sub-graphs, and names no file.

The file is a protocol buffer; the little of that format that is needed is read here, as the runtime has no package onnx.
"""

from __future__ import annotations

from collections.abc import Iterator

from ...errors import InputError

__all__ = ["OPERATORS", "WEIGHTS", "check_onnx"]

WEIGHTS = "weights"
"""The place that our graphs name for weights, which is no file: they are handed over when a session is opened."""
OPERATORS = {
    "Abs", "Add", "AveragePool", "Clip", "Concat", "Conv", "ConvTranspose", "DequantizeLinear", "Div", "Exp", "GRU", "Gather",
    "Gemm", "InstanceNormalization", "LSTM", "LeakyRelu", "MatMul", "MatMulIntegerToFloat", "Max", "MaxPool", "Min", "Mul",
    "Pad", "QuantizeLinear", "ReduceMax", "ReduceMean", "Relu", "Reshape", "Resize", "Sigmoid", "Slice", "Softmax", "Split",
    "Sqrt", "Sub", "Tanh", "Transpose",
}  # fmt: skip
"""Everything that our graphs are made of."""
DOMAINS = ("", "ai.onnx", "com.microsoft")
# Field numbers of onnx.proto that may occur; among those that may not: sub-graphs, functions, sparse tensors, training.
_MODEL, _GRAPH = {1, 2, 3, 4, 5, 6, 7, 8, 14}, {1, 2, 5, 10, 11, 12, 13, 16}
_NODE, _ATTRIBUTE, _TENSOR = {1, 2, 3, 4, 5, 6, 7}, {1, 2, 3, 4, 7, 8, 9, 13, 20}, {1, 2, 4, 5, 7, 8, 9, 12, 13, 14}
_TYPES = {1: "float32", 2: "uint8", 3: "int8", 7: "int64"}

Field = tuple[int, int | memoryview]
External = dict[str, tuple[str, tuple[int, ...]]]


def check_onnx(data: bytes) -> External:
    """Name → (type, shape) of the weights that are to be handed over.

    Raises:
        InputError: damaged, or something that no graph of ours has.
    """
    weights: External = {}
    graphs = [value for number, value in _fields(memoryview(data), _MODEL) if number == 7]
    if len(graphs) != 1:
        raise _refuse("it does not hold one graph")
    for number, value in _fields(memoryview(data), _MODEL):
        if number == 8:
            _require_names("domain", _texts(value, 1, {1, 2}) or [""], DOMAINS)
    for number, value in _fields(_message(graphs[0]), _GRAPH):
        if number == 1:
            _check_node(value)
        elif number == 5:
            _check_tensor(value, weights)
    return weights


def _check_node(node: int | memoryview) -> None:
    _require_names("operator", _texts(node, 4, _NODE), OPERATORS)
    _require_names("domain", _texts(node, 7, _NODE), DOMAINS)
    for number, value in _fields(_message(node), _NODE):
        if number == 5:
            for _ in _fields(_message(value), _ATTRIBUTE):
                pass


def _check_tensor(tensor: int | memoryview, weights: External) -> None:
    names, places, kind, shape, outside = [""], list[str](), "", list[int](), 0
    for number, value in _fields(_message(tensor), _TENSOR):
        if number == 1:
            shape += list(_numbers(value))
        elif number == 2:
            kind = _TYPES.get(_number(value), "")
        elif number == 8:
            names.append(_text(value))
        elif number == 13:
            entry = [_texts(value, field, {1, 2}) for field in (1, 2)]
            if entry[0] != ["location"]:
                raise _refuse("its weights lie in parts of files")
            places += entry[1]
        elif number == 14:
            outside = _number(value)
    if not outside and not places:
        return
    if outside != 1 or places != [WEIGHTS]:
        raise _refuse(f"it names a file, {', '.join(places)[:60]!r}")
    weights[names[-1]] = (kind, tuple(shape))


def _require_names(what: str, names: list[str], valid: object) -> None:
    for name in names:
        if name not in valid:  # type: ignore[operator]
            raise _refuse(f"it has the {what} {name[:60]!r}")


def _refuse(why: str) -> InputError:
    return InputError(f"an ONNX graph is refused: {why}", "is the bundle from another program, or damaged?")


def _fields(data: memoryview, numbers: set[int]) -> Iterator[Field]:
    """(number, value) of a message: an integer, or the bytes of text, arrays and messages."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, wire = key >> 3, key & 7
        if number not in numbers:
            raise _refuse(f"it has a field {number} that ours do not have")
        if wire == 0:
            value, at = _varint(data, at)
            yield number, value
            continue
        size = {1: 8, 5: 4}.get(wire)
        if wire == 2:
            size, at = _varint(data, at)
        if size is None or at + size > len(data):
            raise _refuse("it is damaged")
        yield number, data[at : at + size]
        at += size


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(data):
            break
        byte, at = data[at], at + 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, at
    raise _refuse("it is damaged")


def _message(value: int | memoryview) -> memoryview:
    if isinstance(value, int):
        raise _refuse("it is damaged")
    return value


def _number(value: int | memoryview) -> int:
    if not isinstance(value, int):
        raise _refuse("it is damaged")
    return value


def _numbers(value: int | memoryview) -> Iterator[int]:
    if isinstance(value, int):
        yield value
        return
    at = 0
    while at < len(value):
        number, at = _varint(value, at)
        yield number


def _text(value: int | memoryview) -> str:
    return bytes(_message(value)).decode("utf-8", "replace")


def _texts(message: int | memoryview, field: int, numbers: set[int]) -> list[str]:
    return [_text(value) for number, value in _fields(_message(message), numbers) if number == field]
