"""The local web server, which controls who may send requests, how much, and what a page may load.

All our pages are served through `Guard`. It refuses foreign hosts and origins, and large and slow requests. It asks for a token
if the server is open to a network, and adds the headers that keep a page from loading anything from elsewhere.
"""

from __future__ import annotations

import asyncio
import hashlib
import ipaddress
import re
import secrets
import socket
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from http.cookies import CookieError, SimpleCookie
from importlib import import_module
from typing import Any
from urllib.parse import parse_qs, urlsplit

from ..errors import InputError, InternalError

__all__ = [
    "Guard",
    "is_loopback",
    "list_addresses",
    "load_web",
    "make_token",
    "name_cookie",
    "open_socket",
    "run_server",
    "server_of",
]

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

MESSAGE_BYTES = 1 << 20
"""Bytes of a request or a message of a WebSocket [ours: an answer has some hundred bytes]."""
REQUEST_SECONDS = 10.0
"""Seconds until a request must be complete [ours: some hundred bytes take no time on the slowest line]."""
MOST_HELD = 256 << 20
"""Bytes of all requests that are held at the same time [ours: what a small machine can spare]."""
CONNECTIONS = 400
"""Connections at the same time [ours: below the 1024 open files that systems usually allow]. Others are answered 503."""
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; media-src 'self'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content-Security-Policy: all resources come from this server, and the page has no inline code."""
HEADERS = {
    "content-security-policy": POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), geolocation=(), microphone=()",
    "cache-control": "no-store",
}
_ALL = {"0.0.0.0": ("127.0.0.1", "192.0.2.1"), "::": ("::1", "2001:db8::1")}
"""Wildcard address → the machine's own loopback address, and an address that nobody has (RFC 5737, RFC 3849)."""
_HOST = re.compile(r"[A-Za-z0-9.:\[\]_-]{1,255}")


def load_web(module: str) -> Any:
    """Import a module of the extra ``studio`` by name, such as ``"starlette.routing"`` or ``"uvicorn"``.

    Raises:
        InputError: it is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError:
        raise InputError(f"local pages need {module.partition('.')[0]}", "in a clone: make studio") from None


def is_loopback(host: str) -> bool:
    """Whether an address to listen at can be reached from this machine alone."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def make_token() -> str:
    """A secret that cannot be guessed: 128 random bits."""
    return secrets.token_urlsafe(16)


def name_cookie(token: str) -> str:
    """Name of the cookie that holds a token. It depends on the token, since cookies of all ports of a machine are shared."""
    return f"cospeech-{hashlib.sha256(token.encode()).hexdigest()[:8]}"


def _host_name(host: str) -> str:
    """The name in a ``Host`` header, without its port."""
    return (urlsplit(f"//{host}").hostname or "") if host else ""


