"""Writes each operator of an exported graph to the new one: `cospeech.training.export.frame_graph`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from onnx import NodeProto

from ...motion.rotations import Array
from .frame_graph import FrameGraph, Joined, Padded, Value, attributes, refuse

__all__ = ["OPERATORS", "plain"]

Values = list[Any]
_CHANNELS, _FRAMES = 1, 3  # axes of a picture


def plain(b: FrameGraph, node: NodeProto) -> Values:
    """Write an operator as it is."""
    inputs = [Value("", "plain", True) if not name else b.plain(b.value(name)) for name in node.input]
    names = b.node(node.op_type, *(each.name for each in inputs), outputs=len(node.output), **attributes(node))
    is_shared = all(each.shared for each in inputs)
    return [Value(name, "plain", is_shared) for name in ([names] if isinstance(names, str) else names)]


def _layout(*values: Any) -> str:
    """The layout of the pictures among some values; "plain" where there are none."""
    members = [
        value.parts[0][0] if isinstance(value, Joined) else value.value if isinstance(value, Padded) else value
        for value in values
    ]
    return next((value.layout for value in members if value.layout != "plain"), "plain")


def _axis(axis: int, layout: str) -> int:
    """The axis of a picture for one of (n, C, T) or (n, T, C)."""
    return ((0, _CHANNELS, _FRAMES) if layout == "waves" else (0, _FRAMES, _CHANNELS))[axis]


def _each(b: FrameGraph, node: NodeProto) -> Values:
    """An operator on every number."""
    value = b.whole(b.value(node.input[0]))
    return [Value(b.node(node.op_type, value.name, **attributes(node)), value.layout, value.shared)]


def _identity(b: FrameGraph, node: NodeProto) -> Values:
    """The value itself."""
    return [b.value(node.input[0])]


def _softmax(b: FrameGraph, node: NodeProto) -> Values:
    value, axis = b.value(node.input[0]), attributes(node).get("axis", -1)
    if _layout(value) == "plain":
        return plain(b, node)
    value = b.lift(value, _layout(value))
    return [Value(b.node("Softmax", value.name, axis=_axis(axis, value.layout)), value.layout, value.shared)]


def _both(b: FrameGraph, node: NodeProto) -> Values:
    """An operator on two values, of which one may be broadcast."""
    constants = [b.constant(name) for name in node.input]
    outputs = _add_bias(b, node, constants)
    if outputs is not None:
        return outputs
    values = [None if each is not None else b.value(name) for name, each in zip(node.input, constants, strict=True)]
    operands = [value for value in values if value is not None]
    layout = _layout(*operands)
    dims = [b.dims(name) for name in node.input]
    pairs = zip(dims, constants, strict=True)
    ranks = [3 if constant is not None and len(size) <= 3 else len(size) for size, constant in pairs]
    if layout == "plain" or ranks != [3, 3]:
        return plain(b, node)
    pictures = [
        b.lift(value, layout) if constant is None else Value(b.hold(_as_picture(constant, layout)), layout, True)
        for value, constant in zip(values, constants, strict=True)
    ]
    name = b.node(node.op_type, *(each.name for each in pictures))
    return [Value(name, layout, all(each.shared for each in pictures))]


def _as_picture(constant: Array, layout: str) -> Array:
    """A constant in the shape that broadcasts over pictures."""
    if constant.size == 1:
        return constant.reshape(())
    whole = constant.reshape((1,) * (3 - constant.ndim) + constant.shape)
    return (whole if layout == "waves" else whole.swapaxes(1, 2))[:, :, None]


def _add_bias(b: FrameGraph, node: NodeProto, constants: list[Array | None]) -> Values | None:
    """One convolution for a product with weights and a sum with a bias; None: the node is something else."""
    for name, bias in zip(node.input, reversed(constants), strict=True):
        inner = b.maker(name)
        if node.op_type == "Add" and bias is not None and inner is not None and inner.op_type == "MatMul":
            weight = b.constant(inner.input[1])
            if weight is not None and weight.ndim == 2 and bias.size == weight.shape[1] and len(b.dims(inner.input[0])) == 3:
                return [_convolve(b, b.lift(b.value(inner.input[0]), "rows"), weight.T[:, :, None, None], bias.ravel())]
    return None


def _matmul(b: FrameGraph, node: NodeProto) -> Values:
    left, right = (b.constant(name) for name in node.input)
    if right is not None and right.ndim == 2 and len(b.dims(node.input[0])) == 3:
        return [_convolve(b, b.lift(b.value(node.input[0]), "rows"), right.T[:, :, None, None])]
    if left is not None and left.ndim == 2 and len(b.dims(node.input[1])) == 3:
        return [_convolve(b, b.lift(b.value(node.input[1]), "waves"), left[:, :, None, None])]
    return plain(b, node)


def _convolve(b: FrameGraph, x: Value, weight: Array, bias: Array | None = None, **options: Any) -> Value:
    weights = [b.hold(weight)] + ([] if bias is None else [b.hold(bias)])
    options = {"kernel_shape": list(weight.shape[2:]), **options}
    return Value(b.node("Conv", x.name, *weights, **options), x.layout, x.shared)


def _conv(b: FrameGraph, node: NodeProto) -> Values:
    weight = b.constant(node.input[1])
    bias = b.constant(node.input[2]) if len(node.input) > 2 and node.input[2] else None
    if weight is None:
        raise refuse(node)
    if weight.ndim != 3:
        return plain(b, node)
    own, value = attributes(node), b.value(node.input[0])
    before, after = own.get("pads", [0, 0])
    if isinstance(value, Padded):
        before, after, value = before + value.before, after + value.after, value.value
    options = {
        "strides": [1, *own.get("strides", [1])], "pads": [0, before, 0, after], "group": own.get("group", 1),
        "dilations": [1, *own.get("dilations", [1])],
    }  # fmt: skip
    weight = weight[:, :, None]
    if not isinstance(value, Joined) or options["group"] > 1:
        return [_convolve(b, b.lift(value, "waves"), weight, bias, **options)]
    kernels = np.split(weight, np.cumsum([width for _, width in value.parts])[:-1], 1)
    total: Value | None = None
    for is_shared in (True, False):  # a convolution of channels side by side is the sum of those of its parts
        indices = [k for k, (part, _) in enumerate(value.parts) if part.shared == is_shared]
        names = [b.lift(value.parts[k][0], "waves").name for k in indices]
        x = Value(names[0] if len(names) == 1 else b.node("Concat", *names, axis=1), "waves", is_shared)
        term = _convolve(b, x, np.concatenate([kernels[k] for k in indices], 1), bias if is_shared else None, **options)
        total = term if total is None else Value(b.node("Add", total.name, term.name), "waves", False)
    return [total]


def _conv_transpose(b: FrameGraph, node: NodeProto) -> Values:
    weight = b.constant(node.input[1])
    bias = b.constant(node.input[2]) if len(node.input) > 2 and node.input[2] else None
    if weight is None or weight.ndim != 3:
        raise refuse(node)
    x, own = b.lift(b.value(node.input[0]), "waves"), attributes(node)
    before, after = own.get("pads", [0, 0])
    weights = [b.hold(weight[:, :, None])] + ([] if bias is None else [b.hold(bias)])
    name = b.node(
        "ConvTranspose", x.name, *weights, kernel_shape=[1, weight.shape[2]], strides=[1, *own.get("strides", [1])],
        pads=[0, before, 0, after], group=own.get("group", 1), dilations=[1, *own.get("dilations", [1])],
        output_padding=[0, *own.get("output_padding", [0])],
    )  # fmt: skip
    return [Value(str(name), "waves", x.shared)]


def _concat(b: FrameGraph, node: NodeProto) -> Values:
    names = [name for name in node.input if 0 not in b.dims(name)]
    zeros, rank = [b.is_zero(name) for name in names], len(b.dims(names[0]))
    values = [b.value(name) for name, zero in zip(names, zeros, strict=True) if not zero]
    layout, axis = _layout(*values), attributes(node)["axis"] % rank
    if len(names) == 1:
        return values
    if rank != 3:
        inputs = [b.plain(b.value(name)) for name in names]
        if len({value.shared for value in inputs}) > 1:
            inputs = [b.spread(value, rank) for value in inputs]
        return [Value(b.node("Concat", *(each.name for each in inputs), axis=axis), "plain", inputs[0].shared)]
    if axis == 2 and any(zeros):
        (index,) = (k for k, zero in enumerate(zeros) if not zero)
        sizes = [b.dims(name)[2] for name in names]
        return [Padded(b.lift(b.value(names[index]), "waves"), sum(map(int, sizes[:index])), sum(map(int, sizes[index + 1 :])))]
    layout = layout if layout != "plain" else ("waves" if axis == 1 else "rows")
    pictures = [b.lift(value, layout) for value in values]
    place = _axis(axis, layout)
    if len({value.shared for value in pictures}) > 1:
        if place == _CHANNELS:
            return [Joined(tuple(zip(pictures, [int(b.dims(name)[axis]) for name in names], strict=True)))]
        pictures = [b.spread(value) for value in pictures]
    return [Value(b.node("Concat", *(each.name for each in pictures), axis=place), layout, pictures[0].shared)]


def _split(b: FrameGraph, node: NodeProto) -> Values:
    value, axis = b.value(node.input[0]), attributes(node).get("axis", 0) % len(b.dims(node.input[0]))
    widths, layout = [int(b.dims(name)[axis]) for name in node.output], _layout(value)
    value = b.plain(value) if layout == "plain" else b.lift(value, layout)
    sizes = [width for width in widths if width]
    names = [value.name]
    if len(sizes) > 1:
        place = axis if layout == "plain" else _axis(axis, layout)
        names = b.node("Split", value.name, b.const(sizes, np.int64), outputs=len(sizes), axis=place)
    each = iter(names)
    return [Value(next(each), layout, value.shared) if width else None for width in widths]


def _slice(b: FrameGraph, node: NodeProto) -> Values:
    value = b.value(node.input[0])
    layout, constants = _layout(value), [each for name in node.input[1:] if (each := b.constant(name)) is not None]
    if len(constants) < max(3, len(node.input) - 1):
        raise refuse(node)
    value = b.plain(value) if layout == "plain" else b.lift(value, layout)
    rank, axes = len(b.dims(node.input[0])), [int(axis) for axis in constants[2].ravel()]
    axes = [axis % rank for axis in axes] if layout == "plain" else [_axis(axis % rank, layout) for axis in axes]
    edges = [b.const(each, np.int64) for each in (constants[0], constants[1], axes, *constants[3:])]
    return [Value(b.node("Slice", value.name, *edges), layout, value.shared)]


def _gather(b: FrameGraph, node: NodeProto) -> Values:
    value, places = b.value(node.input[0]), b.constant(node.input[1])
    layout, axis = _layout(value), attributes(node).get("axis", 0)
    if places is None or layout == "plain" or places.ndim != 1:
        return plain(b, node)
    value = b.lift(value, layout)
    name = b.node("Gather", value.name, b.const(places, np.int64), axis=_axis(axis, layout))
    return [Value(name, layout, value.shared)]


def _transpose(b: FrameGraph, node: NodeProto) -> Values:
    value, order = b.value(node.input[0]), [*attributes(node)["perm"]]
    if order != [0, 2, 1]:
        return [b.plain(value, order)]
    if isinstance(value, Joined):
        return [Joined(tuple((_turn(part), width) for part, width in value.parts))]
    return [_turn(b.lift(value, "rows" if value.layout == "plain" else value.layout))]


def _turn(value: Value) -> Value:
    """A picture of the value with frames and channels exchanged: the picture stays, its layout in PyTorch is the other one."""
    return Value(value.name, "waves" if value.layout == "rows" else "rows", value.shared)


def _reshape(b: FrameGraph, node: NodeProto) -> Values:
    value, before = b.value(node.input[0]), b.dims(node.input[0])
    shape = b.shape_in(node.input[1]) if node.op_type == "Reshape" else None
    after = shape if shape and -1 not in shape and 0 not in shape else b.dims(node.output[0])
    is_picture = _layout(value) == "waves"
    if is_picture:
        value = b.lift(value, "waves")  # lies in memory as in PyTorch
        value = Value(value.name, "plain", value.shared)
    target = _target(before, after, node, 2 if is_picture else len(before))  # a picture's third size is another
    if len(after) == 3 and len(before) == 2 and target[0] == 0:  # of a state: a picture at once
        return [Value(b.reshape(b.plain(value).name, [*target[:2], 1, target[2]]), "waves", value.shared)]
    return [Value(b.reshape(b.plain(value).name, target), "plain", value.shared)]


def _expand(b: FrameGraph, node: NodeProto) -> Values:
    if b.dims(node.input[0]) != b.dims(node.output[0]):
        raise refuse(node)
    return [b.value(node.input[0])]


def _target(before: tuple[Any, ...], after: tuple[Any, ...], node: NodeProto, most: int = 8) -> list[int]:
    """A shape for ONNX' Reshape: 0 for sizes that stay, among the first ``most``; −1 for one that follows from the others."""
    count = 0
    while count < min(len(before), len(after), most) and before[count] == after[count]:
        count += 1
    target = [0] * count + [size if isinstance(size, int) else -1 for size in after[count:]]
    if target.count(-1) > 1:
        raise refuse(node)
    return target


