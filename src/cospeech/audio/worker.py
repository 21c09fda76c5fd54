"""Child processes: how they start, what they may use, and how we talk to them.

The decoder of sound, the reader of HDF5 and LMDB and the renderer are such processes: they may crash, hang or eat memory
without harm to us. `Worker` is our side. In the child, `main` sets the limits and calls ``serve`` of a script, which iterates
over `requests` and answers by `send`. A message has the same form both ways: one letter, the length of what follows (uint32,
little endian), then the bytes. Nothing is pickled, and the script that uses cospeech is not imported again.
"""

from __future__ import annotations

import json
import os
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from importlib.util import module_from_spec, spec_from_file_location
from typing import BinaryIO

from ..errors import InternalError, is_broken_pipe

__all__ = [
    "FileRefused", "TooLong", "Worker", "WorkerEnded", "confine", "main", "message", "requests", "send", "send_json",
    "use_streams", "worker_command",
]  # fmt: skip

_HEAD = struct.Struct("<cI")
_START = "import os, sys; sys.path[:] = sys.argv[1].split(os.pathsep); from cospeech.audio.worker import main; main()"
_PACKAGE = os.path.dirname(os.path.dirname(os.path.dirname(__file__)))  # noqa: PTH120  pathlib takes time to import


def message(kind: bytes, payload: bytes | memoryview) -> bytes:
    """The bytes of one message."""
    return _HEAD.pack(kind, len(payload)) + payload


# ---- our side ----


class WorkerEnded(Exception):
    """The process crashed, or was killed because it was ``late``; ``code`` is its exit status."""

    def __init__(self, code: int, late: bool) -> None:
        super().__init__(f"exit {code}")
        self.code, self.late = code, late


class TooLong(Exception):
    """A message is announced with ``size`` bytes, which are not read."""

    def __init__(self, size: int) -> None:
        super().__init__(f"{size} bytes")
        self.size = size


def worker_command(script: os.PathLike[str], *arguments: object, memory: int = 0, cpu_seconds: int = 0) -> list[str]:
    """How a script is started: isolated (-I), without site-packages hooks (-S), with our own search path and limits.

    Args:
        script: it has ``serve(*arguments)``. It runs outside its package, whose imports cost time and memory.
        arguments: handed on as text.
        memory: bytes of address space; 0 is no limit.
        cpu_seconds: seconds of work; 0 is no limit.

    Raises:
        InternalError: there is no Python to start.
    """
    from .interpreter import find_interpreter  # not in the child

    interpreter = find_interpreter()
    if interpreter is None:
        hint = "this needs an ordinary Python; in a program around Python, name one: multiprocessing.set_executable(path)"
        raise InternalError("no Python to start a process with", hint)
    paths = os.pathsep.join(filter(None, [_PACKAGE, *sys.path]))  # no numpy.py of the working folder
    limits = [str(memory), str(cpu_seconds)]
    return [interpreter, "-I", "-S", "-c", _START, paths, os.fspath(script), *limits, *map(str, arguments)]


