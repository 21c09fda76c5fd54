"""Exports of networks, each made once in a run of the tests: PyTorch takes seconds for a graph.

The key of an export is what it depends on: the modules, their settings and weights, names and shapes. Files in the folder of
the run serve all workers.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Mapping
from dataclasses import is_dataclass, replace
from pathlib import Path

from torch import nn

from cospeech.models.nn.export import ExportGraph
from cospeech.training.export import exported_model, onnx_export
from cospeech.training.export.onnx_export import Exported

__all__ = ["FOLDER", "export_graphs", "share_exports"]

FOLDER = "COSPEECH_TEST_EXPORTS"
"""Environment variable: the folder of this run of the tests."""


def export_graphs(graphs: Mapping[str, ExportGraph]) -> Exported:
    """As `cospeech.training.export.onnx_export.export_graphs`; what was exported before is read."""
    key = hashlib.sha256()
    for name, graph in graphs.items():
        key.update(repr((name, replace(graph, module=nn.Identity()))).encode())
        for part in graph.module.modules():
            own = {each: value for each, value in vars(part).items() if not each.startswith("_")}
            key.update(repr((type(part).__qualname__, [(each, own[each]) for each in own if _is_plain(own[each])])).encode())
        for tensor in graph.module.state_dict().values():
            key.update(tensor.contiguous().numpy().tobytes())
    file = Path(os.environ[FOLDER]) / key.hexdigest()
    if file.exists():
        export: Exported = pickle.loads(file.read_bytes())
        return export
    export = onnx_export.export_graphs(graphs)
    own = file.with_suffix(f".{os.getpid()}")
    own.write_bytes(pickle.dumps(export))
    own.replace(file)
    return export


def _is_plain(value: object) -> bool:
    return is_dataclass(value) or isinstance(value, bool | int | float | str | tuple | list | None)


def share_exports() -> None:
    """Let the code that bundles a run share exports too, in this process."""
    exported_model.export_graphs = export_graphs  # type: ignore[attr-defined]
