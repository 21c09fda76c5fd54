"""The HTTP calls of the studio's page. Requests and answers are in `cospeech.studio.messages`."""

from __future__ import annotations

import re
import shutil
from asyncio import CancelledError, ensure_future, wait
from collections.abc import Awaitable, Callable
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from ..errors import CospeechError, InputError, nearest
from ..export import FORMATS, reads_body
from ..files import parse_json, sweep
from ..limits import PLAN_VALUES
from ..models import DEFAULT
from ..rules.plan_edits import Plan
from ..rules.plan_model import parse_plan
from ..rules.planned_words import PlannedWords, describe_length
from .catalogue import check_emotion, check_plan, check_style, find_model
from .messages import (  # fmt: skip
    ChangedPlan,
    ClipStyle,
    CreatedTake,
    LanguageChoice,
    MixedStyle,
    NamedStyle,
    OpenedPlan,
    PlanEditRequest,
    PlanOpenRequest,
    StudioProblem,
    TakeRequest,
    UploadedClip,
)
from .server import load_web
from .speeches import add_words, hold_example, hold_speech, label_of, rename_error, set_language
from .state import HeldClip, StudioState
from .takes import HeldTake, QueueFull
from .uploads import UploadRefused
from .worker import JobCancelled

__all__ = ["StudioApi", "answer_errors", "parse_message"]

MOST_FRAMES = 120_000
"""Frames of a take [ours: half an hour at 60 frames per second, and 130 MB]."""
_FILE_SECONDS = 600.0  # seconds within which a file must be written [ours: enough for a video of some minutes]
_MOST_FILE_JOBS = 8  # downloads that wait for each other [ours]
_LOOK_FOR_CLIENT = 0.5  # seconds between checks whether the client of a file is still connected [ours]
_ENTRY = re.compile(r"([a-z_]+(?:\[\d+\]|\.\w+)*): ")
"""Matches the entry of a request or a plan at the beginning of an error message."""

M = TypeVar("M", bound=BaseModel)
Endpoint = Callable[[Any], Awaitable[Any]]


class _Owner:
    """Identifies the client to whom a job belongs."""


class _Refused(Exception):
    """A request that cannot be served now."""

    def __init__(self, status: int, problem: str, hint: str = "") -> None:
        super().__init__(problem)
        self.status, self.problem, self.hint = status, problem, hint


def _answer(message: BaseModel, status: int = 200) -> Any:
    return load_web("starlette.responses").Response(
        message.model_dump_json(by_alias=True), status, media_type="application/json"
    )


def _refuse(status: int, problem: str, hint: str = "") -> Any:
    """An answer with a problem. It ends the connection, because the rest of the request may still come."""
    match = _ENTRY.match(problem)
    answer = _answer(StudioProblem(problem=problem, hint=hint, entry=match[1] if match else None), status)
    answer.headers["connection"] = "close"
    return answer


def answer_errors(call: Endpoint) -> Endpoint:
    """Wrap an endpoint so that its errors become answers."""

    async def handle(request: Any) -> Any:
        try:
            return await call(request)
        except (_Refused, UploadRefused) as refusal:
            return _refuse(refusal.status, refusal.problem, refusal.hint)
        except QueueFull:
            return _refuse(429, "too many takes wait", "wait until some of them are done, or cancel them")
        except InputError as error:
            return _refuse(422, error.problem, error.hint)
        except LookupError as error:
            is_ours = type(error) is LookupError  # of ours
            return _refuse(
                404,
                str(error) if is_ours else "there is no such thing",
                "the oldest ones go when too many are kept; send it again",
            )
        except CospeechError as error:
            return _refuse(500, error.problem, error.hint)
        except (JobCancelled, CancelledError):
            return _refuse(503, "the server ends")

    return handle


def parse_message(kind: type[M], body: bytes | str) -> M:
    """Parse a message of the page. A plan in it is read like the file of a plan, with the same errors.

    Raises:
        InputError: it is not of this kind; the problem names the entry.
    """
    values = parse_json(body, "the message", PLAN_VALUES)
    if not isinstance(values, dict):
        raise InputError("the message is no object", "see docs/guides/studio.md")
    if values.get("plan") is not None:
        values["plan"] = parse_plan(Plan, values["plan"], "")
    try:
        return kind.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{place}: {first['msg']}"[:300], "see docs/guides/studio.md") from None


async def _in_thread(call: Callable[..., Any], *arguments: Any) -> Any:
    """Call a slow function in a thread, and return its value; when the server ends, it does not wait for the call."""
    return await import_module("anyio.to_thread").run_sync(call, *arguments, abandon_on_cancel=True)


