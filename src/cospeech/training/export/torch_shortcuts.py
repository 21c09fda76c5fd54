"""What PyTorch's exporter works out again and again, and need not: a third of the time of an export.

It keeps recurrent layers as they are, yet each time that it asks for their shapes it compiles a loop over their frames. For
each graph it parses anew the source of every operator that it can translate. Both have names of its own, which a version may
lack: that one takes its time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib import import_module
from typing import Any

from torch import Tensor

__all__ = ["shorten_exports"]


@contextmanager
def shorten_exports() -> Iterator[None]:
    """`torch.onnx.export` writes the same graphs, sooner."""
    with ExitStack() as stack:
        for place, name, shorten in _LONG:
            module, _, kind = place.partition(":")
            try:
                owner: Any = import_module(module)
                owner = getattr(owner, kind) if kind else owner
                stack.enter_context(_replace(owner, name, shorten(getattr(owner, name))))
            except (ImportError, AttributeError):
                continue
        yield


@contextmanager
def _replace(owner: Any, name: str, value: Any) -> Iterator[None]:
    before = vars(owner)[name]
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)


def _shape_lstm(
    rows: Tensor, state: Sequence[Tensor], _params: Any, _biases: bool, _layers: int, _dropout: float, _trains: bool,
    bidirectional: bool, _batch_first: bool,
) -> tuple[Tensor, ...]:  # fmt: skip
    """Of the shapes that an LSTM makes."""
    return _shape_rows(rows, state[0], bidirectional), *(x.new_empty(x.shape) for x in state)


def _shape_gru(
    rows: Tensor, state: Tensor, _params: Any, _biases: bool, _layers: int, _dropout: float, _trains: bool,
    bidirectional: bool, _batch_first: bool,
) -> tuple[Tensor, ...]:  # fmt: skip
    """Of the shapes that a GRU makes."""
    return _shape_rows(rows, state, bidirectional), state.new_empty(state.shape)


def _shape_rows(rows: Tensor, state: Tensor, bidirectional: bool) -> Tensor:
    return rows.new_empty((*rows.shape[:2], state.shape[-1] * (2 if bidirectional else 1)))


_KNOWN: dict[int, Any] = {}
"""Version of ONNX's operators → the exporter's registry of them, which nobody changes: we bring no translations."""


def _read_once(read: Callable[..., Any]) -> Any:
    def find(*, opset_version: int) -> Any:
        if opset_version not in _KNOWN:
            _KNOWN[opset_version] = read(opset_version=opset_version)
        return _KNOWN[opset_version]

    return staticmethod(find)


_LONG: list[tuple[str, str, Callable[[Any], Any]]] = [
    ("torch.export._patches", "lstm_while_loop_impl", lambda _: _shape_lstm),
    ("torch.export._patches", "gru_while_loop_impl", lambda _: _shape_gru),
    ("torch.onnx._internal.exporter._registration:ONNXRegistry", "from_torchlib", _read_once),
]
"""Module, with a class of it, and name → what stands for it."""
