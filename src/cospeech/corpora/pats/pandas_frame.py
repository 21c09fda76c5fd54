"""Small tables that pandas kept in HDF5 (``DataFrame.to_hdf``), read without pandas, PyTables or pickle.

pandas has two formats. *Fixed* (its default): a block per column type, ``block0_items`` and ``block0_values``; columns of text
are one pickled array. *Table*: one compound data set ``table`` with a field per block, the names of whose columns stand in a
pickled list in an attribute. Both pickles are taken apart with the standard library's ``pickletools.genops``, which splits
instructions and runs none; what follows them here knows lists, tuples, text and numbers, and calls nothing.
"""

from __future__ import annotations

import math
import pickletools
from typing import Any

import numpy as np

from ...errors import InputError
from ..hdf5_lmdb import Dataset

__all__ = ["read_frame", "unpack"]

_MOST = 100_000  # ours: instructions of one pickle; an interval has some hundred words
_LITERALS = {
    "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8", "UNICODE", "BINSTRING", "SHORT_BINSTRING", "STRING", "BINBYTES",
    "SHORT_BINBYTES", "INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "BINFLOAT", "FLOAT",
}  # fmt: skip
_CONSTANTS = {"NONE": None, "NEWTRUE": True, "NEWFALSE": False}
_MARK, _OPAQUE = object(), object()  # a mark; the result of any call or look-up, which is not made


def unpack(data: bytes) -> tuple[object, object]:
    """The content of a pickle of plain containers: the value itself, and the last state that an object would have got.

    Raises:
        InputError: damaged, or with instructions that plain tables do not need.
    """
    stack: list[Any] = []
    memo: dict[int, Any] = {}
    state: object = None
    try:
        for count, (code, argument, _) in enumerate(pickletools.genops(data)):
            if count > _MOST:
                raise InputError(f"a table of more than {_MOST} parts", "is it damaged?")
            if code.name == "BUILD":
                state = stack.pop()
            elif code.name not in ("PROTO", "FRAME", "STOP"):
                _step(code.name, argument, stack, memo)
        return stack[-1], state
    except InputError:
        raise
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError, MemoryError) as error:
        raise InputError(f"a damaged table: {str(error)[:80]}", "was the file copied whole?") from None


def _step(name: str, argument: Any, stack: list[Any], memo: dict[int, Any]) -> None:
    if name in _LITERALS:
        stack.append(argument)
    elif name in _CONSTANTS:
        stack.append(_CONSTANTS[name])
    elif name == "MARK":
        stack.append(_MARK)
    elif name == "MEMOIZE":
        memo[len(memo)] = stack[-1]
    elif name in ("PUT", "BINPUT", "LONG_BINPUT"):
        memo[argument] = stack[-1]
    elif name in ("GET", "BINGET", "LONG_BINGET"):
        stack.append(memo[argument])
    elif name in ("EMPTY_LIST", "EMPTY_TUPLE"):
        stack.append([] if name == "EMPTY_LIST" else ())
    elif name in ("LIST", "TUPLE"):
        items = _since_mark(stack)
        stack.append(items if name == "LIST" else tuple(items))
    elif name in ("TUPLE1", "TUPLE2", "TUPLE3"):
        count = int(name[-1])
        stack[-count:] = [tuple(stack[-count:])]
    elif name in ("APPEND", "APPENDS"):
        items = [stack.pop()] if name == "APPEND" else _since_mark(stack)
        if not isinstance(stack[-1], list):
            raise InputError("a damaged table: items without a list", "was the file copied whole?")
        stack[-1].extend(items)
    elif name == "GLOBAL":
        stack.append(_OPAQUE)
    elif name in ("STACK_GLOBAL", "REDUCE"):
        stack[-2:] = [_OPAQUE]
    else:
        raise InputError(f"pickled content ({name.lower()})", "it is never loaded; only plain tables are read")


def _since_mark(stack: list[Any]) -> list[Any]:
    at = len(stack) - 1
    while stack[at] is not _MARK:
        at -= 1
        if at < 0:
            raise InputError("a damaged table: no mark", "was the file copied whole?")
    items = stack[at + 1 :]
    del stack[at:]
    return items


def read_frame(data: dict[str, Dataset], groups: dict[str, dict[str, object]], key: str) -> dict[str, list[object]] | None:
    """Columns by name, or None where there is no table of that name; both of pandas' formats.

    Raises:
        InputError: another kind of object, or damaged; the message begins with the key.
    """
    if key not in groups:
        return None
    kind = groups[key].get("pandas_type")
    try:
        if kind == "frame":
            columns = _read_fixed_table(data, groups[key], key)
        elif kind == "frame_table":
            columns = _table(data[f"{key}/table"])
        else:
            raise InputError(f"a {str(kind)[:20]!r} where a pandas table belongs")
        if len({len(values) for values in columns.values()}) > 1:
            raise InputError("columns of different lengths", "is it damaged?")
    except InputError as error:
        raise InputError(f"{key}: {error.problem}", error.hint) from None
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise InputError(f"{key}: a damaged table: {str(error)[:80]}", "was the file copied whole?") from None
    return columns


def _read_fixed_table(data: dict[str, Dataset], attributes: dict[str, object], key: str) -> dict[str, list[object]]:
    columns: dict[str, list[object]] = {}
    blocks = attributes["nblocks"]
    if not isinstance(blocks, int) or not 0 <= blocks <= 100:  # ours: three columns have three blocks at most
        raise InputError(f"{blocks} blocks", "is it damaged?")
    for block in range(blocks):
        names = [_text(name) for name in data[f"{key}/block{block}_items"].value]
        values = data[f"{key}/block{block}_values"].value
        if isinstance(values, list):
            values = _object_array(unpack(values[0])[1])
        for column, name in enumerate(names):
            columns[name] = values.reshape(len(values), math.prod(values.shape[1:]))[:, column].tolist()
    return columns


def _object_array(state: Any) -> np.ndarray:
    """The array whose state is (version, shape, type, is Fortran, items); numpy lists objects in C order in any case."""
    _, shape, _, _, items = state
    if not isinstance(items, list) or math.prod(shape) != len(items):
        raise InputError("a column of text that is none", "is it damaged?")
    array = np.empty(len(items), object)
    array[:] = items
    return array.reshape(shape)


def _table(table: Dataset) -> dict[str, list[object]]:
    columns: dict[str, list[object]] = {}
    for field in table.value.dtype.names:
        if field == "index":
            continue
        kind = table.attrs.get(f"{field}_kind")
        names = unpack(kind.encode("latin-1"))[0] if isinstance(kind, str) else [field]
        values = table.value[field]
        values = values.reshape(len(values), math.prod(values.shape[1:]))
        if not isinstance(names, list):
            raise InputError(f"the columns {str(names)[:40]}", "a list of names is right")
        for column, name in enumerate(names):
            columns[str(name)] = [_text(v) if isinstance(v, bytes) else v for v in values[:, column].tolist()]
    return columns


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
