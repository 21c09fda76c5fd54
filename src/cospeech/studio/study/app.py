"""The web application of a study: the page, its clips under opaque names, and four calls."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from functools import lru_cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

from ...errors import InputError
from ..server import Guard, load_web
from .answers import Answers, Rater, check_answers
from .plan import CLIPS, StudyPlan, is_clip
from .session import describe_study, describe_trial, make_session

Call = Callable[[dict[str, Any], str], dict[str, Any]]

__all__ = ["MOST_CODE", "PAGE_FILES", "is_code", "make_app", "page_file"]

PAGE = Path(__file__).resolve().parents[2] / "assets" / "study"
PAGE_FILES = {
    "index.html": "text/html; charset=utf-8",
    "study.js": "text/javascript; charset=utf-8",
    "study.css": "text/css; charset=utf-8",
}
MEDIA = {".mp4": "video/mp4", ".webm": "video/webm"}
MOST_CODE = 64
"""Characters of the code of an invitation; Prolific's have 24."""


def is_code(code: Any) -> bool:
    """Whether a value can be the code of an invitation; "" is none."""
    return isinstance(code, str) and len(code) <= MOST_CODE and code.isprintable()


def page_file(name: str) -> bytes:
    """A file of the page."""
    return (PAGE / name).read_bytes()


def make_app(study: Path, plan: StudyPlan, answers: Answers, *, token: str | None = None) -> Any:
    """Make the application, behind its guard.

    Args:
        study: the folder; only the clips of the plan are served from it.
        token: secret that clients must send; None: only this machine is served.

    Raises:
        InputError: the extra ``studio`` is not installed.
    """
    responses, calls = load_web("starlette.responses"), _Calls(plan, answers)
    route = load_web("starlette.routing").Route
    files = {clip.file: study / CLIPS / clip.file for clip in plan.clips}
    study_response = responses.JSONResponse(describe_study(plan))

    def give_page(name: str) -> Any:
        response = responses.Response(page_file(name), headers={"content-type": PAGE_FILES[name]})
        return lambda request: response

    def give_clip(request: Any) -> Any:
        path = files.get(request.path_params["name"])  # a name that is not in the plan is no path
        if path is None or not is_clip(path):
            return _refuse(404, "there is no such clip")
        return responses.FileResponse(path, media_type=MEDIA[path.suffix])

    routes = [
        route("/", give_page("index.html"), methods=["GET"]),
        *(route(f"/{name}", give_page(name), methods=["GET"]) for name in ("study.js", "study.css")),
        route("/clips/{name}", give_clip, methods=["GET"]),
        route("/api/study", lambda request: study_response, methods=["GET"]),
        route("/api/raters", _endpoint(calls.join), methods=["POST"]),
        route("/api/session", _endpoint(calls.resume), methods=["GET"]),
        route("/api/answers", _endpoint(calls.answer), methods=["POST"]),
    ]
    return Guard(load_web("starlette.applications").Starlette(routes=routes), token=token)


class _Calls:
    """The calls of the page, with JSON values as arguments and results."""

    def __init__(self, plan: StudyPlan, answers: Answers) -> None:
        self._plan, self._answers = plan, answers
        self._trials = lru_cache(1000)(partial(make_session, plan))

    def join(self, message: dict[str, Any], name: str) -> dict[str, Any]:
        """Add a rater, who has agreed to take part."""
        if message.get("consent") is not True:
            raise InputError("nobody takes part without consent", "tick the box")
        code = message.get("participant", "")
        if not is_code(code):
            raise InputError("the code of the invitation is not valid", f"at most {MOST_CODE} characters that can be printed")
        return self._session(self._answers.add_rater(code))

    def resume(self, message: dict[str, Any], name: str) -> dict[str, Any]:
        """The session of a rater who comes back."""
        return self._session(self._find(name))

    def answer(self, message: dict[str, Any], name: str) -> dict[str, Any]:
        """Store the answers to a trial."""
        rater = self._find(name)
        trials, number, seconds = self._trials(rater.number), message.get("trial"), message.get("seconds", 0.0)
        if type(number) is not int or not 0 <= number < len(trials):
            raise InputError("there is no such trial", f"0 … {len(trials) - 1}")
        if type(seconds) not in (int, float) or not 0 <= seconds < 1e9:
            raise InputError("the seconds are no time")
        self._answers.add(rater, number, check_answers(self._plan, trials[number], message.get("answers")), seconds)
        count = len(self._answers.list_trials(rater))
        return {"done": count, "of": len(trials), "completion": self._completion(count, len(trials))}

    def _find(self, name: str) -> Rater:
        rater = self._answers.find_rater(name)
        if rater is None:
            raise LookupError
        return rater

    def _session(self, rater: Rater) -> dict[str, Any]:
        trials = [describe_trial(self._plan, trial) for trial in self._trials(rater.number)]
        numbers = self._answers.list_trials(rater)
        completion = self._completion(len(numbers), len(trials))
        return {"rater": rater.rater, "trials": trials, "done": numbers, "completion": completion}

    def _completion(self, count: int, pages: int) -> str:
        """Address to which a rater goes after the last page; empty before."""
        return self._plan.completion if count == pages else ""


def _endpoint(call: Call) -> Callable[[Any], Awaitable[Any]]:
    """Wrap a call as the endpoint of a route."""

    async def handle(request: Any) -> Any:
        run_sync = import_module("anyio.to_thread").run_sync
        return await run_sync(_handle, call, await request.body(), request.headers.get("x-rater", ""))

    return handle


def _handle(call: Call, body: bytes, name: str) -> Any:
    """Do one call: parse the bytes of the request, and return an answer."""
    try:
        message = json.loads(body) if body else {}
    except (ValueError, RecursionError):
        return _refuse(400, "the message is not JSON")
    if not isinstance(message, dict):
        return _refuse(400, "the message is no table")
    try:
        return load_web("starlette.responses").JSONResponse(call(message, name))
    except LookupError:
        return _refuse(404, "the study does not know this rater")
    except InputError as error:
        return _refuse(422, str(error))


def _refuse(status: int, why: str) -> Any:
    return load_web("starlette.responses").JSONResponse({"error": why}, status)
