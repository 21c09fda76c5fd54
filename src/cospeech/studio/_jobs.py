"""The process of `cospeech.studio.worker`: makes takes, writes files, reads clips. It keeps the models that it has loaded."""

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

PIECE = 2.0  # seconds of speech between two looks at the cancelling; ours: a half-second piece takes twice the work
TELL = 0.1  # seconds between two messages of progress; ours


class Cancelled(Exception):
    """The job is not wanted any more."""


class Jobs:
    """All jobs, and the models between them."""

    def __init__(self) -> None:
        self._models: dict[str, Model] = {}
        self.cancelled = 0
        self._number = 0

    def do(self, values: dict[str, Any]) -> dict[str, Any]:
        """One job; what is answered."""
        jobs: dict[str, Callable[..., dict[str, Any]]] = {
            "warm": self.warm, "describe": self.describe, "take": self.take, "file": self.file, "clip": self.clip,
        }  # fmt: skip
        job, self._number = jobs[values.pop("job")], values.pop("number")
        return job(**values)

    def warm(self) -> dict[str, Any]:
        """Load what the first take needs."""
        speech = Speech.load(example()[0]).window(0, 2)
        self._load(DEFAULT).generate(speech)
        return {}

    def describe(self) -> dict[str, Any]:
        """Facts of the models that are ready: rows of `cospeech.studio.messages.ModelRow`; and why others are left out."""
        rows, left_out = [], []
        for name in MODELS:
            entry = ENTRIES[name]
            if entry.trains and find_bundle(name) is None:
                continue
            try:
                rows.append(self._describe(name))
            except Exception as error:  # whatever a stranger's class does when it is made
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
        self, *, folder: str, sound: str, words: list[tuple[str, float, float, str]], model: str, plan: dict[str, Any] | None,
        most_frames: int, by_example: bool, options: dict[str, Any],
    ) -> dict[str, Any]:  # fmt: skip
        """Motion for a speech; into the folder go ``motion.bin``, ``report.json`` and, where there is one, ``plan.json``.

        ``by_example`` says whether the style is the path of a clip.
        """
        began, place, loaded = time.perf_counter(), Path(folder), self._load(model)
        asked = GenerationOptions(**options, plan=None if plan is None else Plan(**plan))
        made = [part for part in asked.parts if part in loaded.makes]
        if not made:
            raise InputError(f"{model} makes no {' and no '.join(asked.parts)}", f"it makes {' and '.join(loaded.makes)}")
        listed = getattr(loaded, "takes_gestures", False)
        played = replace(asked, plan=Plan.of(asked)) if listed and asked.plan is None else asked
        session = loaded.session(replace(played, **loaded.for_files))
        with open_speech(sound) as source:
            source.words = [Word(*word) for word in words] or None  # type: ignore[assignment]
            motions = list(self._play(session, source, most_frames))
            seconds, wanted = source.seconds or 0.0, source.frames(asked.fps)
        motion = Motion.concatenate(motions)
        if len(motion) != wanted:
            raise RuntimeError(f"{model} made {len(motion)} frames, {wanted} were due")
        self._check_cancel()
        performed = (
            None if by_example else self._find_plan(session, played, words, seconds)
        )  # no plan can say what a clip shows
        if performed is not None:
            (place / "plan.json").write_text(performed.to_json(), "utf-8", newline="\n")
        write_motion(motion, place / "motion.bin")
        factor = (time.perf_counter() - began) / seconds
        style = "example" if by_example else str(asked.style or "")
        report = Report(
            model=model, speech_seconds=seconds, frames=wanted, fps=asked.fps, seed=asked.seed, takes=1, realtime_factor=factor,
            emotion=session.emotion, played=session.expression, arousal=session.arousal, speaker=session.speaker,
            style=style or loaded.default_style, style_mixture=session.style_mixture, outputs=[], version=__version__,
            **describe_language(source.words),
        )  # fmt: skip
        (place / "report.json").write_text(report.to_json(), "utf-8", newline="\n")
        return {"seconds": seconds, "realtime_factor": factor, "plan": performed is not None}

    def file(
        self, *, motion: str, target: str, sound: str, words: list[tuple[str, float, float, str]], parts: list[str]
    ) -> dict[str, Any]:
        """A motion as a file of another format."""
        path, moving = Path(target), read_motion(Path(motion))
        check_parts(path, parts, "the take has")
        keywords = writer_keywords([path], sound, None, {}, tuple(Word(*word) for word in words))[path.suffix]
        with open_writer(path, skeleton=moving.skeleton, fps=moving.fps, **keywords) as writer:
            for first in range(0, len(moving), 1000):
                writer.write(moving[first : first + 1000])
        return {"opens": format_of(path).opens}

    def clip(self, *, path: str) -> dict[str, Any]:
        """Whether a file of motion can be read, and how long it is."""
        return {"seconds": load_motion(path).duration}

    def _load(self, name: str) -> Model:
        if name not in self._models:
            self._models[name] = load(name)
        return self._models[name]

    def _play(self, session: Any, source: Any, most_frames: int) -> Iterator[Motion]:
        """The motion of a speech, piece by piece."""
        total, told, frames = source.expected_seconds, 0.0, 0

        def hear(piece: Speech | None) -> Iterator[Motion]:
            """The motion that a piece makes certain; None: the speech is over."""
            self._check_cancel()
            found: Iterator[Motion] = session.finish() if piece is None else session.push(piece)
            return found

        chunks = (piece for chunk in speech_chunks(source) for piece in chunk.chunks(PIECE))
        for motion in chain.from_iterable(map(hear, chain(chunks, [None]))):
            self._check_cancel()
            frames += len(motion)
            if frames > most_frames:
                problem = f"the take has more than {most_frames:,} frames"
                raise InputError(problem, "fewer frames per second, or a shorter speech")
            yield motion
            if time.monotonic() - told > TELL:
                told = time.monotonic()
                send_json(b"P", done=motion.start + motion.duration, total=total)

    def _check_cancel(self) -> None:
        if self.cancelled == self._number:
            raise Cancelled

    def _find_plan(
        self, session: Any, options: GenerationOptions, words: list[tuple[str, float, float, str]], seconds: float
    ) -> Plan:
        """What was performed."""
        if options.plan is not None:
            plan: Plan = session.plan
            return plan
        open_plan = Plan.of(options).with_words(Word(*word) for word in words)
        return open_plan.model_copy(update={"seconds": round(seconds, 4)})


def serve() -> None:
    """Do the jobs that come, one after the other, until there are no more."""
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
    """In a thread: jobs and cancels as they come. When the server is gone, so is this process."""
    for kind, payload in requests():
        if kind == b"C":
            jobs.cancelled = json.loads(payload)
        else:
            waiting.put(json.loads(payload))
    sys.stdout.flush()
    os._exit(0)
