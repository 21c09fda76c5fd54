"""The progress bar of the commands."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from .standard_streams import find_bar_stream

__all__ = ["Tell", "show_progress"]


class Tell(Protocol):
    """The function that moves a bar. A type checker then sees whether a command calls it with other arguments."""

    def __call__(self, amount: float, total: float | None, word: str = "", /) -> None:
        """Show how much is done, of how much (None: not known), and the name of the step."""


@contextmanager
def show_progress(title: str, quiet: bool) -> Iterator[Tell | None]:
    """A progress bar on stderr.

    Args:
        title: of the bar.
        quiet: show none.

    Yields:
        A function that the work calls with (amount done, total or None, name of the step). The bar appears with the first call
        after a second. None if nobody would see a bar: with ``quiet``, or if stderr is no terminal.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from time import monotonic

    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress

    bar, start = Progress(console=Console(file=find_bar_stream()), transient=True), monotonic()
    task = bar.add_task(title, total=None)

    def tell(amount: float, total: float | None, word: str = "") -> None:
        if not bar.live.is_started and monotonic() - start > 1:
            bar.start()
        bar.update(task, completed=amount, total=total, description=escape(f"{title} {word}".rstrip()))

    try:
        yield tell
    finally:
        bar.stop()
