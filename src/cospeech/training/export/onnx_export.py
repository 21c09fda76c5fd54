"""Networks as graphs that play without PyTorch, by `torch.onnx.export`.

Each graph is traced with two takes, written anew (`cospeech.training.export.frame_graph`) and compared with PyTorch, for
another number of takes and of frames.

Network by windows: ``make`` and, where it recognises styles, ``style``. Network of many inputs: ``make``, and ``classify`` and
``live`` where it has them. `cospeech.models.nn.export.ExportGraph` says what goes in and comes out.
"""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from ...errors import InputError
from ...models.nn.export import ExportGraph, inference_copy
from ...motion.rotations import Array
from ...runtime.chain_engine import ChainSizes
from ...runtime.onnx_session import open_session
from ...runtime.window_engine import WindowSizes
from .frame_graph import Dims, FrameGraph

__all__ = ["Lowered", "LoweredChain", "export_graphs", "lower", "lower_chain", "reach_of"]

OPSET = 21  # of onnxruntime 1.20 and later
ERROR = 1e-4  # ours: of poses of about 1, float32; more is a fault of the export
FURTHEST = 1 << 11  # frames; ours: a network that hears further hears all of a window


class Lowered(NamedTuple):
    """What `cospeech.runtime.window_engine.WindowEngine` is made of."""

    sizes: WindowSizes
    weights: dict[str, Array]
    graphs: dict[str, bytes]


class LoweredChain(NamedTuple):
    """What `cospeech.runtime.chain_engine.ChainEngine` is made of."""

    sizes: ChainSizes
    weights: dict[str, Array]
    graphs: dict[str, bytes]


def lower(net: Any) -> Lowered:
    """A network by windows, as it evaluates."""
    sizes = WindowSizes(
        pose=net.pose, audio=net.audio, styles=net.styles, modes=net.modes, window=net.window, multiple=net.multiple,
        reach=reach_of(net),
    )  # fmt: skip
    return Lowered(sizes, *export_graphs(net.export_module()))


def lower_chain(net: Any) -> LoweredChain:
    """A network of many inputs, as it evaluates."""
    return LoweredChain(ChainSizes(**net.chain_sizes()), *export_graphs(net.export_module()))


@torch.no_grad()
def export_graphs(graphs: Mapping[str, ExportGraph]) -> tuple[dict[str, Array], dict[str, bytes]]:
    """Weights, which lie outside of the graphs, and the graphs.

    Raises:
        InputError: a network computes what no bundle may hold, or its graph differs from PyTorch.
    """
    weights: dict[str, Array] = {}
    made = {}
    for name, graph in graphs.items():
        made[name] = _export(name, graph, weights)
    return weights, made


def _export(name: str, graph: ExportGraph, weights: dict[str, Array]) -> bytes:
    module = inference_copy(graph.module)
    exported = _trace(graph, module)
    shared = {*graph.states}
    while True:  # until every state that is taken as the same for all takes is so
        inputs: dict[str, Dims] = {**graph.inputs, **_states(graph, shared)}
        after = {f"next.{key}": shape for key, shape in _states(graph, shared).items()}
        outputs: dict[str, Dims] = {**graph.outputs, **after}
        store = dict(weights)
        writer = FrameGraph(exported, inputs, store, name)
        alike = writer.write(outputs)
        if all(f"next.{key}" in alike for key in shared):
            break
        shared = {key for key in shared if f"next.{key}" in alike}
    data = writer.file(name, inputs, outputs)
    _compare(name, graph, module, data, store, inputs)
    weights |= {key: value for key, value in store.items() if key in writer.used}
    return data


def _states(graph: ExportGraph, shared: set[str]) -> dict[str, Dims]:
    return {name: (1 if name in shared else "N", width) for name, width in graph.states.items()}


