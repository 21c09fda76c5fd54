"""WebSockets (the extra ``live``): to a server of yours, or as the server that a page or a game connects to."""

from __future__ import annotations

import re
import socket
import threading
from collections.abc import Callable
from contextlib import ExitStack, suppress
from http import HTTPStatus
from typing import Any

from ...errors import InputError, describe_extra
from .addresses import split_address

__all__ = ["CLIENT", "MOST_CLIENTS", "ORIGIN", "WebSocketServer", "WebSocketWire", "import_websockets", "serve_here"]

MESSAGE = 1 << 20  # bytes of a message that is received, at most
_PATIENCE = 2.0  # seconds until an attempt to connect is given up (ours)
CLIENT: dict[str, Any] = {"open_timeout": _PATIENCE, "close_timeout": _PATIENCE, "max_size": MESSAGE}
ORIGIN = "origin"
"""Option of ``listen://`` addresses: further origins whose pages may connect, with commas between them."""
_LOCAL = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")
"""Origins of pages that may connect: those of this machine. Programs send no origin. Files send ``null``, but so does a page of
any site that puts itself into a frame (HTML standard, sandboxed origin). So ``null`` may connect only if it is named."""
_ORIGIN = re.compile(r"null|file://|[a-z][a-z0-9+.-]*://[^/?#\s]+", re.IGNORECASE)  # RFC 6454, section 6.1
MOST_CLIENTS = 64
"""Connections at once, also before their first message [ours: pages, games and tools of one stage]. Others are cut off."""
_MOST_NOTES = 8  # refused origins that are noted ([ours]: a page that tries again has the same one)

Note = Callable[[str], object]


def import_websockets() -> None:
    """Check that the library is installed.

    Raises:
        InputError: it is not installed.
    """
    try:
        import websockets  # noqa: F401
    except ImportError:
        raise InputError("WebSockets need the package websockets", describe_extra("live")) from None


def serve_here(serve: Any, handler: Any, address: str, note: Note) -> Any:
    """Start a server for programs, for pages of this machine, and for pages of the origins that the address names.

    Args:
        serve: the function of the library.
        handler: for a connection.
        address: ``listen://HOST:PORT?origin=ORIGIN,…``.
        note: called for an origin that is refused.

    Raises:
        InputError: no such address, or it cannot be listened on.
    """
    host, port, options = split_address(address, None, query=(ORIGIN,))
    origins, refusals = _read_origins(options.get(ORIGIN, ""), address), set[str]()

    def check_origin(connection: Any, request: Any) -> Any:
        headers = request.headers.get_all("Origin")
        if not headers or (len(headers) == 1 and (_LOCAL.fullmatch(headers[0]) or headers[0].lower() in origins)):
            return None
        origin = headers[0]
        if origin not in refusals and len(refusals) < _MOST_NOTES:
            refusals.add(origin)
            names = ",".join([*sorted(origins), origin[:80]])
            what = "a file, or a page in a frame," if origin == "null" else f"a page of {origin[:80]!r}"
            note(f"{what} was refused at {address} (to let it in: {address.split('?')[0]}?{ORIGIN}={names})")
        return connection.respond(HTTPStatus.FORBIDDEN, f"pages of {origin[:80]!r} may not connect\n")

    patience = {"open_timeout": _PATIENCE, "close_timeout": _PATIENCE}
    try:
        server = serve(handler, host, port, process_request=check_origin, max_size=MESSAGE, **patience)
    except OSError as error:
        raise InputError(
            f"cannot listen on {host}:{port}: {error.strerror or error}", "choose another port, or an address of this machine"
        ) from None
    server.handler = _limit_clients(server.handler)
    return server


def _limit_clients(serve_client: Callable[[socket.socket, Any], None]) -> Callable[[socket.socket, Any], None]:
    """Limit ``serve_client`` of the library, which has two threads for each client, to `MOST_CLIENTS` at once."""
    free = threading.BoundedSemaphore(MOST_CLIENTS)

    def serve_if_free(client: socket.socket, address: Any) -> None:
        is_free = free.acquire(blocking=False)
        if not is_free:
            client.close()  # the library sees that, and forgets the client
        try:
            serve_client(client, address)
        finally:
            if is_free:
                free.release()

    return serve_if_free


