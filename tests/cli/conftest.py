"""What the tests of the command line share."""

from __future__ import annotations

import signal

import pytest


@pytest.fixture(autouse=True)
def _own_signals():
    """Restore the handlers of signals that the command line sets, for the next test."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
