"""Graphs of ours in onnxruntime, on one core; what the engines share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import InputError
from ..motion.rotations import Array
from .graph_check import check_onnx

__all__ = ["explain_failure", "open_session", "run_session"]

_HINT = "is the bundle damaged?"


def open_session(graph: bytes, weights: Mapping[str, Array]) -> Any:
    """An onnxruntime session on one core, its weights handed over by name.

    Raises:
        InputError: the graph is not one of ours, or the weights do not fit it.
    """
    import onnxruntime as ort

    ort.disable_telemetry_events()  # for a program that has imported onnxruntime before cospeech and its NO_TELEMETRY
    wanted = check_onnx(graph)
    for name, (kind, shape) in wanted.items():
        if name not in weights or weights[name].dtype != kind or weights[name].shape != shape:
            raise InputError(f"no weights {name!r} of {kind} {shape} for a graph"[:200], _HINT)
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4  # what goes wrong is told by the error
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_external_initializers(list(wanted), [ort.OrtValue.ortvalue_from_numpy(weights[name]) for name in wanted])
    try:  # without its fallback, which prints, and without options that a graph names
        return ort.InferenceSession(
            graph, options, providers=["CPUExecutionProvider"], enable_fallback=0, read_config_from_model=0
        )
    except Exception as error:  # onnxruntime raises classes of its own that have no common base
        raise InputError("a graph does not fit together", _HINT) from error


def run_session(session: Any, feed: Mapping[str, Array]) -> list[Array]:
    """Outputs for inputs.

    Raises:
        InputError: it fails, as only a graph of somebody else's does.
    """
    try:
        made: list[Array] = session.run(None, feed)
    except Exception as error:  # as where a session is opened
        raise explain_failure() from error
    return made


def explain_failure() -> InputError:
    """What to raise from an error of onnxruntime; its own words are for ``--debug``."""
    return InputError("a graph fails while it runs", _HINT)
