"""Addresses of receivers and of sources: ``scheme://host:port?key=value``."""

from __future__ import annotations

from collections.abc import Iterable
from urllib.parse import parse_qs, urlsplit

from ...errors import InputError

__all__ = ["SOURCES", "scheme_of", "split_address", "unknown_address"]

SOURCES = ("ws", "wss", "listen")
"""Schemes of addresses that sound and messages can come from."""
_PORT = 8765  # of WebSockets, in hints [ours: the port of the websockets library's own examples]


def scheme_of(address: str) -> str:
    """The scheme before ``://``, in small letters; empty where there is none.

    >>> scheme_of("WS://127.0.0.1:80"), scheme_of("talk.wav")
    ('ws', '')
    """
    scheme, mark, _ = address.partition("://")
    return scheme.lower() if mark else ""


def unknown_address(what: str, schemes: Iterable[str]) -> InputError:
    """The error of an address whose scheme cannot be used.

    >>> str(unknown_address("cannot send to 'x://y'", ["-", "ws"]))
    "cannot send to 'x://y' (known: -, ws://)"
    """
    return InputError(what, f"known: {', '.join(each if each == '-' else f'{each}://' for each in schemes)}")


def split_address(url: str, port: int | None, *, query: tuple[str, ...] = ()) -> tuple[str, int, dict[str, str]]:
    """``scheme://host:port?key=value`` → host, port and options.

    Args:
        port: where the address has none; None: it must have one.
        query: options that are known.

    Raises:
        InputError: no host, no port or port 0 (but of ``listen://``, where it takes a free one), a path, or an unknown option.
    """
    scheme = scheme_of(url)
    hint = f"write {scheme}://127.0.0.1:{_PORT if scheme in SOURCES else port}"
    try:
        parts = urlsplit(url)
        number = port if parts.port is None else parts.port
    except ValueError:
        raise InputError(f"{url!r} is no address", hint) from None
    options = {key: values[-1] for key, values in parse_qs(parts.query, keep_blank_values=True).items()}
    if not parts.hostname or number is None:
        raise InputError(f"{url!r} has no {'port' if parts.hostname else 'host'}", hint)
    if number == 0 and scheme != "listen":
        raise InputError(f"{url!r} has port 0, at which nobody listens", hint)
    if parts.path.strip("/") and scheme not in ("ws", "wss"):
        raise InputError(f"{url!r} has a path {parts.path[:40]!r}", hint)
    for key in options:
        if key not in query:
            raise InputError(f"{url!r} has an unknown option {key!r}", f"known: {', '.join(query) or 'none'}")
    return parts.hostname, number, options