def _squeeze(b: FrameGraph, node: NodeProto) -> Values:
    """Remove an axis of one band: a picture becomes a value over frames."""
    value, before, after = b.value(node.input[0]), b.dims(node.input[0]), b.dims(node.output[0])
    if len(before) == 4 and before[2] == 1 and after == (*before[:2], before[3]):
        return [Value(b.plain(value).name, "waves", value.shared)]
    return _reshape(b, node)


def _reduce(b: FrameGraph, node: NodeProto) -> Values:
    """ReduceMean or ReduceMax over frames."""
    value, axes, rank = b.value(node.input[0]), b.constant(node.input[1]), len(b.dims(node.input[0]))
    layout, keep = _layout(value), attributes(node).get("keepdims", 1)
    if layout == "plain" or axes is None or [_axis(int(axis) % rank, layout) for axis in axes] != [_FRAMES]:
        return plain(b, node)
    value = b.lift(value, layout)
    name = b.node(node.op_type, value.name, b.const([_FRAMES] if keep else [2, _FRAMES], np.int64), keepdims=keep)
    return [Value(name, layout if keep else "plain", value.shared)]


def _sum(b: FrameGraph, node: NodeProto) -> Values:
    """A sum, added one by one: ReduceSum rounds differently for one take and for several."""
    value, axes, dims = b.plain(b.value(node.input[0])), b.constant(node.input[1]), b.dims(node.input[0])
    if axes is None or axes.size != 1 or not isinstance(dims[int(axes.item())], int):
        raise refuse(node)
    axis = int(axes.item()) % len(dims)
    parts = b.node("Split", value.name, b.const([1] * int(dims[axis]), np.int64), outputs=int(dims[axis]), axis=axis)
    total, *others = parts if isinstance(parts, list) else [parts]
    for other in others:
        total = b.node("Add", total, other)
    if not attributes(node).get("keepdims", 1):
        total = b.reshape(total, _target(dims, b.dims(node.output[0]), node))
    return [Value(total, "plain", value.shared)]


