"""The takes of the studio: a queue, one process that makes them, and the events of each."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import CospeechError
from .messages import TakeEvent
from .shelf import Shelf, TakeSource
from .speeches import HeldSpeech
from .worker import JobCancelled, StudioWorker

__all__ = ["MOST_WAITING", "HeldTake", "QueueFull", "TakeQueue"]

MOST_WAITING = 16
"""Takes that wait for their turn [ours: two pages with eight each]."""


class QueueFull(Exception):
    """Too many takes wait."""


@dataclass(eq=False)
class HeldTake:
    """A take, which waits, is being made, or is done; in a folder of its own."""

    name: str
    folder: Path
    speech: HeldSpeech
    job: dict[str, Any]
    """Arguments of the job; see `cospeech.studio._jobs.Jobs.take`."""
    event: TakeEvent
    """Its last event."""
    page: str | None = None
    """The page that requested it, if any."""

    @property
    def in_use(self) -> bool:
        """Whether it waits or is being made."""
        return self.event.type in ("queued", "progress")

    @property
    def label(self) -> str:
        """Its name for people: that of its speech, without the suffix."""
        return Path(self.speech.label).stem

    @property
    def motion(self) -> Path:
        """File of the motion; see `cospeech.studio.motion_bytes`."""
        return self.folder / "motion.bin"


class TakeQueue:
    """Makes takes one after the other, in a thread that waits for the worker process.

    Args:
        shelf: keeps the takes.
        worker: makes them; it is closed with the queue.
        publish: called with each event of a take.
    """

    def __init__(self, shelf: Shelf[HeldTake], worker: StudioWorker, publish: Callable[[TakeEvent], None]) -> None:
        self._shelf, self._worker, self._publish = shelf, worker, publish
        self._waiting: deque[HeldTake] = deque()
        self._running: HeldTake | None = None
        self._change, self._closed = threading.Condition(), False
        self._thread = threading.Thread(target=self._work, name="cospeech takes", daemon=True)
        self._thread.start()

    def add(
        self, name: str, folder: Path, speech: HeldSpeech, job: dict[str, Any], page: str | None = None,
        clip: TakeSource | None = None,
    ) -> None:  # fmt: skip
        """Queue a take; see `HeldTake`. Its speech stays until it is made, and so does the ``clip`` whose style it has.

        Raises:
            QueueFull: `MOST_WAITING` takes wait already.
        """
        take = HeldTake(name, folder, speech, job, TakeEvent(type="queued", take=name), page)
        with self._change:
            if len(self._waiting) >= MOST_WAITING:
                raise QueueFull
            for source in (speech, clip):
                if source is not None:
                    source.add_take(take)
            self._waiting.append(take)
            self._shelf.put(name, take)
            self._publish(take.event)
            self._change.notify()

    def cancel(self, name: str) -> None:
        """Cancel a take that waits or is being made; drop one that is done.

        Raises:
            LookupError: there is no such take.
        """
        take = self._shelf.find(name)
        with self._change:
            if take in self._waiting:
                self._waiting.remove(take)
                self._tell(take, "cancelled")
            elif take is self._running and take.event.type not in ("done", "error"):
                if take.in_use:
                    self._tell(take, "cancelled")
                    self._worker.cancel(take)
                return  # its folder is removed when the process has finished with it
        self._shelf.remove(name)

    def cancel_page(self, page: str) -> None:
        """Cancel the takes of a page that wait or are being made."""
        for take in reversed(self._shelf.things):  # those that wait first, so that none of them begins
            if take.page == page and take.in_use:
                with suppress(LookupError):  # it was dropped meanwhile
                    self.cancel(take.name)

    def close(self) -> None:
        """End the worker process and the thread; takes that wait are not made."""
        with self._change:
            self._closed = True
            self._waiting.clear()
            self._change.notify()
        self._worker.close()
        self._thread.join(5)

    def _tell(self, take: HeldTake, kind: str, **facts: Any) -> None:
        take.event = TakeEvent.model_validate({"type": kind, "take": take.name, **facts})
        self._publish(take.event)

    def _work(self) -> None:
        while (take := self._next()) is not None:
            self._make(take)
            with self._change:
                self._running = None
            if take.event.type == "cancelled":
                with suppress(LookupError):  # the shelf has dropped it for newer takes
                    self._shelf.remove(take.name)
            if self._worker.process_id is None:
                self._warm_up()

    def _next(self) -> HeldTake | None:
        with self._change:
            while not self._waiting and not self._closed:
                self._change.wait()
            self._running = None if self._closed else self._waiting.popleft()
            return self._running

    def _make(self, take: HeldTake) -> None:
        start = time.perf_counter()

        def progress(amount: float, total: float | None) -> None:
            with self._change:
                if take.in_use:
                    self._tell(take, "progress", done=amount, total=total, seconds=time.perf_counter() - start)

        kind, facts = "error", dict[str, Any]()
        try:
            result = self._worker.run("take", progress, owner=take, **take.job)
            kind, facts = (
                "done",
                {"done": result["seconds"], "total": result["seconds"], "realtime_factor": result["realtime_factor"]},
            )
        except JobCancelled:
            kind = "cancelled"
        except CospeechError as error:
            facts = {"problem": error.problem, "hint": error.hint}
        except Exception as error:  # the thread must go on: other takes wait for it
            facts = {"problem": f"{type(error).__name__}: {error}".removesuffix(": "), "hint": "this is a bug of ours"}
        with self._change:
            if take.event.type != "cancelled":
                self._tell(take, kind, seconds=time.perf_counter() - start, **facts)

    def _warm_up(self) -> None:
        """Start the process again, so that the next take does not have to wait for it."""
        with suppress(Exception):  # the next take reports it
            self._worker.run("warm")
