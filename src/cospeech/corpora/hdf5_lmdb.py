"""Reading HDF5 and LMDB files in a process of their own (`_hdf5_lmdb.py`), which may crash or hang without harm to us."""

from __future__ import annotations

import json
import math
import os
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from ..errors import InputError
from ..files import regular_file
from ..limits import HDF5_BYTES, HDF5_MEMORY, HDF5_OBJECTS, LONGEST_ENTRY_BYTES, VAULT_TIMEOUT

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
        self._process: subprocess.Popen[bytes] | None = None
        self._waiting_since: float | None = None
        self._late = False

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
        found = {}
        for entry in about["datasets"]:
            found[str(entry["name"])] = Dataset(self._array(entry, name), entry["attrs"])
        self._expect(b"E", name)
        return found, about["groups"]

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
        if self._process is None:
            self._start()
        assert self._process is not None
        assert self._process.stdin is not None
        request = {"kind": self._kind, "path": os.fspath(path), "want": None if want is None else list(want)}
        with suppress(OSError):  # it is dead already: reading will say so
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
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

    def _start(self) -> None:
        script, paths = str(Path(__file__).with_name("_hdf5_lmdb.py")), os.pathsep.join(sys.path)
        limits = [str(limit) for limit in (HDF5_MEMORY, HDF5_BYTES, HDF5_OBJECTS)]
        command = [sys.executable, "-I", "-S", script, paths, self._kind, *limits]
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}  # each thread of NumPy's BLAS would reserve address space
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment
        )
        self._late = False
        threading.Thread(target=self._watch, args=(self._process,), daemon=True).start()

    def _watch(self, process: subprocess.Popen[bytes]) -> None:
        """Kill the process when it keeps us waiting; pipes cannot be read with a timeout on every system."""
        while process.poll() is None:
            time.sleep(0.2)
            since = self._waiting_since
            if process is self._process and since is not None and time.monotonic() - since > VAULT_TIMEOUT:
                self._late = True
                process.kill()

    def _expect(self, wanted: bytes, name: str) -> bytes:
        kind, payload = self._message(name)
        if kind != wanted:
            self.close()
            raise InputError(f"the reader sent {kind!r} for {wanted!r} on {name!r}", "the file is damaged")
        return payload

    def _message(self, name: str) -> tuple[bytes, bytes]:
        head = self._read(5, name)
        kind, size = head[:1], struct.unpack("<I", head[1:])[0]
        if size > LONGEST_ENTRY_BYTES:
            self.close()
            raise InputError(f"{name!r} holds an entry of {size >> 20} MiB", "is it damaged?")
        payload = self._read(size, name)
        if kind == b"X":
            values = json.loads(payload)
            raise InputError(f"{name!r}: {values['problem']}", values["hint"])
        return kind, payload

    def _read(self, size: int, name: str) -> bytes:
        assert self._process is not None
        assert self._process.stdout is not None
        self._waiting_since = time.monotonic()
        data = self._process.stdout.read(size)
        self._waiting_since = None
        if len(data) == size:
            return data
        code, late = self._process.wait(), self._late
        self.close()
        if late:
            raise InputError(f"the reader hangs on {name!r}: nothing for {VAULT_TIMEOUT:g} s", "it is damaged; copy it again")
        raise InputError(f"the reader crashed on {name!r} (exit {code})", "it is damaged; copy it again from its source")

    def close(self) -> None:
        """Kill the process if it still runs, and collect it."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()

    def __enter__(self) -> Hdf5LmdbReader:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def _dtype(described: Any) -> np.dtype[Any]:
    if isinstance(described, str):
        return np.dtype(described)
    return np.dtype([(name, _dtype(inner), tuple(shape)) for name, inner, shape in described])


def read_lmdb(folder: Path) -> Iterator[tuple[str, bytes]]:
    """`Hdf5LmdbReader.lmdb` of one folder, with a process of its own that ends with the iterator."""
    with Hdf5LmdbReader("lmdb") as reader:
        yield from reader.lmdb(folder)