class StudioApi:
    """The endpoints.

    Args:
        state: of the server.
    """

    def __init__(self, state: StudioState) -> None:
        self._state = state

    # ------------------------------------------------------------------------------------------------ what there is

    async def catalogue(self, request: Any) -> Any:
        """``GET /api/catalogue``."""
        return _answer(await _in_thread(self._state.list_catalogue))

    async def mannequin(self, request: Any) -> Any:
        """``GET /api/mannequin``."""
        return _send_file(await _in_thread(self._state.find_mannequin), "model/gltf-binary")

    # ------------------------------------------------------------------------------------------------ speech and clips

    async def add_speech(self, request: Any) -> Any:
        """``POST /api/speech?name=``: a file of sound."""
        name, folder = self._state.speeches.make_folder()
        label = label_of(request.query_params.get("name", ""), "speech")
        try:
            await self._receive(request, folder / "upload")
            speech = await _in_thread(hold_speech, folder, folder / "upload", label)
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        self._state.speeches.put(name, speech)
        return _answer(speech.describe(name))

    async def add_example(self, request: Any) -> Any:
        """``POST /api/speech/example``."""
        name, folder = self._state.speeches.make_folder()
        speech = await _in_thread(hold_example, folder)
        self._state.speeches.put(name, speech)
        return _answer(speech.describe(name))

    async def set_transcript(self, request: Any) -> Any:
        """``PUT /api/speech/{speech}/transcript?name=``."""
        speech = self._state.speeches.find(request.path_params["speech"])
        label = label_of(request.query_params.get("name", ""), "transcript.txt")
        path = speech.folder / f"transcript-{id(request):x}"
        await self._receive(request, path)
        await _in_thread(add_words, speech, path, label)
        return _answer(speech.describe_words())

    async def set_language(self, request: Any) -> Any:
        """``PUT /api/speech/{speech}/language``."""
        speech = self._state.speeches.find(request.path_params["speech"])
        message = parse_message(LanguageChoice, await request.body())
        await _in_thread(set_language, speech, message.language)
        return _answer(speech.describe_words())

    async def give_sound(self, request: Any) -> Any:
        """``GET /api/speech/{speech}/sound``."""
        return _send_file(self._state.speeches.find(request.path_params["speech"]).sound, "audio/wav")

    async def add_clip(self, request: Any) -> Any:
        """``POST /api/clips?name=``: a motion file."""
        label = label_of(request.query_params.get("name", ""), "clip.bvh")
        suffix = Path(label).suffix.lower()
        suffixes = [each for each, entry in FORMATS.items() if reads_body(entry)]
        if suffix not in suffixes:
            raise InputError(f"{label!r} is no example of style", f"motion files: {' '.join(suffixes)}")
        name, folder = self._state.clips.make_folder()
        path = folder / f"clip{suffix}"
        try:
            await self._receive(request, path)
            facts = await self._write(request, "clip", path.parent, {"path": str(path)})
        except InputError as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise rename_error(error, path, label) from None
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        self._state.clips.put(name, HeldClip(folder, path))
        return _answer(UploadedClip(clip=name, name=label, seconds=facts["seconds"]))

    async def _receive(self, request: Any, path: Path) -> None:
        disconnect = load_web("starlette.requests").ClientDisconnect
        try:
            await self._state.uploads.receive(request.stream(), request.headers.get("content-length"), path)
        except disconnect:
            raise _Refused(400, "the file is not complete") from None

    # ------------------------------------------------------------------------------------------------ takes

    async def add_take(self, request: Any) -> Any:
        """``POST /api/takes``."""
        message = parse_message(TakeRequest, await request.body())
        catalogue = await _in_thread(self._state.list_catalogue)
        model, speech = find_model(catalogue, message.model), self._state.speeches.find(message.speech)
        check_emotion(message.emotion)
        clip = self._state.clips.find(message.style.clip) if isinstance(message.style, ClipStyle) else None
        style = _describe_style(message) if clip is None else str(clip.path)  # the server has chosen this path
        if not isinstance(message.style, ClipStyle):
            check_style(model, style)
        elif not model.takes_example:
            raise InputError(f"{model.name} takes no example of style", "stylised-flow does")
        options: dict[str, Any] = {"fps": message.fps, "parts": message.parts}
        if message.plan is None:
            options |= {
                "style": style, "emotion": message.emotion, "intensity": message.intensity, "seed": message.seed,
                "temperature": message.temperature,
            }  # fmt: skip
        else:
            check_plan(model, message.plan)
        if speech.seconds * message.fps > MOST_FRAMES:
            raise InputError(f"the take has more than {MOST_FRAMES:,} frames", "fewer frames per second, or a shorter speech")
        name, folder = self._state.takes.make_folder()
        job = {
            "folder": str(folder), "sound": str(speech.upload),
            "words": [(w.text, w.start, w.end, w.language) for w in speech.words], "language": speech.user_language,
            "model": model.name, "plan": None if message.plan is None else message.plan.model_dump(mode="json", by_alias=True),
            "most_frames": MOST_FRAMES + 240, "by_example": message.plan is None and isinstance(message.style, ClipStyle),
            "options": options,
        }  # fmt: skip
        try:
            self._state.queue.add(name, folder, speech, job, message.page, clip)
        except QueueFull:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        if message.page is not None:
            self._state.pages.expect(message.page)  # the page may have left in the meantime
        return _answer(CreatedTake(take=name))

    async def drop_take(self, request: Any) -> Any:
        """``DELETE /api/takes/{take}``."""
        await _in_thread(self._state.queue.cancel, request.path_params["take"])
        return load_web("starlette.responses").Response(status_code=204)

    def _find_take(self, request: Any) -> HeldTake:
        take = self._state.takes.find(request.path_params["take"])
        if take.event.type != "done":
            raise _Refused(409, "the take is not done", "wait for its event")
        return take

    async def give_motion(self, request: Any) -> Any:
        """``GET /api/takes/{take}/motion``."""
        return _send_file(self._find_take(request).motion, "application/octet-stream")

    async def give_plan(self, request: Any) -> Any:
        """``GET /api/takes/{take}/plan``."""
        path = self._find_take(request).folder / "plan.json"
        if not path.is_file():
            raise _Refused(404, "this take has no plan", "no plan can say the style of a clip")
        return _send_file(path, "application/json")

    async def give_report(self, request: Any) -> Any:
        """``GET /api/takes/{take}/report``."""
        return _send_file(self._find_take(request).folder / "report.json", "application/json")

    async def give_file(self, request: Any) -> Any:
        """``GET /api/takes/{take}/file?suffix=``: a download."""
        take, suffix = self._find_take(request), request.query_params.get("suffix", "")
        if suffix not in FORMATS:
            raise InputError(f"no format has the suffix {suffix[:20]!r}", nearest(suffix[:20], FORMATS))
        path = take.folder / f"take{suffix}"
        if not path.is_file():
            values = {"motion": str(take.motion), "target": str(path), "sound": str(take.speech.upload)}
            model_parts = find_model(await _in_thread(self._state.list_catalogue), take.job["model"]).parts
            parts = [part for part in take.job["options"]["parts"] if part in model_parts]
            try:
                await self._write(request, "file", take.folder, values | {"words": take.job["words"], "parts": parts})
            except InputError as error:
                raise rename_error(error, path, f"{take.label}{suffix}") from None
        return _send_file(path, "application/octet-stream", f"{take.label}{suffix}")

    async def _write(self, request: Any, job: str, folder: Path, values: dict[str, Any]) -> dict[str, Any]:
        """Run a job in the process that reads and writes files. The job ends when its client has disconnected.

        Args:
            request: of the client.
            job: name of the job.
            folder: where the job writes; what a killed process leaves there is removed.
            values: of the job.
        """
        state, owner = self._state, _Owner()
        if state.file_jobs >= _MOST_FILE_JOBS:
            raise _Refused(503, "too many files are being written", "try again in a minute")
        state.file_jobs += 1
        work = ensure_future(_in_thread(lambda: state.writer.run(job, timeout=_FILE_SECONDS, owner=owner, **values)))
        try:
            while not (await wait([work], timeout=_LOOK_FOR_CLIENT))[0]:
                if await request.is_disconnected():
                    state.writer.cancel(owner)
                    await wait([work])
            answer: dict[str, Any] = work.result()
            return answer
        except JobCancelled:
            await _in_thread(sweep, folder)
            raise
        except CancelledError:  # the server ends
            state.writer.cancel(owner)
            work.cancel()
            raise
        finally:
            state.file_jobs -= 1

    # ------------------------------------------------------------------------------------------------ plans

    async def edit_plan(self, request: Any) -> Any:
        """``POST /api/plans/edit``."""
        body = await request.body()
        return _answer(await _in_thread(self._edit, body))

    async def open_plan(self, request: Any) -> Any:
        """``POST /api/plans/open``: checks that a plan from a file fits this speech and this model."""
        message = parse_message(PlanOpenRequest, await request.body())
        model = find_model(await _in_thread(self._state.list_catalogue), message.model)
        speech = self._state.speeches.find(message.speech)
        check_plan(model, message.plan)
        if message.plan.gestures and not model.takes_gestures:
            raise InputError(f"the plan lists gestures, and {model.name} takes none", f"choose the model {DEFAULT} first")
        other = describe_length(message.plan.seconds, speech.seconds)
        if other:
            raise InputError(other, "drop the speech of the plan first")
        words = PlannedWords(message.plan.speech_words)
        words.hear(speech.words or None, speech.seconds)
        return _answer(OpenedPlan(plan=message.plan, note=words.describe_difference(speech.seconds)))

    def _edit(self, body: bytes) -> ChangedPlan:
        message = parse_message(PlanEditRequest, body)
        plan, values = message.plan, message.edit.model_dump(exclude_unset=True)
        if message.speech is not None and not plan.words:
            plan = plan.with_words(self._state.speeches.find(message.speech).words)
        edit = getattr(plan, values.pop("kind"))  # the message was checked, so the kind is a method that edits
        return ChangedPlan(plan=edit(**values))


def _describe_style(message: TakeRequest) -> str | None:
    """A style by its name, or a mixture, as text."""
    if isinstance(message.style, NamedStyle):
        return message.style.name
    if isinstance(message.style, MixedStyle):
        return ",".join(f"{name}:{weight:g}" for name, weight in message.style.mix.items())
    return None


def _send_file(path: Path, kind: str, label: str | None = None) -> Any:
    """Send a file of the server; with a label, as a download of this name."""
    if not path.is_file():
        raise LookupError("this file is no longer here")
    return load_web("starlette.responses").FileResponse(path, media_type=kind, filename=label)
