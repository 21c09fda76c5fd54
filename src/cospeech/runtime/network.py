"""Runs one network of a bundle: NumPy and onnxruntime, on one core.

The signature is checked against the graph once, when the network is opened, and every array against the signature whenever it
runs. Inputs are finite and within limits, outputs are finite and bounded, whoever made the network.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from .bundles.graph_check import check_onnx
from .bundles.signature import Port, Signature

__all__ = ["LIMIT", "Network", "explain_failure", "open_session", "run_session"]

LIMIT = 1e3
"""Ours: standardised speech, weights of styles and noise come nowhere near; keeps what is absurd out of a network."""
_HINT = "is the bundle damaged?"


class Network:
    """A network ready to run; any number of sessions may share it.

    Args:
        signature: what it takes and gives.
        graph: ONNX.
        weights: of the graph, by name, float32; others are ignored.
        bounds: output → (least, greatest) numbers; ± `LIMIT` where not given. What is no number comes out as 0.

    Raises:
        InputError: these do not fit together, or the graph fails.
    """

    def __init__(
        self,
        signature: Signature,
        graph: bytes,
        weights: Mapping[str, Array],
        bounds: Mapping[str, tuple[Array, Array]] | None = None,
    ) -> None:
        self.signature, self._session = signature, open_session(graph, weights)
        self._inputs: dict[str, Port] = {**signature.inputs, **signature.state}
        after = {f"next.{name}": port for name, port in signature.state.items()}
        self._outputs: dict[str, Port] = {**signature.outputs, **after}
        ends = {name: (bounds or {}).get(name, (-LIMIT, LIMIT)) for name in signature.outputs}
        self._bounds = {name: (np.asarray(low, np.float32), np.asarray(high, np.float32)) for name, (low, high) in ends.items()}
        _check_ends(self._session.get_inputs(), self._inputs)
        _check_ends(self._session.get_outputs(), self._outputs)
        self._free = len({size for port in self._inputs.values() for size in port if isinstance(size, str)})
        self._last: Any = (0, 0), ({}, {})
        self._names = [end.name for end in self._session.get_outputs()]
        sizes = {"N": 2, "T": signature.probe, "S": signature.probe // signature.multiple}
        self.run(**{name: np.zeros(_shape(port, sizes), np.float32) for name, port in self._inputs.items()})

    def begin(self, takes: int) -> dict[str, Array]:
        """The state before the first frame of so many takes."""
        return {name: np.zeros(_shape(port, {"N": takes}), np.float32) for name, port in self.signature.state.items()}

    def run(self, **arrays: Array) -> dict[str, Array]:
        """Outputs, and the next state, by name.

        Args:
            arrays: inputs and state by name; one that is left out is zeros.

        Raises:
            InputError: another name or shape, or frames that are no multiple of the network's.
        """
        sizes = self._sizes(arrays)
        frames = sizes.get("T", sizes.get("S", 1) * self.signature.multiple)
        inputs, outputs = self._shapes(sizes.get("N", 1), frames)
        if not (all(np.shape(array) == inputs.get(name) for name, array in arrays.items()) and sizes.get("N", 1) and frames):
            shapes = {name: np.shape(array) for name, array in arrays.items()}
            raise InputError(f"a network was given {shapes}"[:200], f"it takes {self._inputs}"[:200])
        if frames % self.signature.multiple and "T" in sizes:
            raise InputError(f"a network was given {frames} frames", f"a multiple of {self.signature.multiple}")
        sane = {name: array if name in self.signature.state else _sane(array) for name, array in arrays.items()}
        for name in self._inputs.keys() - arrays.keys():
            sane[name] = np.zeros(inputs[name], np.float32)
        results = dict(zip(self._names, run_session(self._session, sane), strict=True))
        for name, array in results.items():
            if array.shape != outputs[name]:
                raise InputError(f"a graph gave {name!r} the shape {array.shape}"[:200], _HINT)
        return results | {name: _clip_output(results[name], *ends) for name, ends in self._bounds.items()}

    def _sizes(self, arrays: Mapping[str, Array]) -> dict[str, int]:
        """N, and T or S, of the first of these arrays that has them."""
        sizes: dict[str, int] = {}
        for name, array in arrays.items():
            for size, length in zip(self._inputs.get(name, ()), np.shape(array), strict=False):
                if isinstance(size, str):
                    sizes.setdefault(size, length)
            if len(sizes) == self._free:
                break
        return sizes

    def _shapes(self, takes: int, frames: int) -> tuple[dict[str, tuple[int, ...]], dict[str, tuple[int, ...]]]:
        """Shapes of inputs and outputs; those of the last call are kept."""
        last = self._last  # sessions of several threads may share a network
        if last[0] != (takes, frames):
            sizes = {"N": takes, "T": frames, "S": frames // self.signature.multiple}
            shapes = [{name: _shape(port, sizes) for name, port in ports.items()} for ports in (self._inputs, self._outputs)]
            last = self._last = (takes, frames), (shapes[0], shapes[1])
        return last[1]  # type: ignore[no-any-return]


def _check_ends(ends: Any, due: Mapping[str, Port]) -> None:
    """Inputs or outputs of a graph have the names, types and shapes that are due."""
    for end in ends:
        port = due.get(end.name, ())
        fits = len(end.shape) == len(port) and all(
            isinstance(size, str) or size == actual for size, actual in zip(port, end.shape, strict=False)
        )
        if not fits or end.type != "tensor(float)":
            raise InputError(f"{end.name!r} of a graph is {end.type} of shape {end.shape}"[:200], _HINT)
    if len(ends) != len(due):
        raise InputError(f"a graph has {len(ends)} inputs or outputs, expected {len(due)}", _HINT)


def _shape(port: Port, sizes: Mapping[str, int]) -> tuple[int, ...]:
    return tuple(sizes[size] if isinstance(size, str) else size for size in port)


def _sane(values: Array) -> Array:
    """Float32 within the limits. The two ufuncs take a third of the time of `numpy.clip` over a frame."""
    return np.ascontiguousarray(np.minimum(np.maximum(values, -LIMIT), LIMIT), np.float32)


def _clip_output(values: Array, low: Any, high: Any) -> Array:
    """Bound the outputs of any network: infinities become the bounds, NaN becomes 0."""
    result: Array = np.minimum(np.maximum(values, low), high)
    if np.isnan(result).any():
        result = np.minimum(np.maximum(np.where(np.isnan(result), np.float32(0), result), low), high)
    return result


def open_session(graph: bytes, weights: Mapping[str, Array]) -> Any:
    """An onnxruntime session on one core, its weights handed over by name.

    Raises:
        InputError: the graph is not one of ours, or the weights do not fit it.
    """
    import onnxruntime as ort

    ort.disable_telemetry_events()  # for a program that has imported onnxruntime before cospeech and its NO_TELEMETRY
    externals = check_onnx(graph)
    for name, (kind, shape) in externals.items():
        if name not in weights or weights[name].dtype != kind or weights[name].shape != shape:
            raise InputError(f"a graph needs weights {name!r}, {kind} of shape {shape}"[:200], _HINT)
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4  # what goes wrong is told by the error
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_external_initializers(list(externals), [ort.OrtValue.ortvalue_from_numpy(weights[name]) for name in externals])
    try:  # without its fallback, which prints, and without options that a graph names
        session = ort.InferenceSession(
            graph, options, providers=["CPUExecutionProvider"], enable_fallback=0, read_config_from_model=0
        )
        for end in (*session.get_inputs(), *session.get_outputs()):
            _ = end.name, end.shape  # only here are they decoded
    except UnicodeDecodeError as error:
        raise InputError("a graph has a name that is no text", _HINT) from error
    except Exception as error:  # onnxruntime raises classes of its own that have no common base
        hint = "is the bundle damaged, or was it made for a newer one?"
        raise InputError(f"onnxruntime {ort.__version__} cannot open a graph", hint) from error
    return session


def run_session(session: Any, inputs: Mapping[str, Array]) -> list[Array]:
    """Outputs for inputs.

    Raises:
        InputError: it fails; our own graphs do not.
    """
    try:
        outputs: list[Array] = session.run(None, inputs)
    except Exception as error:  # as where a session is opened
        raise explain_failure() from error
    return outputs


def explain_failure() -> InputError:
    """The error to raise from one of onnxruntime, whose own text is for ``--debug``."""
    return InputError("onnxruntime cannot run a graph", _HINT)
