"""WebSockets (the extra ``live``): to a server of yours, or as the server that a page or a game connects to."""

from __future__ import annotations

import re
import threading
from contextlib import ExitStack, suppress
from typing import Any

from ...errors import InputError, describe_extra

__all__ = ["CLIENT", "WebSocketServer", "WebSocketWire", "import_websockets", "serve_here"]

MESSAGE = 1 << 20  # bytes of a message that is received, at most
_PATIENCE = 2.0  # seconds until an attempt to connect is given up (ours)
CLIENT: dict[str, Any] = {"open_timeout": _PATIENCE, "close_timeout": _PATIENCE, "max_size": MESSAGE}
_LOCAL = re.compile(r"(null|https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?)")
"""Pages that may connect: those of this machine, and files. Programs send no origin."""


def import_websockets() -> None:
    """See that the library is there.

    Raises:
        InputError: it is not installed.
    """
    try:
        import websockets  # noqa: F401
    except ImportError:
        raise InputError("WebSockets need the package websockets", describe_extra("live")) from None


def serve_here(serve: Any, handler: Any, host: str, port: int) -> Any:
    """A server for programs and for pages of this machine."""
    try:
        return serve(handler, host, port, origins=[None, _LOCAL], max_size=MESSAGE, close_timeout=_PATIENCE)
    except OSError as error:
        raise InputError(
            f"cannot listen on {host}:{port}: {error.strerror or error}", "choose another port, or an address of this machine"
        ) from None


class WebSocketWire:
    """A client: messages go to a server. See `cospeech.export.live.outlets.Wire`."""

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
    """A server: every client that connects gets the first message, and then all that come. See `Wire`.

    Each client has a thread and a queue of its own. One that is slower than the frames misses the oldest.

    Args:
        host: address to listen on.
        port: port; 0 takes a free one (`port` tells which).
        most: messages that wait for a slow client.

    Raises:
        InputError: the address cannot be listened on.
    """

    is_refused = False
    is_alone = False
    is_needed = False

    def __init__(self, host: str, port: int, *, most: int = 120) -> None:
        import_websockets()
        from websockets.sync.server import serve

        self._first, self._most = b"", most
        self._clients: dict[int, list[bytes]] = {}
        self._changed, self._over = threading.Condition(), False
        self._server = serve_here(serve, self._serve, host, port)
        self.port: int = self._server.socket.getsockname()[1]
        threading.Thread(target=self._server.serve_forever, name="cospeech websocket server", daemon=True).start()

    def connect(self) -> None:
        """See `Wire`."""

    def send(self, data: bytes) -> None:
        """See `Wire`; the first message is kept for clients that come later."""
        with self._changed:
            self._first, self.is_alone = self._first or data, not self._clients
            for waiting in self._clients.values():
                if len(waiting) >= self._most:
                    del waiting[1]  # the oldest frame; before it, there may be the first message
                waiting.append(data)
            self._changed.notify_all()

    def close(self) -> None:
        """See `Wire`; what waits for a client is sent to it for two seconds more."""
        with self._changed:
            self._over = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: not any(self._clients.values()), _PATIENCE)
        self._server.shutdown()

    def _serve(self, connection: Any) -> None:
        from websockets.exceptions import WebSocketException

        key = id(connection)
        with self._changed:
            self._clients[key] = [self._first] if self._first else []
        with suppress(WebSocketException, OSError):
            while (data := self._next(key)) is not None:
                connection.send(data, text=True)
        with self._changed:
            del self._clients[key]
            self._changed.notify_all()

    def _next(self, key: int) -> bytes | None:
        with self._changed:
            while not self._clients[key] and not self._over:
                self._changed.wait()
            self._changed.notify_all()
            return self._clients[key].pop(0) if self._clients[key] else None
