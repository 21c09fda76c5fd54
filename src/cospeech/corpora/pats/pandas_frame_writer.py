"""Writing a small table that ``pandas.read_hdf`` reads, without pandas, PyTables or pickle (see `pandas_frame`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

__all__ = ["write_frame"]


def write_frame(group: Any, words: Sequence[str], numbers: Mapping[str, Sequence[int]], text: str) -> None:
    """Write a table into an empty HDF5 group in pandas' *table* format: one column of text and some of whole numbers.

    ``pandas.read_hdf`` reads it; its pickled lists of column names are literal text, so nothing is pickled here.
    """
    names = list(numbers)
    raw = [word.encode("utf-8") for word in words]
    width = max([1, *map(len, raw)])
    dtype = np.dtype([("index", "<i8"), ("values_block_0", f"S{width}", (1,)), ("values_block_1", "<i8", (len(names),))])
    rows = np.zeros(len(raw), dtype)
    rows["index"] = np.arange(len(raw))
    rows["values_block_0"][:, 0] = raw
    rows["values_block_1"] = np.array([numbers[name] for name in names]).T.reshape(len(raw), len(names))
    table = group.create_dataset("table", data=rows, maxshape=(None,), chunks=(max(len(raw), 1),))

    def pickle_list(items: Sequence[str]) -> bytes:
        return b"(lp0\n" + b"".join(b"V%s\np%d\na" % (item.encode("ascii"), k) for k, item in enumerate(items, 1)) + b"."

    axes = b"(lp0\n(I1\n(lp1\n" + b"".join(b"V%s\np%d\na" % (n.encode(), k) for k, n in enumerate([text, *names], 2))
    _attributes(group, {
        "CLASS": b"GROUP", "VERSION": b"1.0", "TITLE": b" ",
        "pandas_type": b"frame_table", "table_type": b"appendable_frame", "encoding": b"UTF-8", "errors": b"strict",
        "nan_rep": b"nan", "data_columns": b"(lp0\n.", "index_cols": b"(lp0\n(I0\nVindex\np1\ntp2\na.", "levels": 1,
        "info": b"(dp0\nI1\n(dp1\nVnames\np2\n(lp3\nNasVtype\np4\nVIndex\np5\nss.",
        "values_cols": pickle_list(["values_block_0", "values_block_1"]),
        "non_index_axes": axes + b"tp%d\na." % (len(names) + 3),
    })  # fmt: skip
    _attributes(table, {
        "CLASS": b"TABLE", "VERSION": b"2.7", "TITLE": b" ", "index_kind": b"integer", "NROWS": len(raw),
        "FIELD_0_NAME": b"index", "FIELD_1_NAME": b"values_block_0", "FIELD_2_NAME": b"values_block_1",
        "values_block_0_dtype": b"bytes%d" % (8 * width), "values_block_0_kind": pickle_list([text]),
        "values_block_1_dtype": b"int64", "values_block_1_kind": pickle_list(names),
    })  # fmt: skip


def _attributes(item: Any, values: dict[str, bytes | int]) -> None:
    """Text as PyTables keeps it: of fixed length, marked as UTF-8; lists are marked as ASCII, by which it knows them."""
    import h5py

    for name, value in values.items():
        if isinstance(value, int):
            item.attrs[name] = np.int64(value)
        else:
            coding = "ascii" if value.startswith(b"(") else "utf-8"
            item.attrs.create(name, value, dtype=h5py.string_dtype(coding, len(value)))
