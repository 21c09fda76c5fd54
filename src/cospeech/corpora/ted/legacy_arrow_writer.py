"""Writing the container of ``pyarrow.serialize`` (see `cospeech.corpora.ted.legacy_arrow`) with today's pyarrow."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ...errors import InputError
from .legacy_arrow import ALIGN, load_pyarrow

__all__ = ["encode"]

_INT64 = 1 << 63


class _Array(int):
    """The number of a numpy array among the tensors, while columns are built."""


def encode(value: object) -> bytes:
    """A payload as ``pyarrow.serialize(value).to_buffer()`` made it (pyarrow 0.15 … 14).

    Raises:
        InputError: a value that the container holds only pickled: boolean, text and object arrays, other classes.
    """
    pa = load_pyarrow()
    arrays: list[np.ndarray] = []
    plain = _plain(value, arrays, "")
    batch = pa.record_batch([_union(pa, [plain])], names=["list"])
    sink = pa.BufferOutputStream()
    sink.write(struct.pack("<4i", 0, 0, len(arrays), 0))
    with pa.ipc.new_stream(sink, batch.schema) as stream:
        stream.write_batch(batch)
    for array in arrays:
        sink.write(bytes(-sink.tell() % ALIGN))
        pa.ipc.write_tensor(pa.Tensor.from_numpy(array), sink)
    return sink.getvalue().to_pybytes()


def _plain(value: object, arrays: list[np.ndarray], where: str) -> object:
    """Numpy arrays replaced by their number, numpy scalars by Python's, in the order in which pyarrow met them."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "iuf" or value.dtype.itemsize > 8:
            raise InputError(f"an array of {value.dtype} at {where or 'the top'}", "the container holds plain numbers only")
        arrays.append(np.ascontiguousarray(value).reshape(value.shape))
        return _Array(len(arrays) - 1)
    if isinstance(value, dict):
        return {key: _plain(item, arrays, f"{where}[{key!r}]") for key, item in value.items()}
    if isinstance(value, (list, tuple, set)):
        return type(value)(_plain(item, arrays, f"{where}[{k}]") for k, item in enumerate(value))
    if isinstance(value, np.generic) and value.dtype.kind in "biu":
        value = value.item()
    if isinstance(value, int) and not -_INT64 <= value < _INT64:
        raise InputError(f"the integer {value} at {where or 'the top'}", "the container holds 64 bits")
    if value is None or isinstance(value, (bool, int, float, str, bytes, np.float16, np.float32)):
        return value
    raise InputError(f"a {type(value).__name__} at {where or 'the top'}", "the container holds plain values only")


def _kind(value: object) -> int:
    kinds: tuple[tuple[type, int], ...] = (
        (bool, 1), (_Array, 15), (int, 2), (bytes, 4), (str, 5), (np.float16, 6), (np.float32, 7), (float, 8),
        (list, 10), (dict, 11), (tuple, 12), (set, 13),
    )  # fmt: skip
    return 0 if value is None else next(number for kind, number in kinds if isinstance(value, kind))


def _union(pa: Any, values: Iterable[object]) -> Any:
    """A dense union; its children stand in the order of first use, behind the one for None."""
    groups: dict[int, list[Any]] = {0: []}
    codes, offsets = [], []
    for value in values:
        kind = _kind(value)
        group = groups.setdefault(kind, [])
        codes.append(list(groups).index(kind))
        offsets.append(len(group))
        group.append(value)
    simple: dict[int, Callable[[], Any]] = {
        0: pa.null, 1: pa.bool_, 2: pa.int64, 4: pa.binary, 5: pa.string,
        6: pa.float16, 7: pa.float32, 8: pa.float64, 15: pa.int32,
    }  # fmt: skip
    children = [
        pa.array(group, simple[kind]()) if kind in simple else _lists(pa, group, kind) for kind, group in groups.items()
    ]
    places = pa.array(codes, pa.int8()), pa.array(offsets, pa.int32())
    return pa.UnionArray.from_dense(*places, children, [str(kind) for kind in groups], list(range(len(groups))))


def _lists(pa: Any, groups: list[Any], kind: int) -> Any:
    """Lists, tuples, sets, or dicts as lists of {keys, vals}; one array for all of a column."""
    starts = pa.array(np.cumsum([0, *(len(group) for group in groups)]), pa.int32())
    if kind != 11:
        return pa.ListArray.from_arrays(starts, _union(pa, [item for group in groups for item in group]))
    keys = _union(pa, [key for group in groups for key in group])
    values = _union(pa, [item for group in groups for item in group.values()])
    return pa.ListArray.from_arrays(starts, pa.StructArray.from_arrays([keys, values], ["keys", "vals"]))
