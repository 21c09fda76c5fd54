"""Signals that would end the program, noted so that what is under way can be ended first."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

__all__ = ["heeding"]


@contextmanager
def heeding() -> Iterator[list[int]]:
    """A list that gets the number of a signal that would end the program; a second one ends it at once."""
    heard: list[int] = []
    before: dict[int, Any] = {}

    def note(number: int, frame: object) -> None:
        heard.append(number)
        put_back()

    def put_back() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    if threading.current_thread() is threading.main_thread():
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)  # Windows has no SIGHUP
            if number is not None and signal.getsignal(number) not in (signal.SIG_IGN, None):
                before[number] = signal.signal(number, note)
    try:
        yield heard
    finally:
        put_back()
