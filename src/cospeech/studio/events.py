"""Send events of takes from any thread to all pages that listen."""

from __future__ import annotations

import asyncio
import threading
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress

from .messages import TakeEvent

__all__ = ["EventHub", "Listener", "OpenPages"]

_MOST = 500  # events that may wait for a page [ours: half a minute of a busy server]
_GOING_AWAY = 1001  # code of a close: the page is left (RFC 6455)
_GRACE = 5.0  # seconds [ours: a page tries every second to restore a lost connection]


class Listener:
    """The events that wait for one page; it belongs to one event loop."""

    def __init__(self) -> None:
        self.loop = asyncio.get_running_loop()
        self._waiting: deque[TakeEvent] = deque()
        self._change = asyncio.Event()
        self.is_behind = False
        """Whether the page has taken no event for so long that some are lost."""

    def put(self, event: TakeEvent) -> None:
        """Queue an event; progress replaces earlier progress of the same take. Called by the loop."""
        last = self._waiting[-1] if self._waiting else None
        if last is not None and last.type == event.type == "progress" and last.take == event.take:
            self._waiting.pop()
        if len(self._waiting) >= _MOST:
            self.is_behind = True
        else:
            self._waiting.append(event)
        self._change.set()

    async def take(self) -> TakeEvent:
        """The next event."""
        while not self._waiting:
            self._change.clear()
            await self._change.wait()
        return self._waiting.popleft()


class OpenPages:
    """Keeps track of the open pages. If a page leaves and does not come back in time, ``leave`` is called once.

    All calls come from one event loop.

    Args:
        leave: called in a thread with the name of a page that has left.
        grace: seconds until a page whose connection was lost has left.
    """

    def __init__(self, leave: Callable[[str], None], grace: float = _GRACE) -> None:
        self._leave, self._grace = leave, grace
        self._open: Counter[str] = Counter()

    def enter(self, page: str) -> None:
        """Note that a page listens."""
        self._open[page] += 1

    def close(self, page: str, code: int) -> None:
        """Note that a page does not listen any more; ``code``: close code of its WebSocket."""
        self._open[page] -= 1
        self.expect(page, 0.0 if code == _GOING_AWAY else self._grace)

    def expect(self, page: str, seconds: float | None = None) -> None:
        """If a page does not listen after so many seconds (by default the grace), it has left."""
        asyncio.get_running_loop().call_later(self._grace if seconds is None else seconds, self._look, page)

    def _look(self, page: str) -> None:
        if self._open[page] <= 0:
            del self._open[page]
            asyncio.get_running_loop().run_in_executor(None, self._leave, page)


class EventHub:
    """Gives events to all listeners. `publish` may be called from any thread."""

    def __init__(self) -> None:
        self._listeners: set[Listener] = set()
        self._lock = threading.Lock()

    def publish(self, event: TakeEvent) -> None:
        """Send an event to all listeners."""
        with self._lock:
            listeners = list(self._listeners)
        for listener in listeners:
            with suppress(RuntimeError):  # its loop has ended
                listener.loop.call_soon_threadsafe(listener.put, event)

    def add(self, listener: Listener) -> None:
        """Add a listener; it gets all events from now on."""
        with self._lock:
            self._listeners.add(listener)

    def remove(self, listener: Listener) -> None:
        """Remove a listener; it gets no more events."""
        with self._lock:
            self._listeners.discard(listener)
