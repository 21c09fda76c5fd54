"""The worker process of `cospeech.studio.worker`: it makes takes, writes files and reads clips, and keeps loaded models."""

from __future__ import annotations

import json
import os
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

from cospeech import __version__
from cospeech.audio.speech import Speech, Word, example, open_speech
from cospeech.audio.speech_chunks import speech_chunks
from cospeech.audio.worker import requests, send_json
from cospeech.errors import CospeechError, InputError
from cospeech.export import check_parts, format_of, open_writer
from cospeech.export import load as load_motion
from cospeech.export.take_files import writer_keywords
from cospeech.models import DEFAULT, ENTRIES, MODELS, Model, find_bundle, load
from cospeech.motion.motion import Motion
from cospeech.rules.options import GenerationOptions
from cospeech.rules.plan_edits import Plan
from cospeech.runtime.report import Report, describe_language
from cospeech.studio.motion_bytes import read_motion, write_motion

__all__ = ["Jobs", "serve"]

PIECE = 2.0  # seconds of speech between two checks for a cancel [ours: half-second pieces take twice the work]
TELL = 0.1  # seconds between two messages of progress [ours]


class Cancelled(Exception):
    """The job was cancelled."""


class Jobs:
    """Does the jobs, and keeps the models from job to job."""

    def __init__(self) -> None:
        self._models: dict[str, Model] = {}
        self.cancel_number = 0
        self._number = 0

    def do(self, values: dict[str, Any]) -> dict[str, Any]:
        """Do a job, and return its answer."""
        jobs: dict[str, Callable[..., dict[str, Any]]] = {
            "warm": self.warm, "describe": self.describe, "take": self.take, "file": self.file, "clip": self.clip,
        }  # fmt: skip
        job, self._number = jobs[values.pop("job")], values.pop("number")
        return job(**values)

    def warm(self) -> dict[str, Any]:
        """Load all that the first take needs."""
        speech = Speech.load(example()[0]).window(0, 2)
        self._load(DEFAULT).generate(speech)
        return {}

    def describe(self) -> dict[str, Any]:
        """Facts of the ready models, as rows of `cospeech.studio.messages.ModelRow`; and why others are left out."""
        rows, left_out = [], []
        for name in MODELS:
            entry = ENTRIES[name]
            if entry.trains and find_bundle(name) is None:
                continue
            try:
                rows.append(self._describe(name))
            except Exception as error:  # the class of a plug-in may raise anything
                if name in ENTRIES.ours:
                    raise
                left_out.append(f"the model {name!r} is left out: {error if isinstance(error, CospeechError) else repr(error)}")
        return {"models": rows, "left_out": left_out}

    def _describe(self, name: str) -> dict[str, Any]:
        model = self._load(name)
        return {
            "name": name, "title": ENTRIES[name].what, "styles": list(model.styles),
            "seated": list(getattr(model, "seated", ())), "parts": list(model.makes), "latency": model.latency,
            "takes_gestures": getattr(model, "takes_gestures", False), "takes_example": getattr(model, "takes_example", False),
        }  # fmt: skip

    def take(
        self, *, folder: str, sound: str, words: list[tuple[str, float, float, str]], language: str, model: str,
        plan: dict[str, Any] | None, most_frames: int, by_example: bool, options: dict[str, Any],
    ) -> dict[str, Any]:  # fmt: skip
        """Make motion for a speech; writes ``motion.bin``, ``report.json`` and, if there is one, ``plan.json`` to the folder.

        ``language``: that the user gave for the words, else ""; ``by_example``: whether the style is the path of a clip.
        """
        start, place, instance = time.perf_counter(), Path(folder), self._load(model)
        request = GenerationOptions(**options, plan=None if plan is None else Plan(**plan))
        common_parts = [part for part in request.parts if part in instance.makes]
        if not common_parts:
            raise InputError(f"{model} makes no {' and no '.join(request.parts)}", f"it makes {' and '.join(instance.makes)}")
        lists_gestures = getattr(instance, "takes_gestures", False)
        settings = replace(request, plan=Plan.of(request)) if lists_gestures and request.plan is None else request
        session = instance.session(replace(settings, **instance.for_files))
        with open_speech(sound) as source:
            source.words = [Word(*word) for word in words] or None  # type: ignore[assignment]
            motions = list(self._play(session, source, most_frames))
            seconds, frames = source.seconds or 0.0, source.frames(request.fps)
        motion = Motion.concatenate(motions)
        if len(motion) != frames:
            raise RuntimeError(f"{model} made {len(motion)} frames, {frames} were due")
        self._check_cancel()
        final_plan = (
            None if by_example else self._find_plan(session, settings, words, seconds)
        )  # a plan cannot hold the style of a clip
        if final_plan is not None:
            (place / "plan.json").write_text(final_plan.to_json(), "utf-8", newline="\n")
        write_motion(motion, place / "motion.bin")
        factor = (time.perf_counter() - start) / seconds
        style = "example" if by_example else str(request.style or "")
        report = Report(
            model=model, speech_seconds=seconds, frames=frames, fps=request.fps, seed=request.seed, takes=1,
            realtime_factor=factor, emotion=session.emotion, played=session.expression, arousal=session.arousal,
            speaker=session.speaker, style=style or instance.default_style, style_mixture=session.style_mixture, outputs=[],
            version=__version__, **describe_language(source.words, language),
        )  # fmt: skip
        (place / "report.json").write_text(report.to_json(), "utf-8", newline="\n")
        return {"seconds": seconds, "realtime_factor": factor, "plan": final_plan is not None}

    def file(
        self, *, motion: str, target: str, sound: str, words: list[tuple[str, float, float, str]], parts: list[str]
    ) -> dict[str, Any]:
        """Write a motion as a file of another format."""
        path, whole = Path(target), read_motion(Path(motion))
        check_parts(path, parts, "the take has")
        keywords = writer_keywords([path], sound, None, {}, tuple(Word(*word) for word in words))[path.suffix]
        with open_writer(path, skeleton=whole.skeleton, fps=whole.fps, **keywords) as writer:
            for first in range(0, len(whole), 1000):
                writer.write(whole[first : first + 1000])
        return {"opens": format_of(path).opens}

    def clip(self, *, path: str) -> dict[str, Any]:
        """Check that a motion file can be read, and return its length."""
        return {"seconds": load_motion(path).duration}

    def _load(self, name: str) -> Model:
        if name not in self._models:
            self._models[name] = load(name)
        return self._models[name]

    def _play(self, session: Any, source: Any, most_frames: int) -> Iterator[Motion]:
        """Yield the motion of a speech, piece by piece."""
        total, last_time, frames = source.expected_seconds, 0.0, 0

        def hear(piece: Speech | None) -> Iterator[Motion]:
            """The motion that is certain after a piece of speech; None: the end of the speech."""
            self._check_cancel()
            motions: Iterator[Motion] = session.finish() if piece is None else session.push(piece)
            return motions

        chunks = (piece for chunk in speech_chunks(source) for piece in chunk.chunks(PIECE))
        for motion in chain.from_iterable(map(hear, chain(chunks, [None]))):
            self._check_cancel()
            frames += len(motion)
            if frames > most_frames:
                problem = f"the take has more than {most_frames:,} frames"
                raise InputError(problem, "fewer frames per second, or a shorter speech")
            yield motion
            if time.monotonic() - last_time > TELL:
                last_time = time.monotonic()
                send_json(b"P", done=motion.start + motion.duration, total=total)

    def _check_cancel(self) -> None:
        if self.cancel_number == self._number:
            raise Cancelled

    def _find_plan(
        self, session: Any, options: GenerationOptions, words: list[tuple[str, float, float, str]], seconds: float
    ) -> Plan:
        """The plan of the performance."""
        if options.plan is not None:
            plan: Plan = session.plan
            return plan
        open_plan = Plan.of(options).with_words(Word(*word) for word in words)
        return open_plan.model_copy(update={"seconds": round(seconds, 4)})


def serve() -> None:
    """Do the jobs, one after the other, until the server ends."""
    jobs, waiting = Jobs(), queue.SimpleQueue[dict[str, Any]]()
    threading.Thread(target=_listen, args=(jobs, waiting), daemon=True).start()
    while True:
        job = waiting.get()
        try:
            send_json(b"D", **jobs.do(job))
        except Cancelled:
            send_json(b"C")
        except CospeechError as error:
            send_json(b"X", problem=error.problem, hint=error.hint, ours=not isinstance(error, InputError))
        except Exception as error:
            send_json(b"X", problem=f"a failure of ours: {type(error).__name__}", hint=str(error)[:200], ours=True)


def _listen(jobs: Jobs, waiting: queue.SimpleQueue[dict[str, Any]]) -> None:
    """Receive jobs and cancels, in a thread. When the server ends, end this process."""
    for kind, payload in requests():
        if kind == b"C":
            jobs.cancel_number = json.loads(payload)
        else:
            waiting.put(json.loads(payload))
    sys.stdout.flush()
    os._exit(0)
