"""Send frames evenly, each at its own time on the clock, even if they are made unevenly."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from ...motion.motion import Motion
from .outlets import Outlet

__all__ = ["FramePacer", "Pace"]

MARGIN, SHORT_MARGIN = 0.06, 0.03
"""Seconds between the last moment at which a frame can be ready and its time to leave: four frames of 60 a second, and two for
callers that want to be quick (ours)."""


@dataclass
class Pace:
    """How evenly frames left."""

    frames: int = 0
    late: int = 0
    """Frames that were made after their time to leave, by more than half of a frame."""
    worst: float = 0.0
    """Seconds after its time at which the latest frame left."""


@dataclass
class FramePacer:
    """Sends frames to receivers: frame k at ``start + k / fps + delay``.

    Args:
        outlets: the receivers.
        delay: seconds that a frame leaves after its sound: the session's latency, the length of a piece, and a margin.
        paced: False: frames leave when they are made.
        clock: gives seconds, which only grow.
    """

    outlets: Sequence[Outlet]
    delay: float
    paced: bool = True
    clock: Callable[[], float] = time.perf_counter  # Windows' monotonic has steps of 16 ms before Python 3.13
    pace: Pace = field(default_factory=Pace)

    def __post_init__(self) -> None:
        self._waiting: deque[Motion] = deque()
        self._condition, self._over = threading.Condition(), False
        self._start: float | None = None
        self._end: float | None = None  # of the last frame that left or waits
        self._is_sending = False  # whether the first frame has left or is about to leave
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._work, name="cospeech pacing", daemon=True)
        self._thread.start()

    @property
    def is_started(self) -> bool:
        """Whether the first sound was heard."""
        return self._start is not None

    def begin(self, seconds: float = 0.0) -> None:
        """Start the clock, when so many ``seconds`` of sound have been heard; call it before `push`."""
        self._start = self.clock() - seconds

    def push(self, motion: Motion) -> None:
        """Queue frames.

        Raises:
            Exception: what an outlet raised; no frame leaves any more.
        """
        with self._condition:
            if self._error is not None:
                raise self._error
            if len(motion):
                self._waiting.extend(motion[k : k + 1] for k in range(len(motion)))
                self._end = motion.start + len(motion) / motion.fps
            self._condition.notify()

    def take_back(self) -> float | None:
        """Forget the frames that wait. Give the time of the next frame to leave; None where none has left or is about to."""
        with self._condition:
            self._end = self._waiting[0].start if self._waiting else self._end
            self._waiting.clear()
            return self._end if self._is_sending else None

    def close(self, *, drop: bool = False) -> Pace:
        """Wait until all frames have left; with ``drop``, forget those that have not.

        Raises:
            Exception: what an outlet raised; the frames after it have not left.
        """
        with self._condition:
            if drop:
                self.take_back()
            self._over = True
            self._condition.notify()
        self._thread.join()
        if self._error is not None:
            raise self._error
        return self.pace

    def _work(self) -> None:
        """Send frames, in a thread."""
        try:
            self._send_all()
        except Exception as error:  # it is raised again where frames are pushed
            with self._condition:
                self._error = error
                self._waiting.clear()

    def _send_all(self) -> None:
        while (frame := self._next()) is not None:
            if self.paced and self._start is not None:
                due = self._start + frame.start + self.delay
                self._sleep_until(due)
                behind = self.clock() - due
                self.pace.worst = max(self.pace.worst, behind)
                self.pace.late += behind > 0.5 / frame.fps
            self.pace.frames += 1
            for outlet in self.outlets:
                outlet.send(frame)

    def _next(self) -> Motion | None:
        with self._condition:
            while not self._waiting and not self._over:
                self._condition.wait()
            if not self._waiting:
                return None
            self._is_sending = True
            return self._waiting.popleft()

    def _sleep_until(self, due: float) -> None:
        while (rest := due - self.clock()) > 0:
            time.sleep(rest)
