"""Networks as graphs that play without PyTorch, by `torch.onnx.export`.

Each graph is traced with two takes, rewritten (`cospeech.training.export.frame_graph`) and compared with PyTorch: with another
number of takes and, where frames may vary, of frames.

A network by windows has the graphs ``make`` and, where it recognises styles, ``style``. A network of many inputs has ``make``,
and some have ``classify`` and ``live``. `cospeech.models.nn.export.ExportGraph` describes their inputs and outputs.
"""

from __future__ import annotations

import gc
import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from copy import deepcopy
from io import StringIO
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from ...errors import InputError, nearest
from ...models.nn.export import ExportGraph, inference_copy
from ...motion.rotations import Array
from ...runtime.bundles.signature import NETWORKS, Signature
from ...runtime.network import open_session
from .frame_graph import Dims, FrameGraph
from .torch_shortcuts import shorten_exports

__all__ = ["Exported", "export_graphs"]

OPSET = 21  # of onnxruntime 1.20 and later
ERROR = 1e-4  # ours: of poses of about 1, float32; more is a fault of the export
FURTHEST = 1 << 11  # frames; ours: a network that hears further hears all of a window


class Exported(NamedTuple):
    """The parts of a `cospeech.runtime.network.Network`."""

    signatures: dict[str, Signature]
    weights: dict[str, Array]
    """They lie outside of the graphs."""
    graphs: dict[str, bytes]


@torch.no_grad()
def export_graphs(graphs: Mapping[str, ExportGraph]) -> Exported:
    """Export networks in evaluation mode, with their signatures.

    Raises:
        InputError: a network computes what no bundle may hold, or its graph differs from PyTorch.
    """
    _check(graphs)
    export = Exported({}, {}, {})
    for name, graph in graphs.items():
        export.graphs[name], state = _export(name, graph, export.weights)
        export.signatures[name] = Signature(
            graph.inputs, graph.outputs, state, window=graph.window, look_ahead=graph.look_ahead, multiple=graph.multiple,
            reach=measure_reach(graph) if _has_reach(graph) else None, hop=graph.hop, seeds=graph.seeds, groups=graph.groups,
            steps=graph.steps, normal_noise=graph.normal_noise,
        )  # fmt: skip
        export.signatures[name].check(name)
    return export


def _check(graphs: object) -> None:
    """Check that a network exports `ExportGraph` by names that players know.

    Raises:
        InputError: it exports something else.
    """
    if not isinstance(graphs, Mapping) or not all(isinstance(graph, ExportGraph) for graph in graphs.values()):
        raise InputError("export_module() gives something else than ExportGraph by name", "docs/add_a_model.md: export_module")
    if unknown := [name for name in graphs if name not in NETWORKS]:
        raise InputError(f"export_module() gives {unknown[0]!r}", nearest(str(unknown[0]), NETWORKS))


def _has_reach(graph: ExportGraph) -> bool:
    """Whether players need to know how far a network hears: it plays windows, without a hop of its own, from rows of speech."""
    return bool(graph.window) and graph.hop is None and "rows" in graph.inputs and "heard" not in graph.outputs


def _export(name: str, graph: ExportGraph, weights: dict[str, Array]) -> tuple[bytes, dict[str, Dims]]:
    module = inference_copy(graph.module)
    model = _trace(name, graph, module)
    common = {*graph.states}
    while True:  # until all states that are assumed to be the same for all takes are so
        inputs: dict[str, Dims] = {**graph.inputs, **_states(graph, common)}
        after = {f"next.{key}": shape for key, shape in _states(graph, common).items()}
        outputs: dict[str, Dims] = {**graph.outputs, **after}
        store = dict(weights)
        writer = FrameGraph(model, inputs, store, name)
        alike = writer.write(outputs)
        if all(f"next.{key}" in alike for key in common):
            break
        common = {key for key in common if f"next.{key}" in alike}
    data = writer.file(name, inputs, outputs)
    _compare(name, graph, data, store, inputs)
    weights |= {key: value for key, value in store.items() if key in writer.used}
    return data, _states(graph, common)


def _states(graph: ExportGraph, common: set[str]) -> dict[str, Dims]:
    return {name: (1 if name in common else "N", width) for name, width in graph.states.items()}


