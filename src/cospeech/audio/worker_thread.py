"""Do the work of a child process in a thread, where there is no Python to start one with, such as in a frozen program.

The messages are the same, and go through pipes. But nothing limits the memory and the processor time of the work, and a crash
ends the whole program.
"""

from __future__ import annotations

import os
import signal
import subprocess
import threading
from collections.abc import Callable
from contextlib import suppress

from .worker import Worker, use_streams

__all__ = ["ThreadWorker"]

_PATIENCE = 1.0  # seconds for work to end after its pipes were closed [ours]


class ThreadWorker(Worker):
    """As `Worker`.

    Args:
        serve: what the script of the child process has as ``serve``.
    """

    process: _Thread  # type: ignore[assignment]  # what `Worker` needs of a process

    def __init__(self, serve: Callable[[], None]) -> None:
        self._watch_over(_Thread(serve))  # type: ignore[arg-type]

    def close(self) -> None:
        """Let the work end, and wait for it a moment. A codec that hangs goes on in the background; it cannot be ended."""
        self._stop.set()
        if self._deadline is not None:  # another thread waits for an answer: it must not keep the pipe
            self.process.kill()
        for pipe in (self.process.stdin, self.process.stdout):
            with suppress(OSError, ValueError):
                pipe.close()
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(_PATIENCE)


class _Thread:
    """Has the attributes of a process that `Worker` uses."""

    def __init__(self, serve: Callable[[], None]) -> None:
        ends = os.pipe(), os.pipe()
        self._questions, self.stdin = os.fdopen(ends[0][0], "rb"), os.fdopen(ends[0][1], "wb")
        self.stdout, self._answers = os.fdopen(ends[1][0], "rb"), os.fdopen(ends[1][1], "wb")
        self.returncode = 0
        self._thread = threading.Thread(target=self._run, args=(serve,), name="cospeech-worker", daemon=True)
        self._thread.start()

    def _run(self, serve: Callable[[], None]) -> None:
        if hasattr(signal, "pthread_sigmask"):  # a program around Python may let this signal end it; a thread of ours must not
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGPIPE})
        use_streams(self._questions, self._answers)
        try:
            serve()
        except (OSError, ValueError):  # a pipe was closed: nobody waits for more
            self.returncode = 1
        finally:
            for pipe in (self._answers, self._questions):
                with suppress(OSError, ValueError):  # what was not read is lost
                    pipe.close()

    def kill(self) -> None:
        """Close the pipe of the answers, so that whoever waits for one waits no longer; only while somebody waits."""
        self.returncode = 1
        with suppress(OSError, ValueError):
            self._answers.close()

    def wait(self, timeout: float | None = None) -> None:
        """Wait for the end.

        Raises:
            subprocess.TimeoutExpired: it takes longer.
        """
        self._thread.join(timeout)
        if self._thread.is_alive():
            raise subprocess.TimeoutExpired("cospeech-worker", timeout or 0)