class Guard:
    """Passes on requests of this server's own pages, and answers all others itself.

    Args:
        app: the application behind it.
        token: secret that every client must send, as ``?token=``, as a cookie or as ``Authorization: Bearer``. None: no secret
            is needed, but the client must call this machine by a loopback name (against DNS rebinding).
        limit: bytes of a request.
        seconds: until a request is complete.
        headers: of every answer; in the policy, ``{host}`` stands for the address that the client uses for this server.
        takes_files: whether the application reads the body of a request itself, piece by piece, with its own limits.
    """

    def __init__(
        self, app: App, *, token: str | None = None, limit: int = MESSAGE_BYTES, seconds: float = REQUEST_SECONDS,
        headers: Mapping[str, str] = HEADERS, takes_files: Callable[[Scope], bool] = lambda scope: False,
    ) -> None:  # fmt: skip
        self._app, self._token, self._limit, self._seconds = app, token, limit, seconds
        self._headers, self._takes_files, self._held_bytes = headers, takes_files, 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        refusal = self._refuse(scope, headers)
        send_on = send if scope["type"] == "websocket" else _with_headers(send, self._headers, headers.get("host", ""))
        if scope["type"] == "websocket":
            if refusal or "origin" not in headers:
                await receive()
                await send({"type": "websocket.close", "code": 4403})
            else:
                await self._app(scope, receive, send)
            return
        if refusal is None and self._brings_token(scope):
            cookie = f"{name_cookie(self._token or '')}={self._token}; Path=/; HttpOnly; SameSite=Strict"
            await _answer(send_on, 303, "", {"location": _without_token(scope), "set-cookie": cookie})
            return
        if refusal is None and self._takes_files(scope):
            await self._app(scope, receive, send_on)
            return
        body: bytes | tuple[int, str] = refusal or await self._body(headers, receive)
        if isinstance(body, tuple):
            await _answer(send_on, *body)
            return
        try:
            await self._app(scope, _replay(body, receive), send_on)
        finally:
            self._held_bytes -= len(body)

    def _refuse(self, scope: Scope, headers: dict[str, str]) -> tuple[int, str] | None:
        """Status and text with which a request is refused; None: it is not refused."""
        host = headers.get("host", "")
        try:
            name, origin = _host_name(host), headers.get("origin")
            own = origin is None or (urlsplit(origin).scheme in ("http", "https") and urlsplit(origin).netloc == host)
        except ValueError:
            return 400, "the address cannot be read"
        if self._token is None and not is_loopback(name):
            return 421, "this server answers to localhost only"
        if not own:
            return 403, "this page may not ask this server"
        if scope.get("method") not in (None, "GET", "HEAD") and headers.get("sec-fetch-site", "none") == "cross-site":
            return 403, "this page may not ask this server"
        if self._token is not None:
            tokens = _tokens(scope, headers, name_cookie(self._token))
            if not any(secrets.compare_digest(each, self._token) for each in tokens):
                return 401, "the address lacks the token that the server has printed"
        return None

    def _brings_token(self, scope: Scope) -> bool:
        """Whether the token is in the address; it then goes into a cookie."""
        return self._token is not None and scope.get("method") == "GET" and "token" in _query(scope)

    async def _body(self, headers: dict[str, str], receive: Receive) -> bytes | tuple[int, str]:
        """The whole body of a request, or status and text of the answer to a request that is too large or too slow."""
        length = headers.get("content-length", "0")
        if not (length.isascii() and length.isdigit()):
            return 400, "the length cannot be read"
        if int(length) > self._limit:
            return 413, f"at most {self._limit} bytes"
        body, more, is_complete = bytearray(), True, False
        try:
            async with asyncio.timeout(self._seconds):
                while more:
                    message = await receive()
                    if message["type"] == "http.disconnect":
                        return 400, "the request is not complete"
                    body += message.get("body", b"")
                    self._held_bytes += len(message.get("body", b""))
                    more = message.get("more_body", False)
                    if len(body) > self._limit:
                        return 413, f"at most {self._limit} bytes"
                    if self._held_bytes > MOST_HELD:
                        return 503, "the server is busy"
            is_complete = True
        except TimeoutError:
            return 408, "the request is too slow"
        finally:
            self._held_bytes -= 0 if is_complete else len(body)
        return bytes(body)


def _query(scope: Scope) -> dict[str, list[str]]:
    try:
        return parse_qs(scope.get("query_string", b"").decode("ascii"), max_num_fields=20)
    except ValueError:
        return {}


def _without_token(scope: Scope) -> str:
    """Address of the same page without the token, to which a browser goes when its cookie has the token."""
    participant = _query(scope).get("participant", [""])[0]
    query = f"?participant={participant}" if participant.isascii() and participant.isalnum() else ""
    return f"./{query}"


def _tokens(scope: Scope, headers: dict[str, str], name: str) -> list[str]:
    """All values that a client sends as the token."""
    tokens = _query(scope).get("token", [])[:1]
    try:
        cookie = SimpleCookie(headers.get("cookie", ""))
        tokens += [cookie[name].value] if name in cookie else []
    except CookieError:
        pass
    scheme, _, value = headers.get("authorization", "").partition(" ")
    tokens += [value] if scheme.lower() == "bearer" else []
    return [token for token in tokens if token.isascii()]


def _replay(body: bytes, receive: Receive) -> Receive:
    """A ``receive`` that first returns a request that was read before, and then new messages."""
    is_sent = False

    async def again() -> Message:
        nonlocal is_sent
        if is_sent:
            return await receive()
        is_sent = True
        return {"type": "http.request", "body": body, "more_body": False}

    return again


def _with_headers(send: Send, headers: Mapping[str, str], host: str) -> Send:
    """A ``send`` that adds the headers of every answer; a host with invalid characters is left out."""
    safe_host = host if _HOST.fullmatch(host) else ""

    async def more(message: Message) -> None:
        if message["type"] == "http.response.start":
            raw = [(name, value) for name, value in message.get("headers", []) if name.decode("latin-1").lower() not in headers]
            raw += [(name.encode(), value.replace("{host}", safe_host).encode()) for name, value in headers.items()]
            message = {**message, "headers": raw}
        await send(message)

    return more