def _examples(graph: ExportGraph, takes: int, frames: int) -> dict[str, Tensor]:
    """Inputs and states of normal noise, each with all takes."""
    rng = torch.Generator().manual_seed(0)
    shapes = {**graph.inputs, **{name: ("N", width) for name, width in graph.states.items()}}
    sizes = {"N": takes, "T": frames, "S": frames // graph.multiple}
    examples = {}
    for name, (first, *rest) in shapes.items():
        own = [size if isinstance(size, int) else sizes[size] for size in rest]
        examples[name] = torch.randn(1 if first == 1 else takes, *own, generator=rng).expand(takes, *own).contiguous()
    return examples


def _trace(name: str, graph: ExportGraph, module: torch.nn.Module) -> Any:
    """The model as PyTorch exports it."""
    inputs = _examples(graph, 2, graph.frames)
    takes, steps = torch.export.Dim("N"), torch.export.Dim("T", min=-(-graph.shortest // graph.multiple))
    over_time = {"T": {1: steps * graph.multiple if graph.multiple > 1 else steps}, "S": {1: steps}}
    varies = {} if graph.fixed else over_time
    shapes = [{0: takes} | varies.get(str(graph.inputs.get(each, ("N", ""))[1]), {}) for each in inputs]
    names = [*graph.outputs, *(f"next.{each}" for each in graph.states)]
    with _quiet(), shorten_exports():
        try:
            program = torch.onnx.export(
                _ListInput(module), ([*inputs.values()],), dynamo=True, input_names=[*inputs], output_names=names,
                opset_version=OPSET, dynamic_shapes=(shapes,), verbose=False,
            )  # fmt: skip
        except Exception as error:  # the exporter's own classes have no common base
            hint = "docs/add_a_model.md says how a module is called; --debug shows PyTorch's own words"
            raise InputError(f"PyTorch cannot export the network {name!r}: {type(error).__name__}", hint) from error
    assert program is not None
    return program.model_proto


class _ListInput(torch.nn.Module):
    """A module that takes its inputs as a list."""

    def __init__(self, module: torch.nn.Module) -> None:
        super().__init__()
        self.module = module

    def forward(self, inputs: list[Tensor]) -> Any:
        return self.module(*inputs)


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence the exporter's progress messages, and let Python's collector wait: it takes a fifth of the time of a trace."""
    before, collects = logging.root.manager.disable, gc.isenabled()
    logging.disable(logging.WARNING)
    gc.disable()
    try:
        with warnings.catch_warnings(), redirect_stdout(StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)
        if collects:
            gc.enable()


def _compare(name: str, graph: ExportGraph, data: bytes, weights: Mapping[str, Array], inputs: Mapping[str, Dims]) -> None:
    tensors = _examples(graph, 3, graph.frames + (0 if graph.fixed else graph.multiple))
    for key, shape in inputs.items():
        if shape[0] == 1:
            tensors[key] = tensors[key][:1].expand(3, *tensors[key].shape[1:]).contiguous()
    target = deepcopy(graph.module).eval()(*tensors.values())  # not of the copy for inference: its folds are compared too
    arrays = {key: tensors[key][:1].numpy() if inputs[key][0] == 1 else tensors[key].numpy() for key in tensors}
    try:
        outputs = open_session(data, weights).run(None, arrays)
    except Exception as error:  # onnxruntime's own classes have no common base
        raise InputError(f"the exported graph {name!r} does not run", "this is a bug of ours; --debug shows why") from error
    for one, other in zip(outputs, [target] if isinstance(target, Tensor) else target, strict=True):
        if not np.abs(one - other.numpy()).max(initial=0) <= ERROR * max(1.0, float(other.abs().max())):
            raise InputError(f"the exported graph {name!r} gives other numbers than the network", "this is a bug of ours")


@torch.no_grad()
def measure_reach(graph: ExportGraph) -> int | None:
    """Frames to either side beyond which speech does not matter to a frame; None: all of a window matters.

    A frame of speech is set to NaN: every frame that depends on it becomes NaN.
    """
    module, step = inference_copy(graph.module), graph.multiple
    frames = 4 * graph.frames
    while frames <= FURTHEST:
        middle = frames // 2 // step * step
        inputs = {name: torch.zeros_like(x) for name, x in _examples(graph, step, frames).items()}
        inputs["rows"][torch.arange(step), middle + torch.arange(step)] = torch.nan
        outputs = module(*inputs.values())
        depends = (outputs if isinstance(outputs, Tensor) else outputs[0]).isnan().any(2)
        if not depends[:, [*range(step), *range(frames - step, frames)]].any():
            rows_of, places = depends.nonzero(as_tuple=True)
            return int((places - middle - rows_of).abs().max())
        frames *= 2
    return None
