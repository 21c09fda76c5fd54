"""The web application of the studio: the built page, and the calls of `cospeech.studio.api` and `cospeech.studio.sockets`."""

from __future__ import annotations

import mimetypes
from pathlib import Path
from typing import Any

from .api import StudioApi, answer_errors
from .server import HEADERS, Guard, Scope, load_web
from .sockets import StudioSockets
from .state import StudioState

__all__ = ["PAGE", "make_app"]

PAGE = Path(__file__).resolve().parents[1] / "assets" / "studio"
"""Folder of the page that ``make studio`` builds."""
_REQUEST_BYTES = 4 << 20
"""Bytes of a request that is no file [ours: the plan of half an hour has 1 MB]."""
_POLICY = (
    "default-src 'none'; script-src 'self'; worker-src 'self' blob:; style-src 'self'; img-src 'self' blob: data:; "
    "media-src 'self' blob:; connect-src 'self' blob: data: ws://{host}; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
"""Content-Security-Policy. The page may load what comes from this server, and what it makes itself (``blob:``, ``data:``:
characters and sound that stay in the browser). WebSockets go to this server alone."""
_HEADERS = HEADERS | {
    "content-security-policy": _POLICY,
    "permissions-policy": "camera=(), geolocation=(), microphone=(self)",
}
_KINDS = {
    ".js": "text/javascript", ".css": "text/css", ".html": "text/html", ".svg": "image/svg+xml", ".txt": "text/plain",
    ".woff2": "font/woff2",
}  # fmt: skip
_NO_PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>cospeech studio</title>
<h1>The page of the studio is not built</h1>
<p>In a checkout of the repository, run <code>make studio</code>. Then start the server again.</p></html>
"""


def make_app(state: StudioState, *, token: str | None = None, page: Path = PAGE) -> Any:
    """Make the application, behind its guard.

    Args:
        state: of the server.
        token: secret that clients must send; None: only this machine is served.
        page: folder of the built page; its files are listed once.

    Raises:
        InputError: the extra ``studio`` is not installed.
    """
    routing = load_web("starlette.routing")
    sockets = StudioSockets(state)
    routes = [
        *_page_routes(page), *_api_routes(StudioApi(state)),
        routing.WebSocketRoute("/api/events", sockets.events), routing.WebSocketRoute("/api/live", sockets.live),
    ]  # fmt: skip
    app = load_web("starlette.applications").Starlette(routes=routes)
    app.router.redirect_slashes = False  # an address is right or wrong
    return Guard(app, token=token, limit=_REQUEST_BYTES, headers=_HEADERS, takes_files=_takes_file)


def _takes_file(scope: Scope) -> bool:
    """Whether the body of a request is a file, which `cospeech.studio.uploads` receives."""
    path, method = scope["path"], scope["method"]
    return (method == "POST" and path in ("/api/speech", "/api/clips")) or (method == "PUT" and path.endswith("/transcript"))


def _api_routes(api: StudioApi) -> list[Any]:
    route = load_web("starlette.routing").Route
    calls = {
        ("GET", "/api/catalogue"): api.catalogue,
        ("GET", "/api/mannequin"): api.mannequin,
        ("POST", "/api/speech"): api.add_speech,
        ("POST", "/api/speech/example"): api.add_example,
        ("PUT", "/api/speech/{speech}/transcript"): api.set_transcript,
        ("PUT", "/api/speech/{speech}/language"): api.set_language,
        ("GET", "/api/speech/{speech}/sound"): api.give_sound,
        ("POST", "/api/clips"): api.add_clip,
        ("POST", "/api/takes"): api.add_take,
        ("DELETE", "/api/takes/{take}"): api.drop_take,
        ("GET", "/api/takes/{take}/motion"): api.give_motion,
        ("GET", "/api/takes/{take}/plan"): api.give_plan,
        ("GET", "/api/takes/{take}/report"): api.give_report,
        ("GET", "/api/takes/{take}/file"): api.give_file,
        ("POST", "/api/plans/edit"): api.edit_plan,
        ("POST", "/api/plans/open"): api.open_plan,
    }
    return [route(path, answer_errors(call), methods=[method]) for (method, path), call in calls.items()]


def _page_routes(page: Path) -> list[Any]:
    """A route for each file of the page; no other file can be read."""
    responses, route = load_web("starlette.responses"), load_web("starlette.routing").Route
    files = {path.relative_to(page).as_posix(): path for path in sorted(page.rglob("*")) if path.is_file()}

    def give(path: Path) -> Any:
        kind = _KINDS.get(path.suffix) or mimetypes.guess_type(path.name)[0] or "application/octet-stream"
        return lambda request: responses.FileResponse(path, media_type=kind)

    first = give(files["index.html"]) if "index.html" in files else lambda request: responses.HTMLResponse(_NO_PAGE)
    routes = [route("/", first, methods=["GET"])]
    return routes + [route(f"/{name}", give(path), methods=["GET"]) for name, path in files.items()]