async def _answer(send: Send, status: int, text: str, headers: dict[str, str] | None = None) -> None:
    """Send a short answer of the guard. It ends the connection, because the rest of the request may still come."""
    own = {"content-type": "text/plain; charset=utf-8", "content-length": str(len(text.encode())), "connection": "close"}
    raw = [(name.encode(), value.encode("latin-1")) for name, value in (own | (headers or {})).items()]
    await send({"type": "http.response.start", "status": status, "headers": raw})
    await send({"type": "http.response.body", "body": text.encode()})


# serving --------------------------------------------------------------------------------------------------------------


def open_socket(host: str, port: int) -> socket.socket:
    """Open a listening socket; port 0 chooses a free port.

    Raises:
        InputError: the port is taken, or the address does not belong to this machine.
    """
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)  # only with TCP given, asyncio sends at once
    except OSError as error:
        raise InternalError(f"no socket: {error.strerror}") from None
    try:
        # On Windows SO_REUSEADDR lets two programs have one port; without it, a port is free again at once.
        option = getattr(socket, "SO_EXCLUSIVEADDRUSE", socket.SO_REUSEADDR)
        listener.setsockopt(socket.SOL_SOCKET, option, 1)
        listener.bind((host, port))
        listener.listen(256)
    except (OSError, OverflowError) as error:
        listener.close()
        why = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot listen at {host} port {port}: {why}", "choose another --port, or 0 for any") from None
    return listener


def list_addresses(host: str, listening: socket.socket, token: str | None) -> list[str]:
    """Addresses of a server at a listening socket, for browsers, with the token, if any.

    If a server listens at all addresses of its machine, the first one is for browsers of the same machine; it counts as secure
    (microphone, clipboard). The others are for browsers of other machines.
    """
    names = [host]
    if host in _ALL:
        own, far = _ALL[host]
        names = [own, _find_outward(far) or socket.gethostname()]
    port, query = listening.getsockname()[1], f"?token={token}" if token else ""
    hosts = [f"[{name}]" if ":" in name else name for name in names]
    return [f"http://{name}:{port}/{query}" for name in hosts]


def _find_outward(far: str) -> str | None:
    """The address from which this machine would call another one; no packet is sent. None without a network."""
    try:
        with socket.socket(socket.AF_INET6 if ":" in far else socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.connect((far, 9))
            return str(line.getsockname()[0])
    except OSError:
        return None


def server_of(app: App, *, websockets: bool = False) -> Any:
    """Make the server of an application. It runs with ``run(sockets=[…])``, and ends when ``should_exit`` is set.

    Args:
        app: the application.
        websockets: whether it uses WebSockets, whose messages have at most `MESSAGE_BYTES`.
    """
    if websockets:
        load_web("websockets")
    uvicorn = load_web("uvicorn")
    base = import_module("uvicorn.protocols.http.h11_impl").H11Protocol

    class Protocol(base):  # type: ignore[misc,valid-type]
        """HTTP that closes a connection if no request is complete within `REQUEST_SECONDS`."""

        def __init__(self, *arguments: Any, **keywords: Any) -> None:
            super().__init__(*arguments, **keywords)
            self.loop.call_later(REQUEST_SECONDS, self.look, None)

        def look(self, before: Any) -> None:
            """Close the connection if no request was completed since the last look; ``before``: the request at that time."""
            if self.transport is None or self.transport.is_closing() or self.transport.get_protocol() is not self:
                return  # it is closed, or has become a WebSocket
            if before is self.cycle and (self.cycle is None or self.cycle.response_complete):
                self.transport.close()
            else:
                self.loop.call_later(REQUEST_SECONDS, self.look, self.cycle)

    config = uvicorn.Config(
        app, http=Protocol, ws="websockets-sansio" if websockets else "none", ws_max_size=MESSAGE_BYTES,
        ws_per_message_deflate=False, loop="asyncio", lifespan="off", interface="asgi3", log_config=None, access_log=False,
        server_header=False, date_header=False, proxy_headers=False, limit_concurrency=CONNECTIONS, timeout_keep_alive=30,
        timeout_graceful_shutdown=2, h11_max_incomplete_event_size=1 << 15,
    )  # fmt: skip
    return uvicorn.Server(config)


def run_server(app: App, listening: socket.socket, *, websockets: bool = False) -> None:
    """Serve an application until the program is interrupted; for ``websockets`` see `server_of`."""
    with listening:
        server_of(app, websockets=websockets).run(sockets=[listening])
