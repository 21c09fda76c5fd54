"""The container of ``pyarrow.serialize`` (gone from pyarrow since 2023), read with today's pyarrow, without pickle.

    int32 × 4     sparse tensors are counted too: tensors, sparse tensors, numpy arrays, buffers
    Arrow IPC     one record batch, one column `list` of one row: a dense union
    tensors       one Arrow tensor message per numpy array, each at a multiple of 64 bytes

A value of the union lies in the child whose *name* is the number of its Python type (`KINDS`); a dict is a list of structs
{keys, vals}, an array is its number among the tensors. Anything else was pickled into a dict with the key ``_pytype_``: such
payloads are refused. pyarrow before 0.15 framed the stream without the marker 0xffffffff and wrote three counts (tensors,
arrays, buffers) and four bytes of padding; the reader takes both forms, the older one tried on an imitation only.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np

from ...errors import InputError, describe_extra

__all__ = ["ALIGN", "HEADER", "KINDS", "PickledContent", "decode", "load_pyarrow"]

KINDS = {
    0: "none", 1: "bool", 2: "int", 4: "bytes", 5: "str", 6: "float16", 7: "float32", 8: "float64",
    10: "list", 11: "dict", 12: "tuple", 13: "set", 15: "array",
}  # fmt: skip
"""Numbers of Arrow's ``PythonType`` that hold plain values; 14 (tensor) and 16 … (buffers, sparse tensors) do not occur."""

HEADER = 16  # bytes
ALIGN = 64  # bytes; of tensors
_MOST_ARRAYS = 100_000  # ours: a video has three per clip
_DEEPEST = 32  # ours: nested containers; the corpora have seven
_MARKER = "_pytype_"  # key under which pyarrow kept what it could not express


class PickledContent(InputError):
    """A payload that could be loaded only by running what is in it."""


def decode(data: bytes) -> object:
    """The Python value of a payload: None, bool, int, float, str, bytes, list, tuple, set, dict and numpy arrays of numbers.

    Raises:
        InputError: not such a payload, or damaged; the message names the place inside the value.
        PickledContent: (an InputError) it holds objects, boolean or text arrays.
    """
    pa = load_pyarrow()
    if len(data) < HEADER + 8:
        raise InputError(f"{len(data)} bytes where a pyarrow payload belongs", "is it cut short?")
    counts = struct.unpack_from("<4i", data)
    arrays = counts[2] or counts[1]  # before pyarrow 0.15 the second of three
    if not 0 <= arrays <= _MOST_ARRAYS or sum(map(abs, counts)) != arrays:
        raise InputError(f"a payload with the counts {counts}", "only numpy arrays can be beside it")
    try:
        source = pa.BufferReader(data)
        source.seek(HEADER)
        batch = pa.ipc.open_stream(source).read_next_batch()
        batch.validate(full=True)
        if batch.num_columns != 1 or batch.num_rows != 1:
            raise InputError(f"a payload of {batch.num_rows} rows and {batch.num_columns} columns", "one of each is right")
        end = source.tell()
        if data[end : end + 8] == b"\xff\xff\xff\xff\0\0\0\0":
            end += 8
        elif data[end : end + 4] == b"\0\0\0\0":  # before pyarrow 0.15
            end += 4
        tensors = _tensors(pa, source, end, arrays, len(data))
        value = _Reader(pa, tensors, len(data)).union(batch.column(0), 0, "", 0)
    except InputError:
        raise
    except (pa.ArrowException, LookupError, ValueError, TypeError, OverflowError, OSError, StopIteration, MemoryError) as error:
        reason = " ".join((str(error) or type(error).__name__).split())[:120]
        raise InputError(f"a damaged pyarrow payload: {reason}", "was the file copied whole?") from None
    return value


def load_pyarrow() -> Any:
    """The module, or an `InputError` that says how to get it."""
    try:
        import pyarrow
        import pyarrow.ipc
    except ImportError:
        raise InputError("reading and writing TED's files needs pyarrow", describe_extra("corpora")) from None
    return pyarrow


