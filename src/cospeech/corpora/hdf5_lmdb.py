"""Reading HDF5 and LMDB files in a process of their own (`_hdf5_lmdb.py`), which may crash or hang without harm to us."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from ..audio.worker import TooLong, Worker, WorkerEnded, worker_command
from ..errors import InputError
from ..files import regular_file
from ..limits import HDF5_BYTES, HDF5_LMDB_TIMEOUT, HDF5_MEMORY, HDF5_OBJECTS, LONGEST_ENTRY_BYTES

__all__ = ["Dataset", "Hdf5LmdbReader", "read_lmdb"]

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_PAGE = 4096  # bytes; LMDB's smallest page in use


@dataclass(frozen=True, eq=False)
class Dataset:
    """One data set of an HDF5 file: an array, or a list of str (text) or of bytes (byte strings of variable length)."""

    value: Any
    attrs: dict[str, object] = field(default_factory=dict)


class Hdf5LmdbReader:
    """A reader process; a context manager. It is started when first needed and again after a crash."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._worker: Worker | None = None

    def hdf5(self, path: Path, want: Sequence[str] | None = None) -> tuple[dict[str, Dataset], dict[str, dict[str, object]]]:
        """All data sets of a file and the attributes of its groups, by name; ``want`` narrows it to some groups.

        Raises:
            InputError: it cannot be read, is damaged, or brings the library down.
        """
        file, name = regular_file(path, "an HDF5 file"), path.name
        with file.open("rb") as start:
            if start.read(8) != _SIGNATURE:
                raise InputError(f"{name!r} is not an HDF5 file", "was it downloaded and unpacked whole?")
        about = self._first(file, name, want)
        datasets = {}
        for entry in about["datasets"]:
            datasets[str(entry["name"])] = Dataset(self._array(entry, name), entry["attrs"])
        self._expect(b"E", name)
        return datasets, about["groups"]

    def lmdb(self, folder: Path) -> Iterator[tuple[str, bytes]]:
        """Keys and values of an LMDB folder, in the order of the keys; read as they are asked for.

        Raises:
            InputError: as `hdf5`.
        """
        file, name = regular_file(folder / "data.mdb", "an LMDB"), folder.name
        size = file.stat().st_size
        if size < 2 * _PAGE or size % _PAGE:
            raise InputError(f"'{name}/data.mdb' has {size} bytes, no whole number of pages", "was it copied whole?")
        self._first(folder.absolute(), name, None)
        while True:
            kind, key = self._message(name)
            if kind == b"E":
                return
            yield key.decode("latin-1"), self._expect(b"B", name)

    def _first(self, path: Path, name: str, want: Sequence[str] | None) -> dict[str, Any]:
        if self._worker is None:
            script, memory = Path(__file__).with_name("_hdf5_lmdb.py"), HDF5_MEMORY if self._kind == "hdf5" else 0
            # LMDB maps whole files of any size
            self._worker = Worker(worker_command(script, self._kind, HDF5_BYTES, HDF5_OBJECTS, memory=memory))
        request = {"path": os.fspath(path), "want": None if want is None else list(want)}
        self._worker.request(b"J", json.dumps(request).encode())
        return json.loads(self._expect(b"J", name))

    def _array(self, entry: dict[str, Any], name: str) -> Any:
        if "text" in entry:
            return entry["text"]
        if "pieces" in entry:
            return [piece.encode("latin-1") for piece in entry["pieces"]]
        dtype = _dtype(entry["dtype"])
        shape, size = tuple(entry["shape"]), entry["bytes"]
        if size != math.prod(shape) * dtype.itemsize:
            self.close()
            raise InputError(f"{name!r}: {entry['name']} has {size} bytes for the shape {shape}", "is it damaged?")
        data = bytearray()
        while len(data) < size:
            data += self._expect(b"B", name)
        return np.frombuffer(data, dtype).reshape(shape)

    def _expect(self, expected_kind: bytes, name: str) -> bytes:
        kind, payload = self._message(name)
        if kind != expected_kind:
            self.close()
            raise InputError(f"the reader sent {kind!r} for {expected_kind!r} on {name!r}", "the file is damaged")
        return payload

    def _message(self, name: str) -> tuple[bytes, bytes]:
        assert self._worker is not None
        try:
            kind, payload = self._worker.receive(LONGEST_ENTRY_BYTES, HDF5_LMDB_TIMEOUT)
        except TooLong as error:
            self.close()
            raise InputError(f"{name!r} holds an entry of {error.size >> 20} MiB", "is it damaged?") from None
        except WorkerEnded as failure:
            self.close()
            if failure.late:
                problem = f"the reader hangs on {name!r}: nothing for {HDF5_LMDB_TIMEOUT:g} s"
                raise InputError(problem, "is the computer very busy? then try again; else copy it again") from None
            raise InputError(
                f"the reader crashed on {name!r} ({failure})", "it is damaged; copy it again from its source"
            ) from None
        if kind == b"X":
            values = json.loads(payload)
            raise InputError(f"{name!r}: {values['problem']}", values["hint"])
        return kind, payload

    def close(self) -> None:
        """Kill the process if it still runs, and collect it."""
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.close()

    def __enter__(self) -> Hdf5LmdbReader:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def _dtype(description: Any) -> np.dtype[Any]:
    if isinstance(description, str):
        return np.dtype(description)
    return np.dtype([(name, _dtype(inner), tuple(shape)) for name, inner, shape in description])


def read_lmdb(folder: Path) -> Iterator[tuple[str, bytes]]:
    """`Hdf5LmdbReader.lmdb` of one folder, with a process of its own that ends with the iterator."""
    with Hdf5LmdbReader("lmdb") as reader:
        yield from reader.lmdb(folder)
