"""Shortcuts in PyTorch's exporter, which does some work again and again: they save a third of the time of an export.

The exporter keeps recurrent layers as they are, but each time that it needs their shapes, it compiles a loop over their frames.
For each graph, it parses again the source of every operator that it can translate. The shortcuts replace private functions of
PyTorch. With a version that lacks one of them, an export takes longer.
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
    """Within it, `torch.onnx.export` writes the same graphs in less time."""
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
    """Empty tensors of the shapes that an LSTM returns."""
    return _shape_rows(rows, state[0], bidirectional), *(x.new_empty(x.shape) for x in state)


def _shape_gru(
    rows: Tensor, state: Tensor, _params: Any, _biases: bool, _layers: int, _dropout: float, _trains: bool,
    bidirectional: bool, _batch_first: bool,
) -> tuple[Tensor, ...]:  # fmt: skip
    """Empty tensors of the shapes that a GRU returns."""
    return _shape_rows(rows, state, bidirectional), state.new_empty(state.shape)


def _shape_rows(rows: Tensor, state: Tensor, bidirectional: bool) -> Tensor:
    return rows.new_empty((*rows.shape[:2], state.shape[-1] * (2 if bidirectional else 1)))


_REGISTRIES: dict[int, Any] = {}
"""Version of ONNX's operators → the exporter's registry of them, which stays the same: we add no translations."""


def _read_once(read: Callable[..., Any]) -> Any:
    def find(*, opset_version: int) -> Any:
        if opset_version not in _REGISTRIES:
            _REGISTRIES[opset_version] = read(opset_version=opset_version)
        return _REGISTRIES[opset_version]

    return staticmethod(find)


_LONG: list[tuple[str, str, Callable[[Any], Any]]] = [
    ("torch.export._patches", "lstm_while_loop_impl", lambda _: _shape_lstm),
    ("torch.export._patches", "gru_while_loop_impl", lambda _: _shape_gru),
    ("torch.onnx._internal.exporter._registration:ONNXRegistry", "from_torchlib", _read_once),
]
"""Module (and class of it), name of a function, and what makes its shortcut."""
