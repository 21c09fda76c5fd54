"""``cospeech studio``: it serves the local web page on which motion is made, edited, compared and downloaded."""

from __future__ import annotations

import threading
import webbrowser
from typing import Annotated

import typer
from typer import Option

from .options import Debug, Port, option

__all__ = ["register"]

Host = Annotated[
    str,
    option(
        "--host",
        metavar="ADDRESS",
        help="Address to listen at. Any other than 127.0.0.1 opens the page to a network; then it needs the token of the "
        "printed address.",
    ),
]
Token = Annotated[
    str | None,
    option(
        "--token",
        metavar="TEXT",
        help="Secret that every client must send. auto makes a random one, which also keeps out other users of this machine. "
        "Default: auto for a --host that others can reach.",
    ),
]
NoBrowser = Annotated[bool, Option("--no-browser", help="Do not open the page in a browser.")]
_RANDOM = "auto"
_TOKEN = (8, 128)  # characters [ours: shorter ones can be guessed]


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(studio)


def studio(
    host: Host = "127.0.0.1",
    port: Port = 8765,
    token: Token = None,
    no_browser: NoBrowser = False,
    debug: Debug = False,
) -> None:
    """Open a local page to make, edit and compare motion.

    It runs on this machine until Ctrl-C. When it ends, it keeps no file.

    \b
    cospeech studio
    cospeech studio --port 0 --no-browser
    """
    from ..errors import InputError
    from ..studio.server import is_loopback, list_addresses, load_web, make_token, open_socket, run_server

    for module in ("starlette.applications", "uvicorn", "websockets"):
        load_web(module)
    if token == _RANDOM or (token is None and not is_loopback(host)):
        token = make_token()
    elif token is not None and not (_TOKEN[0] <= len(token) <= _TOKEN[1] and token.isascii() and token.isalnum()):
        raise InputError("the token cannot be used", f"{_TOKEN[0]} … {_TOKEN[1]} letters and digits")
    listening = open_socket(host, port)
    from ..studio.app import make_app
    from ..studio.state import StudioState

    address, *others = list_addresses(host, listening, token)
    with StudioState() as state:
        app = make_app(state, token=token)
        state.start_warm_up()
        typer.echo(f"the studio is at {address}  (Ctrl-C ends)")
        for other in others:
            typer.echo(f"  from other computers: {other}")
        if not no_browser:
            threading.Thread(target=webbrowser.open, args=(address,), name="cospeech browser", daemon=True).start()
        run_server(app, listening, websockets=True)