def _tensors(pa: Any, source: Any, at: int, count: int, size: int) -> list[np.ndarray]:
    arrays = []
    for number in range(count):
        at += -at % ALIGN
        if at >= size:
            raise InputError(f"a payload of {size} bytes ends before array {number} of {count}", "is it cut short?")
        source.seek(at)
        tensor = pa.ipc.read_tensor(source)
        if not (pa.types.is_integer(tensor.type) or pa.types.is_floating(tensor.type)):
            raise InputError(f"array {number} of a payload has the type {tensor.type}", "numbers are right")
        end = source.tell()
        if not at < end <= size or tensor.size * tensor.type.bit_width // 8 > size:
            raise InputError(f"array {number} of a payload is larger than the payload", "is it damaged?")
        if not tensor.is_contiguous and tensor.size:
            steps = sum(abs(step) * (n - 1) for step, n in zip(tensor.strides, tensor.shape, strict=True))
            if min(tensor.strides) < 0 or steps >= end - at:
                raise InputError(f"array {number} of a payload has the strides {tensor.strides}", "is it damaged?")
        arrays.append(np.array(tensor.to_numpy(), order="C"))
        at = end
    return arrays


class _Reader:
    """Values out of nested unions; `where` is the place inside the value, for messages."""

    def __init__(self, pa: Any, arrays: list[np.ndarray], most: int) -> None:
        self.types, self.arrays, self.budget = pa.types, arrays, most  # every value takes a byte at least

    def union(self, column: Any, row: int, where: str, depth: int) -> object:
        self.budget -= 1
        if depth > _DEEPEST or self.budget < 0:
            raise InputError(f"a payload nested too deep at {where[:60] or 'its top'}", "is it damaged?")
        if not (self.types.is_union(column.type) and column.type.mode == "dense"):
            raise InputError(f"a payload with {str(column.type)[:30]} for a union at {where[:60] or 'its top'}")
        code = column.type_codes[row].as_py()
        number = column.type.type_codes.index(code)
        name = column.type.field(number).name
        kind = KINDS.get(int(name) if name.isdecimal() else -1)
        if kind is None:
            raise InputError(f"a payload with a value of the unknown type {name[:20]!r} at {where or 'its top'}")
        child, at = column.field(number), column.offsets[row].as_py()
        if kind in ("list", "tuple", "set", "dict") and not self.types.is_list(child.type):
            raise InputError(f"a payload with {str(child.type)[:30]} for a {kind} at {where[:60] or 'its top'}")
        if kind in ("list", "tuple", "set"):
            values = [self.union(child.values, k, f"{where}[{i}]", depth + 1) for i, k in enumerate(self.span(child, at))]
            return {"list": list, "tuple": tuple, "set": set}[kind](values)
        if kind == "dict":
            return self.dictionary(child, at, where, depth)
        value = child[at].as_py()
        if kind == "array":
            if not isinstance(value, int) or not 0 <= value < len(self.arrays):
                raise InputError(f"a payload that names array {value} of {len(self.arrays)} at {where or 'its top'}")
            return self.arrays[value]
        return value

    def span(self, child: Any, at: int) -> range:
        first, last = child.offsets[at].as_py(), child.offsets[at + 1].as_py()
        return range(first, last)

    def dictionary(self, child: Any, at: int, where: str, depth: int) -> dict[object, object]:
        if not self.types.is_struct(child.values.type):
            raise InputError(f"a payload with {str(child.values.type)[:30]} for a dict at {where[:60] or 'its top'}")
        keys, values = child.values.field("keys"), child.values.field("vals")
        rows = self.span(child, at)
        names = [self.union(keys, k, f"{where} key", depth + 1) for k in rows]
        if _MARKER in names:
            kind = self.union(values, rows[names.index(_MARKER)], where, depth + 1)
            problem = f"pickled content ({str(kind)[:40]}) at {where or 'the top'}"
            raise PickledContent(problem, "it is never loaded; save it again as plain numbers")
        if len(set(names)) != len(names):
            raise InputError(f"a payload with a key twice at {where or 'its top'}", "is it damaged?")
        pairs = zip(names, rows, strict=True)
        return {name: self.union(values, k, f"{where}[{name!r}]", depth + 1) for name, k in pairs}
