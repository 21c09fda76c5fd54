"""Where Python is embedded in another program or frozen into one, that program is not started again."""

from __future__ import annotations

import multiprocessing.spawn
import os
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from cospeech.audio import _decode, decoding
from cospeech.audio.interpreter import find_interpreter
from cospeech.audio.speech import Speech, example, open_speech
from cospeech.audio.worker import requests, send, worker_command
from cospeech.errors import InputError, InternalError
from cospeech.export.render import frames
from tests.export.test_html_page import still

EXAMPLE = example()[0]
PROGRAM = "python.exe" if os.name == "nt" else f"bin/python{sys.version_info[0]}.{sys.version_info[1]}"


def freeze(monkeypatch):
    """Play a program that PyInstaller has made; it can start no process."""
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("a process was started"))


@pytest.fixture
def frozen(monkeypatch):
    freeze(monkeypatch)


def embed(monkeypatch, program: str, library):
    """Play a Python inside a program."""
    monkeypatch.setattr(sys, "executable", program)
    monkeypatch.setattr(multiprocessing.spawn, "_python_exe", program)  # what it takes from sys.executable when it is imported
    for prefix in ("exec_prefix", "base_exec_prefix"):
        monkeypatch.setattr(sys, prefix, str(library))


def place(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"")
    return str(path)


def test_an_ordinary_python_is_its_own():
    assert find_interpreter() == sys.executable


@pytest.mark.parametrize("name", ["maya.bin", "UnrealEditor", "uwsgi", "pythonservice.exe", "PythonPlayer", ""])
def test_the_program_around_an_embedded_python_is_not_started(monkeypatch, tmp_path, name):
    embed(monkeypatch, place(tmp_path / "host" / name) if name else "", tmp_path / "library")
    assert find_interpreter() is None
    with pytest.raises(InternalError, match="set_executable"):
        worker_command(EXAMPLE)
    interpreter = place(tmp_path / "library" / PROGRAM)
    assert find_interpreter() == interpreter
    assert worker_command(EXAMPLE)[0] == interpreter


def test_maya_has_its_python_beside_it(monkeypatch, tmp_path):
    embed(monkeypatch, place(tmp_path / "maya.bin"), tmp_path / "library")
    interpreter = place(tmp_path / ("mayapy.exe" if os.name == "nt" else "mayapy"))
    assert find_interpreter() == interpreter


def test_a_path_given_to_multiprocessing_goes_first(monkeypatch, tmp_path):
    embed(monkeypatch, place(tmp_path / "maya.bin"), tmp_path / "library")
    interpreter = place(tmp_path / "my" / "interpreter")
    multiprocessing.set_executable(interpreter)
    assert find_interpreter() == interpreter
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    assert find_interpreter() is None


@pytest.mark.parametrize("name", ["python", "python3.13t", "pythonw.exe", "python_d.exe", "pypy3.11", "mayapy", "hython3.11"])
def test_these_are_pythons(monkeypatch, tmp_path, name):
    embed(monkeypatch, place(tmp_path / name), tmp_path / "library")
    assert find_interpreter() == str(tmp_path / name)


@pytest.mark.parametrize("where", ["absolute", "relative"])
def test_no_program_of_the_working_folder_is_started(monkeypatch, tmp_path, where):
    """Where an embedded Python finds no library, its prefix is the working folder."""
    embed(monkeypatch, place(tmp_path / "host" / "player"), tmp_path if where == "absolute" else "")
    place(tmp_path / PROGRAM)
    monkeypatch.chdir(tmp_path)
    assert find_interpreter() is None


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signal")
def test_an_early_end_does_not_end_a_program_that_obeys_broken_pipes():
    code = (
        "import signal, sys; from cospeech.audio.speech import example, open_speech; sys.frozen = True\n"
        "signal.signal(signal.SIGPIPE, signal.SIG_DFL)\n"
        "with open_speech(example()[0]) as source: next(iter(source.blocks()))\n"
        "print('alive')"
    )
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (process.returncode, process.stdout) == (0, "alive\n"), process.stderr


def test_a_frozen_program_decodes_in_a_thread(monkeypatch):
    with open_speech(EXAMPLE) as source:
        expected = np.concatenate(list(source.blocks()))
    freeze(monkeypatch)
    with open_speech(EXAMPLE) as source:
        assert np.array_equal(np.concatenate(list(source.blocks())), expected)


def test_errors_and_an_early_end_are_as_with_a_process(frozen, tmp_path):
    (tmp_path / "no.wav").write_bytes(b"RIFF no sound at all")
    with pytest.raises(InputError, match="not a sound file"):
        Speech.load(tmp_path / "no.wav")
    with open_speech(EXAMPLE) as source:
        assert len(next(iter(source.blocks())))
    assert not [thread for thread in threading.enumerate() if thread.name == "cospeech-worker"]


def test_a_decoder_that_hangs_or_says_nonsense_is_given_up(frozen, monkeypatch):
    end = threading.Event()

    def hang():
        for _ in requests():
            end.wait(30)

    def talk():
        for _ in requests():
            send(b"Z", b"?")

    monkeypatch.setattr(decoding, "OPEN_TIMEOUT", 0.1)
    monkeypatch.setattr(_decode, "serve", hang)
    began = time.monotonic()
    with pytest.raises(InputError, match="hangs"):
        Speech.load(EXAMPLE)
    assert time.monotonic() - began < 20
    end.set()
    monkeypatch.setattr(_decode, "serve", talk)
    with pytest.raises(InputError, match="before its header"):
        Speech.load(EXAMPLE)


def test_a_frozen_program_draws_films_itself(frozen, monkeypatch, tmp_path):
    monkeypatch.setattr(frames, "cores", lambda: 8)
    still(40).save(tmp_path / "talk.gif")
    assert (tmp_path / "talk.gif").stat().st_size > 1000