def _pool(b: FrameGraph, node: NodeProto) -> Values:
    value, own = b.lift(b.value(node.input[0]), "waves"), attributes(node)
    before, after = own.pop("pads", [0, 0])
    shapes: Any = {name: [1, *own.pop(name)] for name in ("kernel_shape", "strides", "dilations") if name in own}
    name = b.node(node.op_type, value.name, **own, **shapes, pads=[0, before, 0, after])
    return [Value(name, "waves", value.shared)]


def _resize(b: FrameGraph, node: NodeProto) -> Values:
    scales = b.constant(node.input[2]) if len(node.input) > 2 and node.input[2] else None
    if scales is None:
        raise refuse(node)
    value = b.value(node.input[0])
    if len(scales) == 3:
        value, scales = b.lift(value, "waves"), np.insert(scales, 2, 1.0)
    own = {key: each for key, each in attributes(node).items() if key in _RESIZE}
    return [Value(b.node("Resize", value.name, "", b.const(scales), **own), value.layout, value.shared)]


_RESIZE = ("coordinate_transformation_mode", "mode", "nearest_mode")


def _pad(b: FrameGraph, node: NodeProto) -> Values:
    pads, value = b.constant(node.input[1]), b.value(node.input[0])
    if pads is None or len(pads) != 6:
        raise refuse(node)
    value = b.lift(value, "waves")
    name = b.node("Pad", value.name, b.const(np.insert(pads, (2, 5), 0), np.int64), **attributes(node))
    return [Value(name, "waves", value.shared)]


