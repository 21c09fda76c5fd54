"""A study without a server: export a folder for any web space, and import the files of answers that raters send."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ...errors import InputError
from ...files import parse_json, read_regular, workplace
from .answers import Answers, Rater, check_answers
from .app import PAGE_FILES, is_code, page_file
from .plan import CLIPS, StudyPlan, is_clip, load_plan
from .session import describe_study, describe_trial, make_session

__all__ = ["Imported", "export_page", "import_answers"]

ANSWER_BYTES = 1 << 22
"""Bytes of a rater's file; a file of 100 trials has 20 kB."""
ANSWER_VALUES = 200_000
"""Commas, lists and objects in a rater's file."""
SESSIONS = (1, 5000)
"""Range of the number of sessions in an exported page; each takes some kB."""


def export_page(study: Path, page: Path, *, sessions: int = 200) -> StudyPlan:
    """Write a study as a folder of files for any web space; the page offers the answers as a download.

    Args:
        study: the folder of the study.
        page: the folder to make.
        sessions: number of orders in the page; a rater gets a random one, or that of ``?session=7``.

    Raises:
        InputError: the folder exists, or the study is not whole.
    """
    if not SESSIONS[0] <= sessions <= SESSIONS[1]:
        raise InputError(f"{sessions} sessions", f"{SESSIONS[0]} … {SESSIONS[1]}")
    if page.exists():
        raise InputError(f"{str(page)!r} exists already", "name a new folder")
    plan = load_plan(study)
    orders = [[describe_trial(plan, trial) for trial in make_session(plan, k)] for k in range(sessions)]
    page.parent.mkdir(parents=True, exist_ok=True)
    with workplace(page.parent) as place:
        new_page = place / "page"
        (new_page / CLIPS).mkdir(parents=True)
        for name in PAGE_FILES:
            (new_page / name).write_bytes(page_file(name).replace(b'data-mode="server"', b'data-mode="static"'))
        data = {"study": describe_study(plan), "sessions": orders, "completion": plan.completion}
        (new_page / "study.json").write_text(json.dumps(data, ensure_ascii=False), "utf-8", newline="\n")
        for clip in plan.clips:
            source = study / CLIPS / clip.file
            if not is_clip(source):
                what = "a link" if source.is_symlink() else "missing"
                raise InputError(f"the clip {str(source)!r} is {what}", "make the study again")
            shutil.copyfile(source, new_page / CLIPS / clip.file)
        new_page.rename(page)
    return plan


class Imported(NamedTuple):
    """The result of an import.

    Args:
        added: number of sessions that were added.
        known: number of sessions that were there already.
        twice: number of sessions of participants who have another session already; they are not added.
    """

    added: int
    known: int
    twice: int


def import_answers(study: Path, files: Sequence[Path]) -> Imported:
    """Import files that raters of an exported page have sent. All are checked before one is added.

    Raises:
        InputError: a file does not belong to this study, or an answer in it is not valid; the file is named.
    """
    plan = load_plan(study)
    submissions = [_read_session(plan, path) for path in files]
    with Answers(study, plan) as answers:
        words = [answers.add_session(rater, trials) for rater, trials in submissions]
    return Imported(words.count("added"), words.count("known"), words.count("twice"))


def _read_session(plan: StudyPlan, path: Path) -> tuple[Rater, dict[int, tuple[dict[tuple[str, int], int], float]]]:
    """Read a rater and the answers from a file."""
    data = parse_json(read_regular(path, "the answers of a rater", ANSWER_BYTES), str(path), ANSWER_VALUES)
    hint = "is it the file that the page of this study has saved?"
    if not isinstance(data, dict) or data.get("study") != plan.digest:
        raise InputError(f"{str(path)!r} holds no answers to this study", hint)
    name, number, code, rows = (data.get(key) for key in ("rater", "session", "participant", "answers"))
    if not isinstance(name, str) or not re.fullmatch("[0-9a-f]{32}", name) or not isinstance(rows, list):
        raise InputError(f"{str(path)!r} has no rater or no answers", hint)
    if type(number) is not int or not 0 <= number < SESSIONS[1]:
        raise InputError(f"{str(path)!r}: there is no session {number!r}", hint)
    if not isinstance(code, str) or not is_code(code):
        raise InputError(f"{str(path)!r}: the code of the invitation is not valid", hint)
    trials, answers = make_session(plan, number), {}
    for row in rows:
        k, seconds = (row.get("trial"), row.get("seconds")) if isinstance(row, dict) else (None, None)
        if type(k) is not int or not 0 <= k < len(trials) or type(seconds) not in (int, float):
            raise InputError(f"{str(path)!r}: there is no such trial: {k!r}", hint)
        try:
            answers[k] = check_answers(plan, trials[k], row.get("answers")), _number(seconds)
        except InputError as error:
            raise InputError(f"{str(path)!r}: trial {k}: {error.problem}", error.hint) from None
    return Rater(name, number, code), answers


def _number(value: Any) -> float:
    """A number as a float; numbers out of range are limited."""
    return float(min(max(value, 0), 1e9))