def _examples(graph: ExportGraph, takes: int, frames: int) -> dict[str, Tensor]:
    """Inputs and states of normal noise, each with all takes."""
    rng = torch.Generator().manual_seed(0)
    shapes = {**graph.inputs, **{name: ("N", width) for name, width in graph.states.items()}}
    sizes = {"N": takes, "T": frames}
    found = {}
    for name, (first, *rest) in shapes.items():
        own = [size if isinstance(size, int) else sizes[size] for size in rest]
        found[name] = torch.randn(1 if first == 1 else takes, *own, generator=rng).expand(takes, *own).contiguous()
    return found


def _trace(graph: ExportGraph, module: torch.nn.Module) -> Any:
    """The model as PyTorch exports it."""
    given = _examples(graph, 2, graph.frames)
    takes, frames = torch.export.Dim("N"), torch.export.Dim("T", min=-(-graph.shortest // graph.multiple))
    frames = frames * graph.multiple if graph.multiple > 1 else frames
    over_time = {name for name, shape in graph.inputs.items() if "T" in shape}
    shapes = [{0: takes, 1: frames} if name in over_time else {0: takes} for name in given]
    names = [*graph.outputs, *(f"next.{name}" for name in graph.states)]
    with _quiet():
        try:
            program = torch.onnx.export(
                _Listed(module), ([*given.values()],), dynamo=True, input_names=[*given], output_names=names,
                opset_version=OPSET, dynamic_shapes=(shapes,), verbose=False,
            )  # fmt: skip
        except Exception as error:  # the exporter's own classes have no common base
            raise InputError(f"PyTorch cannot export the network: {type(error).__name__}", "--debug shows why") from error
    assert program is not None
    return program.model_proto


class _Listed(torch.nn.Module):
    """A module that takes its inputs as a list."""

    def __init__(self, module: torch.nn.Module) -> None:
        super().__init__()
        self.module = module

    def forward(self, given: list[Tensor]) -> Any:
        return self.module(*given)


@contextmanager
def _quiet() -> Iterator[None]:
    """Without what the exporter prints of its progress."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings(), redirect_stdout(StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def _compare(
    name: str, graph: ExportGraph, module: Any, data: bytes, weights: Mapping[str, Array], inputs: Mapping[str, Dims]
) -> None:
    given = _examples(graph, 3, graph.frames + graph.multiple)
    for key, shape in inputs.items():
        if shape[0] == 1:
            given[key] = given[key][:1].expand(3, *given[key].shape[1:]).contiguous()
    wanted = module(*given.values())
    made = open_session(data, weights).run(
        None, {key: given[key][:1].numpy() if inputs[key][0] == 1 else given[key].numpy() for key in given}
    )
    for one, other in zip(made, [wanted] if isinstance(wanted, Tensor) else wanted, strict=True):
        if not np.abs(one - other.numpy()).max(initial=0) <= ERROR * max(1.0, float(other.abs().max())):
            raise InputError(f"the exported graph {name!r} makes something else than the network", "this is a fault of ours")


@torch.no_grad()
def reach_of(net: Any) -> int | None:
    """Frames to either side beyond which speech does not matter to a pose; None: all of a window matters.

    A frame of speech that is no number makes no numbers of whatever hears it.
    """
    net = inference_copy(net)
    step, frames = net.multiple, 4 * max(net.multiple, net.shortest)
    while frames <= FURTHEST:
        middle = frames // 2 // step * step
        rows = torch.zeros(1, frames, net.audio).repeat(step, 1, 1)
        rows[torch.arange(step), middle + torch.arange(step)] = torch.nan
        made = net.make(rows, rows.new_zeros(step, frames, net.styles), rows.new_zeros(step, frames, net.modes))
        heard = made.isnan().any(2)
        if not heard[:, [*range(step), *range(frames - step, frames)]].any():
            rows_of, places = heard.nonzero(as_tuple=True)
            return int((places - middle - rows_of).abs().max())
        frames *= 2
    return None