def _instance_norm(b: FrameGraph, node: NodeProto) -> Values:
    value = b.lift(b.value(node.input[0]), "waves")
    parameters = [b.value(name).name for name in node.input[1:]]
    return [Value(b.node(node.op_type, value.name, *parameters, **attributes(node)), "waves", value.shared)]


def _group_norm(b: FrameGraph, node: NodeProto) -> Values:
    """Of one group: all channels of a take together."""
    own, channels = attributes(node), int(b.dims(node.input[0])[1])
    scale, shift = (b.constant(name) for name in node.input[1:])
    if own["num_groups"] != 1 or scale is None or shift is None:
        raise refuse(node)
    value = b.lift(b.value(node.input[0]), "waves")
    flat, ends = b.reshape(value.name, [0, 1, 1, -1]), (b.hold(np.ones(1, np.float32)), b.hold(np.zeros(1, np.float32)))
    flat = b.node("InstanceNormalization", flat, *ends, epsilon=own.get("epsilon", 1e-5))
    name = b.node("Mul", b.reshape(flat, [0, channels, 1, -1]), b.hold(scale[:, None, None]))
    return [Value(b.node("Add", name, b.hold(shift[:, None, None])), "waves", value.shared)]


def _recurrent(b: FrameGraph, node: NodeProto) -> Values:
    """LSTM or GRU, without its first state where that is zeros."""
    inputs = [b.plain(b.value(name)) if name in b.inputs_of(node) else None for name in node.input]
    while inputs and inputs[-1] is None:
        inputs.pop()
    names = b.node(node.op_type, *("" if each is None else each.name for each in inputs), outputs=len(node.output),
                   **attributes(node))  # fmt: skip
    is_shared = all(each is None or each.shared for each in inputs)
    return [Value(name, "plain", is_shared) for name in ([names] if isinstance(names, str) else names)]


OPERATORS: dict[str, Callable[[FrameGraph, NodeProto], Values]] = {
    **dict.fromkeys(("Relu", "LeakyRelu", "Sigmoid", "Tanh", "Exp", "Sqrt", "Abs"), _each),
    **dict.fromkeys(("Add", "Sub", "Mul", "Div", "Max", "Min"), _both),
    **dict.fromkeys(("AveragePool", "MaxPool"), _pool),
    **dict.fromkeys(("ReduceMean", "ReduceMax"), _reduce),
    **dict.fromkeys(("LSTM", "GRU"), _recurrent),
    "Concat": _concat, "Conv": _conv, "ConvTranspose": _conv_transpose,
    "Expand": _expand, "Gather": _gather, "GroupNormalization": _group_norm,
    "Identity": _identity, "MatMul": _matmul, "Pad": _pad,
    "InstanceNormalization": _instance_norm, "ReduceSum": _sum, "Reshape": _reshape, "Resize": _resize, "Slice": _slice,
    "Softmax": _softmax, "Split": _split, "Squeeze": _squeeze, "Transpose": _transpose, "Unsqueeze": _reshape,
}  # fmt: skip
"""Operator → what writes it; others are written as they are."""
