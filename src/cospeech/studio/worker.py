"""Worker processes for the studio's heavy work, from the server's side: one job at a time; a process may die."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Any
from weakref import WeakSet

from ..audio.worker import TooLong, Worker, WorkerEnded, worker_command
from ..errors import InputError, InternalError
from ..files import describe_os_error

__all__ = ["JobCancelled", "StudioWorker"]

_LONGEST = 1 << 24  # bytes of an answer [ours: a report has some kB]
_PATIENCE = 0.7  # seconds within which a cancelled job must end [ours: the page gets an answer within a second]

Progress = Callable[[float, float | None], None]


class JobCancelled(Exception):
    """The job was cancelled."""


class StudioWorker:
    """A process that starts with its first job, keeps its models, and is started again if it has ended.

    Methods may be called from any thread; jobs wait for each other.
    """

    def __init__(self) -> None:
        self._turn, self._state = threading.Lock(), threading.Lock()
        self._worker: Worker | None = None
        self._numbers, self._running, self._cancel_number = count(1), 0, 0
        self._owner: object = None
        self._cancelled_owners = WeakSet[Any]()
        self._closed = False

    @property
    def process_id(self) -> int | None:
        """Id of the process; None if none runs."""
        worker = self._worker
        return None if worker is None else worker.process.pid

    def run(
        self, job: str, progress: Progress | None = None, *, timeout: float | None = None, owner: object = None, **values: Any
    ) -> dict[str, Any]:
        """Do a job of `cospeech.studio._jobs`.

        Args:
            job: its name.
            progress: called with the seconds done and the seconds in all.
            timeout: longest time without a message of the process, seconds.
            owner: identifies the job for `cancel`.
            values: arguments of the job; they are sent as JSON.

        Raises:
            InputError: an argument cannot be used.
            InternalError: the process cannot start, has ended, or failed.
            JobCancelled: `cancel` was called.
        """
        with self._turn:
            with self._state:
                if self._closed or (owner is not None and owner in self._cancelled_owners):
                    raise JobCancelled
                if self._worker is None:
                    self._worker = _start_worker()
                worker, number = self._worker, next(self._numbers)
                self._running, self._owner = number, owner
            worker.request(b"J", json.dumps({"job": job, "number": number, **values}).encode())
            try:
                return self._follow(worker, progress, timeout)
            except (WorkerEnded, TooLong) as error:
                worker.close()
                with self._state:
                    self._worker = None
                    if self._cancel_number == number or self._closed:
                        raise JobCancelled from None
                raise InternalError(f"the worker process has ended ({error})", "it was started again; try once more") from None
            finally:
                with self._state:
                    self._running, self._owner = 0, None

    def cancel(self, owner: Any = None) -> None:
        """End the job that runs. A process that does not react is killed.

        Args:
            owner: an object that was given to `run`: only its job ends, even if it still waits. None: the job that runs.
        """
        with self._state:
            worker, number = self._worker, self._running
            if owner is not None:
                self._cancelled_owners.add(owner)
            if worker is None or not number or (owner is not None and owner is not self._owner):
                return
            self._cancel_number = number
        worker.request(b"C", json.dumps(number).encode())
        timer = threading.Timer(_PATIENCE, self._kill, (worker, number))
        timer.daemon = True
        timer.start()

    def close(self) -> None:
        """End the process and its job; no more jobs are accepted."""
        with self._state:
            self._closed, worker = True, self._worker
        if worker is not None:
            worker.process.kill()
            worker.process.wait()
            with self._turn:
                worker.close()

    def _kill(self, worker: Worker, number: int) -> None:
        with self._state:
            if self._running == number and self._worker is worker:
                worker.process.kill()

    def _follow(self, worker: Worker, progress: Progress | None, timeout: float | None) -> dict[str, Any]:
        """Wait for the answer to a job, and return it."""
        while True:
            kind, payload = worker.receive(_LONGEST, timeout)
            values: dict[str, Any] = json.loads(payload)
            if kind == b"D":
                return values
            if kind == b"X":
                raise (InternalError if values["ours"] else InputError)(values["problem"], values["hint"])
            if kind == b"C":
                raise JobCancelled
            if progress is not None:
                with suppress(RuntimeError):  # the event loop of the listener has ended
                    progress(values["done"], values["total"])


def _start_worker() -> Worker:
    """Start a process.

    Raises:
        InternalError: the system starts none: memory is short, or a limit of processes or open files is reached.
    """
    command = worker_command(Path(__file__).with_name("_jobs.py"))
    try:
        return Worker(command, {"OMP_NUM_THREADS": "1"})
    except OSError as error:
        reason = describe_os_error(error)
        raise InternalError(f"the worker process cannot start: {reason}", "close other programs, then try again") from None
