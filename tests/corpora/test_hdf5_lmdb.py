"""The process that reads HDF5 and LMDB files: it may crash, hang or lack its library, and all that is one line."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from cospeech.corpora import hdf5_lmdb as module
from cospeech.corpora.hdf5_lmdb import Hdf5LmdbReader
from cospeech.errors import InputError

h5py = pytest.importorskip("h5py", reason="needs cospeech[corpora]")


@pytest.fixture
def file(tmp_path) -> Path:
    path = tmp_path / "some.h5"
    with h5py.File(path, "w") as hdf5:
        hdf5["a/numbers"] = np.arange(6, dtype="<f4").reshape(2, 3)
        hdf5["a/text"] = np.array(["né", "b"], h5py.string_dtype())
        hdf5["b/alone"] = "one"
        hdf5["b/none"] = h5py.Empty("f8")
        hdf5["b/pairs"] = np.array([(1, 2.5)], [("n", "<i2"), ("x", "<f8", (1,))])
        hdf5["a"].attrs["what"] = "letters"
    return path


def test_all_of_a_file(file):
    with Hdf5LmdbReader("hdf5") as reader:
        data, groups = reader.hdf5(file)
        assert set(data) == {"a/numbers", "a/text", "b/alone", "b/pairs"}
        assert data["a/numbers"].value.dtype == np.float32
        assert data["a/numbers"].value.tolist() == [[0, 1, 2], [3, 4, 5]]
        assert (data["a/text"].value, data["b/alone"].value) == (["né", "b"], ["one"])
        assert data["b/pairs"].value["x"].tolist() == [[2.5]]
        assert groups["a"] == {"what": "letters"}
        assert set(reader.hdf5(file, ["a"])[0]) == {"a/numbers", "a/text"}


@pytest.mark.slow
def test_a_crash_costs_one_file(file):
    with Hdf5LmdbReader("hdf5") as reader:
        reader.hdf5(file)
        assert reader._worker is not None
        reader._worker.process.kill()
        reader._worker.process.wait()
        with pytest.raises(InputError, match=r"the reader crashed on 'some\.h5'"):
            reader.hdf5(file)
        assert set(reader.hdf5(file, ["b"])[0]) == {"b/alone", "b/pairs"}


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="processes cannot be stopped on this system")
def test_a_hang_is_ended(file, monkeypatch):
    with Hdf5LmdbReader("hdf5") as reader:
        reader.hdf5(file)
        monkeypatch.setattr(module, "HDF5_LMDB_TIMEOUT", 0.3)
        assert reader._worker is not None
        os.kill(reader._worker.process.pid, signal.SIGSTOP)
        with pytest.raises(InputError, match=r"the reader hangs on 'some\.h5'.*is the computer very busy\?"):
            reader.hdf5(file)


def test_without_the_library(file, monkeypatch):
    monkeypatch.setattr(sys, "path", [path for path in sys.path if "site-packages" not in path])
    with (
        Hdf5LmdbReader("hdf5") as reader,
        pytest.raises(InputError, match=r'needs h5py \(in a clone: pip install -e "\.\[corpora\]"\)'),
    ):
        reader.hdf5(file)


def test_a_file_that_would_fill_the_memory(tmp_path):
    with h5py.File(tmp_path / "bomb.h5", "w") as hdf5:
        hdf5.create_dataset("a", (1 << 20, 1 << 16), "f8", chunks=(1 << 10, 1 << 8), compression="gzip")
    with Hdf5LmdbReader("hdf5") as reader, pytest.raises(InputError, match=r"'bomb\.h5'.* MiB"):
        reader.hdf5(tmp_path / "bomb.h5")


@pytest.mark.parametrize("name", ["nothing.h5", ".", "x\0y"])
def test_what_is_no_file(tmp_path, name):
    with Hdf5LmdbReader("hdf5") as reader, pytest.raises(InputError, match="cannot read"):
        reader.hdf5(tmp_path / name)
