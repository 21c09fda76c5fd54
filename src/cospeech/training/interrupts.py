"""Signals that would end the program: they are noted, so that the work can be finished, or given up in order."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

__all__ = ["SignalWatch", "Stopped", "defer_signals", "list_stop_signals"]


def list_stop_signals() -> list[signal.Signals]:
    """The signals of this system that ask a program to end: Ctrl-C, `kill`, and a terminal that is closed.

    Those that the program ignores from the start, as under nohup, are not among them.
    """
    names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # Windows has no SIGHUP, and SIGBREAK alone
    there = [getattr(signal, name) for name in names if hasattr(signal, name)]
    return [number for number in there if signal.getsignal(number) is not signal.SIG_IGN]


class Stopped(BaseException):
    """A signal has asked to stop, within `SignalWatch.raise_at_once`. Like KeyboardInterrupt, it is no `Exception`."""


class SignalWatch:
    """The signals that have come.

    Attributes:
        numbers: the number of each signal; empty before the first one.
    """

    def __init__(self) -> None:
        self.numbers: list[int] = []
        self._at_once = False

    @contextmanager
    def raise_at_once(self, yes: bool = True) -> Iterator[None]:
        """Within it, a signal raises `Stopped` at once, wherever the program is: for work that can be thrown away.

        Args:
            yes: whether it does; False: the signal is only noted.
        """
        self._at_once = yes
        try:
            if yes and self.numbers:
                raise Stopped
            yield
        finally:
            self._at_once = False

    def note(self, number: int) -> None:
        """Note a signal that has come."""
        self.numbers.append(number)
        if self._at_once:
            self._at_once = False
            raise Stopped


@contextmanager
def defer_signals(tell: Callable[[], None] | None = None) -> Iterator[SignalWatch]:
    """Within it, note a signal that would end the program; a second one ends it at once.

    Args:
        tell: called when the first one comes.
    """
    watch = SignalWatch()
    before: dict[int, Any] = {}

    def note(number: int, frame: object) -> None:
        put_back()
        if tell is not None:
            with suppress(RuntimeError):  # it came while the same stream was being written to
                tell()
        watch.note(number)

    def put_back() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    if threading.current_thread() is threading.main_thread():
        for number in list_stop_signals():
            if signal.getsignal(number) is not None:  # None: a handler outside of Python, which could not be put back
                before[number] = signal.signal(number, note)
    try:
        yield watch
    finally:
        put_back()
