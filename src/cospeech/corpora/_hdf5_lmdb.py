"""A separate process that reads HDF5 and LMDB files: both libraries can crash on a damaged file, and then only it ends.

`cospeech.audio.worker` starts it for `cospeech.corpora.hdf5_lmdb`; nothing else of the package is imported. A request is JSON:
{"path", "want"}. Messages that answer it:

    J  JSON: for HDF5 all data sets and attributes, for LMDB {"entries"}
    B  bytes: the data sets in the order of the JSON, in pieces; for LMDB keys and values in turn
    E  the end of this file
    X  JSON {"problem", "hint"}: it cannot be read

Only what lies in the file itself is read: no soft or external links, no external storage, no virtual data sets, no plug-ins.
"""

from __future__ import annotations

import json
import os

from cospeech.audio.worker import FileRefused, requests, send, send_json

__all__ = ["serve"]

PIECE = 1 << 24  # bytes per message; ours


def as_text(value: object) -> object:
    """An attribute as JSON can hold it; bytes as latin-1, so that nothing is lost."""
    if isinstance(value, bytes):
        return value.decode("latin-1")
    item = getattr(value, "item", None)
    if item is not None and getattr(value, "size", 1) == 1:
        return as_text(item())
    return value if isinstance(value, (str, int, float, bool)) else None


def describe_type(dtype) -> object:  # type: ignore[no-untyped-def]  # numpy is imported only where it is needed
    """A numpy type as JSON: "<f8", or a list of [name, type, shape]."""
    if dtype.names is None:
        return dtype.str
    return [[name, describe_type(dtype[name].base), list(dtype[name].shape)] for name in dtype.names]


def load(data):  # type: ignore[no-untyped-def]
    """The description of one data set, and its bytes; text of variable length goes into the description."""
    import h5py
    import numpy as np

    about = {"name": data.name.lstrip("/"), "shape": list(data.shape), "attrs": {k: as_text(v) for k, v in data.attrs.items()}}
    if data.external or data.is_virtual:
        raise FileRefused(f"{data.name} lies in another file", "copy it into one")
    text = h5py.check_string_dtype(data.dtype)
    whole = data[()] if data.dtype.hasobject else None
    objects = [whole] if data.shape == () else [] if whole is None else whole.reshape(-1)
    if text is not None and text.length is None:
        values = [v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v) for v in objects]
        return about | {"text": values}, b""
    if h5py.check_vlen_dtype(data.dtype) is not None:
        values = [np.asarray(v).tobytes().decode("latin-1") for v in objects]
        return about | {"pieces": values}, b""
    if data.dtype.hasobject:
        raise FileRefused(f"{data.name} holds objects", "plain numbers and text are right")
    array = np.ascontiguousarray(data[()])
    return about | {"dtype": describe_type(array.dtype), "bytes": array.nbytes}, array.tobytes()


def read_hdf5(path: str, want: list[str] | None, most_bytes: int, most_objects: int) -> None:
    import h5py

    datasets: list = []
    groups: dict = {}

    def is_wanted(name: str) -> bool:
        return want is None or any(name == w or name.startswith(w + "/") or w.startswith(name + "/") for w in want)

    def visit(name: str, item) -> None:  # type: ignore[no-untyped-def]
        if len(datasets) + len(groups) > most_objects:
            raise FileRefused(f"it holds more than {most_objects} data sets", "is it of this corpus?")
        if not is_wanted(name):
            return
        if isinstance(item, h5py.Dataset):
            if item.shape is not None:
                datasets.append(item)
        else:
            groups[name] = {k: as_text(v) for k, v in item.attrs.items()}

    with h5py.File(path, "r") as file:
        file.visititems(visit)
        total = sum(int(item.size) * max(item.dtype.itemsize, 1) for item in datasets)
        if total > most_bytes:
            raise FileRefused(f"it unpacks to {total >> 20} MiB", f"at most {most_bytes >> 20} MiB are read")
        contents = [load(item) for item in datasets]
    send_json(b"J", datasets=[about for about, _ in contents], groups=groups)
    for _, data in contents:
        for at in range(0, len(data), PIECE):
            send(b"B", memoryview(data)[at : at + PIECE])


def read_lmdb(path: str) -> None:
    import lmdb

    try:
        store = lmdb.open(path, readonly=True, lock=False, readahead=False, create=False)
        with store, store.begin(buffers=True) as look:
            entries = look.stat()["entries"]
            send_json(b"J", entries=entries)
            last, count = b"", 0
            for key, value in look.cursor():
                count += 1
                name = bytes(key)
                if count > entries or (count > 1 and name <= last):
                    raise FileRefused("its keys are out of order: it is damaged", "copy it again from its source")
                last = name
                send(b"B", name)
                send(b"B", value)
            if count != entries:
                raise FileRefused(
                    f"it says that it holds {entries} entries, and holds {count}", "copy it again from its source"
                )
    except lmdb.Error as error:
        raise FileRefused(f"not an LMDB that can be read: {error}", "was it copied whole?") from None


def serve(kind: str, most_bytes: str, most_objects: str) -> None:
    """Read the files that are asked for; ``kind`` is hdf5 or lmdb."""
    os.environ["HDF5_PLUGIN_PRELOAD"] = "::"  # HDF5's own word for: load no plug-ins
    for _, payload in requests():
        request = json.loads(payload)
        try:
            if kind == "hdf5":
                read_hdf5(request["path"], request["want"], int(most_bytes), int(most_objects))
            else:
                read_lmdb(request["path"])
            send_json(b"E")
        except BrokenPipeError:
            raise
        except Exception as error:  # any error that a library raises for a damaged file
            send_json(b"X", **refusal(error, request["path"]).message)


def refusal(error: Exception, path: str) -> FileRefused:
    """The message to the user about an error."""
    if isinstance(error, FileRefused):
        return error
    if isinstance(error, ImportError):
        return FileRefused(f"reading it needs {error.name}", 'in a clone: pip install -e ".[corpora]"')
    if isinstance(error, MemoryError):
        return FileRefused("it wants more memory than such a file should", "is it damaged?")
    reason = " ".join((str(error) or type(error).__name__).replace(path, "it").split())[:160]
    return FileRefused(f"damaged: {reason}", "copy it again from its source")
