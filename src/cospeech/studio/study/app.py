"""The web application of a study: the page, its clips by opaque names, and four calls."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...errors import InputError
from ..server import Guard, load_web
from .answers import Answers, Rater, check_answers
from .plan import CLIPS, Plan
from .session import describe_study, describe_trial, make_session

__all__ = ["PAGE_FILES", "make_app", "page_file"]

PAGE = Path(__file__).resolve().parents[2] / "assets" / "study"
PAGE_FILES = {
    "index.html": "text/html; charset=utf-8",
    "study.js": "text/javascript; charset=utf-8",
    "study.css": "text/css; charset=utf-8",
}
MEDIA = {".mp4": "video/mp4", ".webm": "video/webm"}
MOST_CODE = 64
"""Characters of the code of an invitation; Prolific's have 24."""


def page_file(name: str) -> bytes:
    """A file of the page."""
    return (PAGE / name).read_bytes()


def make_app(study: Path, plan: Plan, answers: Answers, *, token: str | None = None) -> Any:
    """The application, behind its guard.

    Args:
        study: the folder; nothing of it is served but the clips of the plan.
        token: what clients must bring; None: only this machine is served.

    Raises:
        InputError: the extra ``studio`` is not installed.
    """
    fastapi, responses = load_web("fastapi"), load_web("fastapi.responses")
    app = fastapi.FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    files = {clip.file: study / CLIPS / clip.file for clip in plan.clips}

    def add_page(name: str, path: str) -> None:
        content, kind = page_file(name), PAGE_FILES[name]
        app.add_api_route(path, lambda: responses.Response(content, media_type=kind), methods=["GET"])

    def give_clip(name: str) -> Any:
        path = files.get(name)  # a name that is not in the plan is no path
        if path is None or not path.is_file():
            return _refuse(responses, 404, "there is no such clip")
        return responses.FileResponse(path, media_type=MEDIA[path.suffix])

    add_page("index.html", "/")
    add_page("study.js", "/study.js")
    add_page("study.css", "/study.css")
    app.add_api_route("/api/study", lambda: responses.JSONResponse(describe_study(plan)), methods=["GET"])
    app.add_api_route("/clips/{name}", give_clip, methods=["GET"])
    _add_calls(app, fastapi.Request, responses, _Calls(plan, answers))
    return Guard(app, token=token)


class _Calls:
    """What the page asks for; JSON values in, JSON values out."""

    def __init__(self, plan: Plan, answers: Answers) -> None:
        self._plan, self._answers = plan, answers

    def join(self, given: dict[str, Any], name: str) -> dict[str, Any]:
        """A new rater, who has agreed to take part."""
        if given.get("consent") is not True:
            raise InputError("nobody takes part without consent", "tick the box")
        code = given.get("participant", "")
        if not isinstance(code, str) or len(code) > MOST_CODE or not (code == "" or (code.isascii() and code.isalnum())):
            raise InputError("the code of the invitation is not valid", f"at most {MOST_CODE} letters and digits")
        return self._session(self._answers.add_rater(code))

    def resume(self, given: dict[str, Any], name: str) -> dict[str, Any]:
        """The session of a rater who comes back."""
        return self._session(self._find(name))

    def answer(self, given: dict[str, Any], name: str) -> dict[str, Any]:
        """Keep the answers to a trial."""
        rater = self._find(name)
        trials, number, seconds = make_session(self._plan, rater.number), given.get("trial"), given.get("seconds", 0.0)
        if type(number) is not int or not 0 <= number < len(trials):
            raise InputError("there is no such trial", f"0 … {len(trials) - 1}")
        if type(seconds) not in (int, float) or not 0 <= seconds < 1e9:
            raise InputError("the seconds are no time")
        self._answers.add(rater, number, check_answers(self._plan, trials[number], given.get("answers")), seconds)
        return {"done": len(self._answers.trials_done(rater)), "of": len(trials)}

    def _find(self, name: str) -> Rater:
        rater = self._answers.find_rater(name)
        if rater is None:
            raise LookupError
        return rater

    def _session(self, rater: Rater) -> dict[str, Any]:
        trials = [describe_trial(self._plan, trial) for trial in make_session(self._plan, rater.number)]
        return {"rater": rater.rater, "trials": trials, "done": self._answers.trials_done(rater)}


def _add_calls(app: Any, request_type: Any, responses: Any, calls: _Calls) -> None:
    """The calls as routes."""
    from anyio.to_thread import run_sync

    def route(call: Callable[[dict[str, Any], str], dict[str, Any]]) -> Callable[..., Any]:
        async def handle(request: Any) -> Any:
            body = await request.body()
            name = request.headers.get("x-rater", "")
            return await run_sync(_handle, responses, call, body, name)

        handle.__annotations__ = {"request": request_type}  # FastAPI reads it; the type is known only now
        return handle

    app.add_api_route("/api/raters", route(calls.join), methods=["POST"])
    app.add_api_route("/api/session", route(calls.resume), methods=["GET"])
    app.add_api_route("/api/answers", route(calls.answer), methods=["POST"])


def _handle(responses: Any, call: Callable[[dict[str, Any], str], dict[str, Any]], body: bytes, name: str) -> Any:
    """One call: bytes in, an answer out."""
    try:
        given = json.loads(body) if body else {}
    except (ValueError, RecursionError):
        return _refuse(responses, 400, "the message is not JSON")
    if not isinstance(given, dict):
        return _refuse(responses, 400, "the message is no table")
    try:
        return responses.JSONResponse(call(given, name))
    except LookupError:
        return _refuse(responses, 404, "the study does not know this rater")
    except InputError as error:
        return _refuse(responses, 422, str(error))


def _refuse(responses: Any, status: int, why: str) -> Any:
    return responses.JSONResponse({"error": why}, status)
