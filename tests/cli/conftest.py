"""What the tests of the command line share."""

from __future__ import annotations

import signal

import pytest


@pytest.fixture(autouse=True)
def _own_signals():
    """The command line handles SIGTERM; the next test shall not."""
    before = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, before)