class Worker:
    """A running child process.

    Args:
        command: as `worker_command` gives it.
        environment: variables to set for the process.
        quiet: what the process says on standard error is dropped.
    """

    def __init__(self, command: list[str], environment: Mapping[str, str] | None = None, *, quiet: bool = True) -> None:
        variables = {**os.environ, "OPENBLAS_NUM_THREADS": "1", **(environment or {})}  # a thread of BLAS reserves memory
        pipe, errors = subprocess.PIPE, subprocess.DEVNULL if quiet else None
        no_window = getattr(subprocess, "CREATE_NO_WINDOW", 0)  # a program without a console would show one, on Windows
        self._watch_over(
            subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=errors, env=variables, creationflags=no_window)
        )

    def _watch_over(self, process: subprocess.Popen[bytes]) -> None:
        self.process = process
        self._deadline: float | None = None
        self._late, self._stop = False, threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        """Kill the process when it keeps us waiting; pipes cannot be read with a timeout on every system."""
        while not self._stop.wait(0.2):
            deadline = self._deadline
            if deadline is not None and time.monotonic() > deadline:
                self._late = True
                self.process.kill()
                return

    def request(self, kind: bytes, payload: bytes, *, last: bool = False) -> None:
        """Send one request; after the ``last`` one the process ends by itself."""
        assert self.process.stdin is not None
        with suppress(OSError, ValueError):  # it is dead already: reading will say so
            self.process.stdin.write(message(kind, payload))
            self.process.stdin.flush()
            if last:
                self.process.stdin.close()

    def receive(self, longest: int, timeout: float | None = None) -> tuple[bytes, bytes]:
        """The next message: its letter and its bytes.

        Raises:
            WorkerEnded: there is none, or none within ``timeout`` seconds.
            TooLong: it has more than ``longest`` bytes.
        """
        kind, size = _HEAD.unpack(self._read(_HEAD.size, timeout))
        if size > longest:
            raise TooLong(size)
        return kind, self._read(size, timeout)

    def _read(self, size: int, timeout: float | None) -> bytes:
        assert self.process.stdout is not None
        self._deadline = None if timeout is None else time.monotonic() + timeout
        data = b""
        with suppress(OSError, ValueError):  # it was closed
            data = self.process.stdout.read(size)
        self._deadline = None
        if len(data) == size:
            return data
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(1)  # its pipes close a moment before it is gone
        self.close()
        raise WorkerEnded(self.process.returncode, self._late)

    def close(self) -> None:
        """Kill the process if it still runs, and collect it."""
        self._stop.set()
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            with suppress(OSError):  # bytes that were not written yet are lost
                pipe.close()  # type: ignore[union-attr]


# ---- in the child ----


class FileRefused(Exception):
    """A message for the user: problem and hint; ``ours``: the file is not to blame; ``detail``: the words of a library."""

    def __init__(self, problem: str, hint: str = "", ours: bool = False, detail: object = "") -> None:
        self.message = {"problem": problem, "hint": hint, "ours": ours, "detail": str(detail)}


def confine(memory: int, cpu_seconds: int) -> None:
    """Bound memory (bytes) and time, leave no core dump, let Ctrl-C be the parent's business.

    The time ends a process whose parent is gone and that never writes again.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        import resource
    except ImportError:  # Windows
        return
    bounds = {resource.RLIMIT_AS: memory, resource.RLIMIT_CPU: cpu_seconds}
    limits = {kind: limit for kind, limit in bounds.items() if limit} | {resource.RLIMIT_CORE: 0}
    for kind, limit in limits.items():
        with suppress(ValueError, OSError):  # not on this system
            resource.setrlimit(kind, (limit, resource.getrlimit(kind)[1]))


_STREAMS = threading.local()


def use_streams(questions: BinaryIO, answers: BinaryIO) -> None:
    """Let this thread read and write here, in place of standard input and output."""
    _STREAMS.pair = questions, answers


def _streams() -> tuple[BinaryIO, BinaryIO]:
    return getattr(_STREAMS, "pair", None) or (sys.stdin.buffer, sys.stdout.buffer)


def requests() -> Iterator[tuple[bytes, bytes]]:
    """Letter and bytes of each request, until there are no more. The answers are sent off before the next request is read."""
    questions, answers = _streams()
    while len(head := questions.read(_HEAD.size)) == _HEAD.size:
        kind, size = _HEAD.unpack(head)
        payload = questions.read(size)
        if len(payload) < size:
            return
        yield kind, payload
        answers.flush()


def send(kind: bytes, payload: bytes | memoryview) -> None:
    """Answer with bytes."""
    answers = _streams()[1]
    answers.write(_HEAD.pack(kind, len(payload)))
    answers.write(payload)


def send_json(kind: bytes, **values: object) -> None:
    """Answer with JSON, at once."""
    send(kind, json.dumps(values).encode())
    _streams()[1].flush()


def main() -> None:
    """``PATHS SCRIPT MEMORY CPU_SECONDS ARGUMENTS``: serve until there are no more requests."""
    script, memory, cpu_seconds, *arguments = sys.argv[2:]
    confine(int(memory), int(cpu_seconds))
    try:
        spec = spec_from_file_location("serving", script)
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        module.serve(*arguments)
    except OSError as error:
        if is_broken_pipe(error):  # the parent has read enough, or is gone
            os._exit(0)
        raise
