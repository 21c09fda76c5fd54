"""A study of tiny videos, its server in a thread, and simulated raters who answer through HTTP."""

from __future__ import annotations

import json
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.client import HTTPConnection
from pathlib import Path
from random import Random
from typing import Any

from cospeech.studio.server import open_socket, server_of
from cospeech.studio.study.answers import Answers
from cospeech.studio.study.app import make_app
from cospeech.studio.study.make import make_study
from cospeech.studio.study.plan import StudyPlan, load_plan
from cospeech.studio.study.session import Trial, answer_keys, describe_trial, make_session


def write_video(path: Path) -> Path:
    """Four grey pictures and a little silence, with a title that must not be seen."""
    import av
    import numpy as np

    with av.open(str(path), "w", format="mp4") as container:
        container.metadata["title"] = "the secret system"
        video, sound = container.add_stream("libx264", rate=10), container.add_stream("aac", rate=16_000, layout="mono")
        video.width = video.height = 16
        video.pix_fmt = "yuv420p"
        for k in range(4):
            picture = av.VideoFrame.from_ndarray(np.full((16, 16, 3), 60 * k, np.uint8), format="rgb24")
            container.mux(video.encode(picture))
        silence = av.AudioFrame.from_ndarray(np.zeros((1, 6400), np.float32), format="fltp", layout="mono")
        silence.sample_rate = 16_000
        container.mux(sound.encode(silence))
        container.mux([*video.encode(None), *sound.encode(None)])
    return path


def make_tiny_study(folder: Path, systems: int, stimuli: int, **options: Any) -> Path:
    """A study of ``systems`` × ``stimuli`` copies of one tiny video; systems are a, b, c, …"""
    video = write_video(folder / "video.mp4")
    names = [folder / "abcdefgh"[k] for k in range(systems)]
    for name in names:
        name.mkdir()
        for k in range(stimuli):
            shutil.copyfile(video, name / f"speech_{k:02d}.mp4")
    make_study(names, folder / "study", **options)
    return folder / "study"


@contextmanager
def running(app: Any, **options: Any) -> Iterator[int]:
    """Serve an application in a thread; yields the port."""
    listening = open_socket("127.0.0.1", 0)
    server = server_of(app, **options)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
    thread.start()
    try:
        until = time.monotonic() + 10
        while not server.started and time.monotonic() < until:
            time.sleep(0.005)
        yield listening.getsockname()[1]
    finally:
        server.should_exit = True
        thread.join(10)
        listening.close()


@contextmanager
def serving(study: Path, **options: Any) -> Iterator[int]:
    """Serve a study; yields the port."""
    plan = load_plan(study)
    with Answers(study, plan) as answers, running(make_app(study, plan, answers, **options)) as port:
        yield port


def ask(
    port: int, path: str, body: Any = None, *, method: str | None = None, **headers: str
) -> tuple[int, dict[str, str], bytes]:
    """One request: status, headers, content. ``body``: bytes, or a value for JSON."""
    connection = HTTPConnection("127.0.0.1", port, timeout=30)
    try:
        content = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
        fields = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method or ("GET" if body is None else "POST"), path, content, fields)
        response = connection.getresponse()
        return response.status, {k.lower(): v for k, v in response.getheaders()}, response.read()
    finally:
        connection.close()


Opinion = Callable[[Random, Trial, str, int], int]
"""(draw, trial, question, place) → value."""


def right_answers(plan: StudyPlan, trial: Trial) -> dict[tuple[str, int], int]:
    """Answers that pass an attention check."""
    keys = answer_keys(plan, trial)
    if trial.check == "same":
        same = {question.name for question in plan.questions if question.kind == "same"}
        return {key: 1 if key[0] in same else values[0] for key, values in keys.items()}
    return {key: values[0 if trial.check == "first" else -1] for key, values in keys.items()}


def encode_answers(plan: StudyPlan, answers: dict[tuple[str, int], int]) -> dict[str, Any]:
    """Answers as the page sends them."""
    each = {question.name: question.kind == "scale" for question in plan.questions}
    return {
        name: [answers[key] for key in sorted(answers) if key[0] == name] if many else answers[name, -1]
        for name, many in each.items()
    }


def find_session(plan: StudyPlan, descriptions: list[dict[str, Any]], most: int) -> list[Trial]:
    """The session with a number up to ``most`` that has these ``descriptions`` of trials."""
    sessions = (make_session(plan, k) for k in range(most + 1))
    return next(trials for trials in sessions if [describe_trial(plan, trial) for trial in trials] == descriptions)


def rate(port: int, plan: StudyPlan, number: int, opinion: Opinion, *, careless: bool = False, pages: int | None = None) -> str:
    """Take part as rater ``number``, with the session that the server gives; returns the rater's name."""
    draw, connection = Random(number), HTTPConnection("127.0.0.1", port, timeout=30)

    def post(path: str, body: Any, rater: str = "") -> dict[str, Any]:
        connection.request("POST", path, json.dumps(body), {"x-rater": rater, "origin": f"http://127.0.0.1:{port}"})
        response = connection.getresponse()
        content = response.read()
        assert response.status == 200, content
        return json.loads(content)

    session = post("/api/raters", {"consent": True})
    rater, trials = session["rater"], find_session(plan, session["trials"], number)
    for k, trial in enumerate(trials[:pages]):
        if trial.check and not careless:
            answers = right_answers(plan, trial)
        else:
            answers = {key: opinion(draw, trial, *key) for key in answer_keys(plan, trial)}
        post("/api/answers", {"trial": k, "answers": encode_answers(plan, answers), "seconds": 12.5}, rater)
    connection.close()
    return rater
