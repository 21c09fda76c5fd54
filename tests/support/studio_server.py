"""The studio's server in a thread, and a page that talks to it."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cospeech.studio.app import make_app
from cospeech.studio.state import StudioState
from tests.support.study_raters import ask, running


@contextmanager
def studio(**options: Any) -> Iterator[tuple[int, StudioState]]:
    """Serve a studio; yields the port and the state."""
    with StudioState() as state, running(make_app(state, **options), websockets=True) as port:
        yield port, state


@contextmanager
def open_websocket(port: int, path: str, **options: Any) -> Iterator[Any]:
    """A WebSocket of a page of this server."""
    from websockets.sync.client import connect

    origin = options.pop("origin", f"http://127.0.0.1:{port}")
    with connect(f"ws://127.0.0.1:{port}{path}", origin=origin, open_timeout=30, **options) as socket:
        yield socket


def ask_json(port: int, path: str, body: Any = None, **options: Any) -> Any:
    """One request that succeeds; the JSON of its answer."""
    status, _, content = ask(port, path, body, **options)
    assert status == 200, content
    return json.loads(content)


def wait_for(state: StudioState, take: str, seconds: float = 60.0) -> Any:
    """The last event of a take that is over."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        event = state.takes.find(take).event
        if event.type not in ("queued", "progress"):
            return event
        time.sleep(0.02)
    raise AssertionError("the take is not over")


def list_files(folder: Path) -> list[str]:
    """All files below a folder; a folder that goes away meanwhile has none."""
    walk = os.walk(folder)  # Path.rglob raises where a folder goes away
    return sorted(os.path.relpath(Path(place, name), folder) for place, _, names in walk for name in names)
