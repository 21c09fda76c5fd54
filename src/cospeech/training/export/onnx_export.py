"""Networks as graphs that play without PyTorch, by `torch.onnx.export`.

Each graph is traced with two takes, written anew (`cospeech.training.export.frame_graph`) and compared with PyTorch, for
another number of takes and, where frames may vary, of frames.

Network by windows: ``make`` and, where it recognises styles, ``style``. Network of many inputs: ``make``, and ``classify`` and
``live`` where it has them. `cospeech.models.nn.export.ExportGraph` says what goes in and comes out.
"""

from __future__ import annotations

import gc
import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
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
    """What `cospeech.runtime.network.Network` is made of."""

    signatures: dict[str, Signature]
    weights: dict[str, Array]
    """They lie outside of the graphs."""
    graphs: dict[str, bytes]


@torch.no_grad()
def export_graphs(graphs: Mapping[str, ExportGraph]) -> Exported:
    """Networks, as they evaluate, with their signatures.

    Raises:
        InputError: a network computes what no bundle may hold, or its graph differs from PyTorch.
    """
    _check(graphs)
    exported = Exported({}, {}, {})
    for name, graph in graphs.items():
        exported.graphs[name], state = _export(name, graph, exported.weights)
        exported.signatures[name] = Signature(
            graph.inputs, graph.outputs, state, window=graph.window, look_ahead=graph.look_ahead, multiple=graph.multiple,
            reach=measure_reach(graph) if _has_reach(graph) else None, hop=graph.hop, seeds=graph.seeds, groups=graph.groups,
            steps=graph.steps,
        )  # fmt: skip
        exported.signatures[name].check(name)
    return exported


def _check(graphs: object) -> None:
    """What a network exports is `ExportGraph` by names that players know.

    Raises:
        InputError: it is not.
    """
    if not isinstance(graphs, Mapping) or not all(isinstance(graph, ExportGraph) for graph in graphs.values()):
        raise InputError("export_module() gives something else than ExportGraph by name", "docs/add_a_model.md: export_module")
    if unknown := [name for name in graphs if name not in NETWORKS]:
        raise InputError(f"export_module() gives {unknown[0]!r}", nearest(str(unknown[0]), NETWORKS))


def _has_reach(graph: ExportGraph) -> bool:
    """Whether players ask how far a network hears: one of windows that it does not fix, frame by frame."""
    return bool(graph.window) and graph.hop is None and "rows" in graph.inputs and "heard" not in graph.outputs


def _export(name: str, graph: ExportGraph, weights: dict[str, Array]) -> tuple[bytes, dict[str, Dims]]:
    module = inference_copy(graph.module)
    exported = _trace(name, graph, module)
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
    return data, _states(graph, shared)


def _states(graph: ExportGraph, shared: set[str]) -> dict[str, Dims]:
    return {name: (1 if name in shared else "N", width) for name, width in graph.states.items()}


def _examples(graph: ExportGraph, takes: int, frames: int) -> dict[str, Tensor]:
    """Inputs and states of normal noise, each with all takes."""
    rng = torch.Generator().manual_seed(0)
    shapes = {**graph.inputs, **{name: ("N", width) for name, width in graph.states.items()}}
    sizes = {"N": takes, "T": frames, "S": frames // graph.multiple}
    found = {}
    for name, (first, *rest) in shapes.items():
        own = [size if isinstance(size, int) else sizes[size] for size in rest]
        found[name] = torch.randn(1 if first == 1 else takes, *own, generator=rng).expand(takes, *own).contiguous()
    return found


def _trace(name: str, graph: ExportGraph, module: torch.nn.Module) -> Any:
    """The model as PyTorch exports it."""
    given = _examples(graph, 2, graph.frames)
    takes, steps = torch.export.Dim("N"), torch.export.Dim("T", min=-(-graph.shortest // graph.multiple))
    over_time = {"T": {1: steps * graph.multiple if graph.multiple > 1 else steps}, "S": {1: steps}}
    varies = {} if graph.fixed else over_time
    shapes = [{0: takes} | varies.get(str(graph.inputs.get(each, ("N", ""))[1]), {}) for each in given]
    names = [*graph.outputs, *(f"next.{each}" for each in graph.states)]
    with _quiet(), shorten_exports():
        try:
            program = torch.onnx.export(
                _Listed(module), ([*given.values()],), dynamo=True, input_names=[*given], output_names=names,
                opset_version=OPSET, dynamic_shapes=(shapes,), verbose=False,
            )  # fmt: skip
        except Exception as error:  # the exporter's own classes have no common base
            hint = "docs/add_a_model.md says how a module is called; --debug shows PyTorch's own words"
            raise InputError(f"PyTorch cannot export the network {name!r}: {type(error).__name__}", hint) from error
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


def _compare(
    name: str, graph: ExportGraph, module: Any, data: bytes, weights: Mapping[str, Array], inputs: Mapping[str, Dims]
) -> None:
    given = _examples(graph, 3, graph.frames + (0 if graph.fixed else graph.multiple))
    for key, shape in inputs.items():
        if shape[0] == 1:
            given[key] = given[key][:1].expand(3, *given[key].shape[1:]).contiguous()
    wanted = module(*given.values())
    arrays = {key: given[key][:1].numpy() if inputs[key][0] == 1 else given[key].numpy() for key in given}
    try:
        made = open_session(data, weights).run(None, arrays)
    except Exception as error:  # onnxruntime's own classes have no common base
        raise InputError(f"the exported graph {name!r} does not run", "this is a bug of ours; --debug shows why") from error
    for one, other in zip(made, [wanted] if isinstance(wanted, Tensor) else wanted, strict=True):
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
        given = {name: torch.zeros_like(x) for name, x in _examples(graph, step, frames).items()}
        given["rows"][torch.arange(step), middle + torch.arange(step)] = torch.nan
        made = module(*given.values())
        heard = (made if isinstance(made, Tensor) else made[0]).isnan().any(2)
        if not heard[:, [*range(step), *range(frames - step, frames)]].any():
            rows_of, places = heard.nonzero(as_tuple=True)
            return int((places - middle - rows_of).abs().max())
        frames *= 2
    return None