def _read_origins(text: str, address: str) -> set[str]:
    origins = {origin.strip().lower() for origin in text.split(",") if origin.strip()}
    for origin in sorted(origins):
        if not _ORIGIN.fullmatch(origin):
            raise InputError(f"{ORIGIN}={origin[:80]!r} in {address[:80]!r}", "such as https://example.org, or null for files")
    return origins


class WebSocketWire:
    """A client that sends messages to a server. See `cospeech.export.live.outlets.Wire`."""

    is_refused = False
    is_alone = False
    is_needed = False

    def __init__(self, url: str) -> None:
        import_websockets()
        self._url, self._stack = url, ExitStack()
        self._connection: Any = None

    def connect(self) -> None:
        """See `Wire`."""
        from websockets.exceptions import WebSocketException
        from websockets.sync.client import connect

        self.close()
        try:
            self._connection = self._stack.enter_context(connect(self._url, **CLIENT))
        except WebSocketException as error:
            raise ConnectionError(str(error)) from None

    def send(self, data: bytes) -> None:
        """See `Wire`; a text message."""
        from websockets.exceptions import WebSocketException

        try:
            self._connection.send(data, text=True)
        except WebSocketException as error:
            raise ConnectionError(str(error)) from None

    def close(self) -> None:
        """See `Wire`."""
        self._stack.close()


class WebSocketServer:
    """A server: every client that connects gets the first message, and then all new ones. See `Wire`.

    Each client has a thread and a queue of its own. One that is slower than the frames misses the oldest.

    Args:
        address: ``listen://HOST:PORT?origin=…``, see `serve_here`; port 0 takes a free one, which is `port`.
        note: called for pages that are refused.
        most: messages that wait for a slow client.

    Raises:
        InputError: the address cannot be listened on.
    """

    is_refused = False
    is_alone = False
    is_needed = False

    def __init__(self, address: str, *, note: Note = lambda text: None, most: int = 120) -> None:
        import_websockets()
        from websockets.sync.server import serve

        self._first, self._most = b"", most
        self._clients: dict[int, list[bytes]] = {}
        self._condition, self._over = threading.Condition(), False
        self._server = serve_here(serve, self._serve, address, note)
        self.port: int = self._server.socket.getsockname()[1]
        threading.Thread(target=self._server.serve_forever, name="cospeech websocket server", daemon=True).start()

    def connect(self) -> None:
        """See `Wire`."""

    def send(self, data: bytes) -> None:
        """See `Wire`; the first message is kept for clients that come later."""
        with self._condition:
            self._first, self.is_alone = self._first or data, not self._clients
            for waiting in self._clients.values():
                if len(waiting) >= self._most:
                    del waiting[1]  # the oldest frame; before it, there may be the first message
                waiting.append(data)
            self._condition.notify_all()

    def close(self) -> None:
        """See `Wire`; messages that wait for a client are sent for two seconds more."""
        with self._condition:
            self._over = True
            self._condition.notify_all()
            self._condition.wait_for(lambda: not any(self._clients.values()), _PATIENCE)
        self._server.shutdown()

    def _serve(self, connection: Any) -> None:
        from websockets.exceptions import WebSocketException

        key = id(connection)
        with self._condition:
            self._clients[key] = [self._first] if self._first else []
        with suppress(WebSocketException, OSError):
            while (data := self._next(key)) is not None:
                connection.send(data, text=True)
        with self._condition:
            del self._clients[key]
            self._condition.notify_all()

    def _next(self, key: int) -> bytes | None:
        with self._condition:
            while not self._clients[key] and not self._over:
                self._condition.wait()
            self._condition.notify_all()
            return self._clients[key].pop(0) if self._clients[key] else None
