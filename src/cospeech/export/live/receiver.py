"""Receive sound and messages over WebSockets (the extra ``live``): from a server, or from clients that connect to us."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any

from ...errors import InputError
from .addresses import SOURCES, scheme_of, split_address, unknown_address
from .websocket import CLIENT, import_websockets, serve_here

__all__ = ["open_receiver"]

_MESSAGES = 64  # that may wait, of 1 MiB at most; then their sender waits (ours: a second of pieces)
_LOOK = 0.1  # seconds between two checks whether the server ends, while messages wait (ours)


@contextmanager
def open_receiver(address: str, note: Callable[[str], object] = lambda text: None) -> Iterator[Iterator[str | bytes]]:
    """Messages that come in, until the other side closes.

    Args:
        address: ``ws://`` or ``wss://`` of a server; or ``listen://HOST:PORT``, where the first client that comes is heard,
            and after it the next one (``?origin=…``: `cospeech.export.live.websocket.serve_here`).
        note: called once if a second client comes while the first one is heard; and for pages that are refused.

    Raises:
        InputError: another scheme, nobody answers at the address, or it cannot be listened on.
    """
    if (scheme := scheme_of(address)) not in SOURCES:
        raise unknown_address(f"cannot hear from {address!r}", SOURCES)
    import_websockets()
    if scheme == "listen":
        with _listening(address, note) as messages:
            yield messages
        return
    from websockets.exceptions import WebSocketException
    from websockets.sync.client import connect

    split_address(address.split("?")[0], 443 if scheme == "wss" else 80)
    with ExitStack() as stack:
        try:
            connection = stack.enter_context(connect(address, **CLIENT))
        except (OSError, WebSocketException) as error:
            raise InputError(f"nobody answers at {address!r}: {error}"[:200], "is the server running?") from None
        yield _hear_to_the_end(connection)


def _hear_to_the_end(connection: Any) -> Iterator[str | bytes]:
    """Messages up to the end, also where the other side goes without closing."""
    from websockets.exceptions import ConnectionClosed

    with suppress(ConnectionClosed):
        yield from connection


@contextmanager
def _listening(address: str, note: Callable[[str], object]) -> Iterator[Iterator[str | bytes]]:
    from websockets.sync.server import serve

    messages: queue.Queue[str | bytes] = queue.Queue(_MESSAGES)
    one, has_warned, over = threading.Lock(), threading.Event(), threading.Event()

    def pass_on(message: str | bytes) -> bool:
        while not over.is_set():
            with suppress(queue.Full):
                messages.put(message, timeout=_LOOK)
                return True
        return False

    def hear(connection: Any) -> None:
        if one.locked() and not has_warned.is_set():
            has_warned.set()
            note(f"a second client waits at {address} until the first one has gone")
        with one:  # one voice at a time
            pass_on(b"")  # a new voice begins with a whole sample
            for message in _hear_to_the_end(connection):
                if not pass_on(message):
                    return

    server = serve_here(serve, hear, address, note)
    threading.Thread(target=server.serve_forever, name="cospeech sound server", daemon=True).start()
    try:
        yield iter(messages.get, None)
    finally:
        over.set()
        server.shutdown()
