"""The plan of a study: the file ``plan.json`` in its folder, which a researcher may edit before the first rater comes."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from ...errors import InputError
from ...files import atomic, parse_json, read_regular

__all__ = ["StudyClip", "StudyPlan", "Question", "is_clip", "load_plan", "save_plan"]

PLAN, CLIPS = "plan.json", "clips"
PLAN_BYTES = 1 << 24
"""Bytes of plan.json [ours: some ten thousand clips]."""
PLAN_VALUES = 500_000
"""Commas, lists and objects of plan.json."""
VERSION: Literal[2] = 2
"""Version of plan.json; another version would put answers in another order."""

Name = Annotated[str, Field(min_length=1, max_length=200)]
Words = Annotated[str, Field(max_length=20_000)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Question(_Strict):
    """A question about every comparison, or about every clip of it.

    Args:
        name: one word, for tables.
        text: the question, for raters.
        kind: ``scale``: 1 … ``points`` for each clip; ``prefer``: which of two clips, and how clearly; ``same``: whether two
            clips are alike; ``favourite``: one of the clips shown.
        points: of a scale, 2 … 11. Of a preference: 2 (A, B), 3 (with a tie) or 5 (clearly, slightly, tie, …).
        low, high: words for the ends of a scale.
    """

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
    text: Words
    kind: Literal["scale", "prefer", "same", "favourite"]
    points: Annotated[int, Field(ge=2, le=11)] = 5
    low: Words = "not at all"
    high: Words = "very much"

    @model_validator(mode="after")
    def _check(self) -> Question:
        if self.kind == "prefer" and self.points not in (2, 3, 5):
            raise ValueError("a preference has 2, 3 or 5 points")
        return self

    def options(self, count: int) -> list[tuple[int, str]]:
        """Values and words of all answers, for ``count`` clips. Values above 0 prefer the second clip."""
        if self.kind == "scale":
            ends = {1: self.low, self.points: self.high}
            return [(k, f"{k} – {ends[k]}" if k in ends else str(k)) for k in range(1, self.points + 1)]
        if self.kind == "same":
            return [(1, "the same"), (0, "different")]
        if self.kind == "favourite":
            return [(k, f"video {chr(65 + k)}") for k in range(count)]
        if self.points == 2:
            return [(-1, "video A"), (1, "video B")]
        if self.points == 3:
            return [(-1, "video A"), (0, "no difference"), (1, "video B")]
        words = ("A, clearly", "A, slightly", "no difference", "B, slightly", "B, clearly")
        return list(zip(range(-2, 3), words, strict=True))


class StudyClip(_Strict):
    """A video of a study.

    Args:
        id: its name on the page, which tells nothing about the system.
        system: name of its folder.
        stimulus: name of the speech.
        file: name in the folder ``clips``.
    """

    id: Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
    system: Name
    stimulus: Name
    file: Annotated[str, Field(pattern=r"^[0-9a-f]{16}\.(mp4|webm)$")]


class StudyPlan(_Strict):
    """The plan of a study.

    Args:
        template: the study of a paper that it follows.
        shows: ``single``: one clip at a time; ``pair``: two; ``group``: one of every system.
        variant: ``full``, ``mute`` (without sound) or ``hands`` (rendered with the camera on the hands).
        reference: a system, often the recordings, with which each other system is paired; None: all pairs are made.
        transfer: systems whose style should differ from the reference's, for questions of the kind ``same``.
        mismatched: systems that play the motion of another speech → the system whose motion it is. They are compared with that
            system alone.
        stimuli_each: number of speeches that a rater sees, each with all systems.
        checks: attention checks in a session.
        fewest_checks: number of checks that a rater must pass to be counted.
        completion: address to which raters go at the end, such as that of a recruiting platform; "" for none.
        seed: of the orders.
    """

    version: Literal[2] = VERSION
    title: Name
    template: Name
    consent: Words
    instructions: Words
    thanks: Words
    completion: Annotated[str, Field(pattern=r"^(https?://\S{1,2000})?$")] = ""
    shows: Literal["single", "pair", "group"]
    variant: Literal["full", "mute", "hands"] = "full"
    questions: Annotated[list[Question], Field(min_length=1, max_length=20)]
    systems: Annotated[list[Name], Field(min_length=1, max_length=50)]
    reference: Name | None = None
    transfer: list[Name] = []
    mismatched: dict[Name, Name] = {}
    stimuli_each: Annotated[int, Field(ge=1, le=1000)]
    checks: Annotated[int, Field(ge=0, le=20)] = 2
    fewest_checks: Annotated[int, Field(ge=0, le=20)] = 2
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    clips: Annotated[list[StudyClip], Field(min_length=1, max_length=20_000)]

    @model_validator(mode="after")
    def _check(self) -> StudyPlan:
        cells = {(clip.system, clip.stimulus) for clip in self.clips}
        systems = {*self.systems}
        if len(systems) != len(self.systems) or len({q.name for q in self.questions}) != len(self.questions):
            raise ValueError("a name of a system or a question stands twice")
        if cells != {(system, stimulus) for system in systems for stimulus in self.stimuli} or len(cells) != len(self.clips):
            raise ValueError("clips: one of each system on each speech is needed")
        if len({clip.id for clip in self.clips}) != len(self.clips):
            raise ValueError("clips: an id stands twice")
        if not {*self.transfer, *([self.reference] if self.reference else [])} <= systems or self.reference in self.transfer:
            raise ValueError("reference and transfer: unknown systems, or the same one in both")
        if self.mismatched and (self.shows != "pair" or {*self.mismatched, *self.mismatched.values()} != systems):
            raise ValueError("mismatched: each system and its counterpart, in pairs")
        if self.shows != "single" and len(systems) < 2:
            raise ValueError(f"shows {self.shows!r} needs two systems")
        wrong = {"single": {"prefer", "same", "favourite"}, "pair": {"favourite"}, "group": {"prefer", "same"}}[self.shows]
        if clash := wrong & {q.kind for q in self.questions}:
            raise ValueError(f"questions of the kind {sorted(clash)[0]!r} do not go with shows {self.shows!r}")
        if self.fewest_checks > self.checks:
            raise ValueError("fewest_checks is more than checks")
        return self

    @property
    def stimuli(self) -> list[str]:
        """Names of the speeches, sorted."""
        return sorted({clip.stimulus for clip in self.clips})

    @property
    def digest(self) -> str:
        """Hash of all that decides what raters see and what answers mean; changes of words do not change it."""
        values = self.model_dump(exclude={"title", "consent", "instructions", "thanks", "completion", "fewest_checks"})
        for question in values["questions"]:
            del question["text"], question["low"], question["high"]
        return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def load_plan(study: Path) -> StudyPlan:
    """Load the plan from the folder of a study.

    Raises:
        InputError: there is none, or it is not valid; the first fault is named.
    """
    path = study / PLAN
    data = parse_json(read_regular(path, "the plan of a study", PLAN_BYTES), str(path), PLAN_VALUES)
    if isinstance(data, dict) and data.get("version", VERSION) != VERSION:
        problem = f"{str(path)!r} is of another version of cospeech: {data['version']!r}"
        raise InputError(problem, f"this one reads {VERSION}; report its answers with that one, or make the study again")
    try:
        return StudyPlan.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"])) or "the plan"
        raise InputError(f"{str(path)!r}: {where}: {first['msg']}", "mend it, or make the study again") from None


def is_clip(path: Path) -> bool:
    """Whether a clip exists, and is no link: in somebody else's study, a link could show any file of the machine."""
    return path.is_file() and not path.is_symlink()


def save_plan(plan: StudyPlan, study: Path) -> None:
    """Write the plan into the folder of its study."""
    with atomic(study / PLAN) as temporary:
        temporary.write_text(plan.model_dump_json(indent=2) + "\n", "utf-8", newline="\n")
