"""The answers as CSV files: all of them, and in the layout of the GENEA leaderboard's votes.

GENEA's votes are one file for each question, a row for each comparison, with the columns ``user, input_code, model_a, model_b,
winner, is_strong, juiceOptions, juiceOtherReason`` (public votes of systems on the leaderboard, 2025): ``model_a`` stood on the
left, ``winner`` is ``model_a``, ``model_b`` or ``tie``, ``is_strong`` tells a clear preference. We ask for no reasons, so the
last two are empty. Ratings have no layout there; ours has the columns ``user, input_code, model, question, rating``.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from ...errors import InputError
from ...files import all_or_none
from .plan import StudyPlan
from .report import Vote

__all__ = ["write_tables"]

_VOTES = ("user", "input_code", "model_a", "model_b", "winner", "is_strong", "juiceOptions", "juiceOtherReason")
_RATINGS = ("user", "input_code", "model", "question", "rating")
_ANSWERS = ("user", "input_code", "question", "shown", "model", "answer")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def _plain(value: object) -> str:
    """A cell that no spreadsheet runs as a formula."""
    text = str(value)
    return f"'{text}" if text.startswith(_FORMULA) and not isinstance(value, int) else text


def _csv(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    held = io.StringIO()
    writer = csv.writer(held, lineterminator="\n")
    writer.writerow(head)
    writer.writerows([_plain(value) for value in row] for row in rows)
    return held.getvalue()


def _vote(vote: Vote) -> tuple[object, ...]:
    winner = "tie" if vote.value == 0 else "model_a" if vote.value < 0 else "model_b"
    return (vote.rater, vote.stimulus, *vote.systems, winner, abs(vote.value) == 2, "[]", "")


def write_tables(plan: StudyPlan, votes: Sequence[Vote], folder: Path) -> list[Path]:
    """Write ``answers.csv``, a file of votes for each question of preference, and ``ratings.csv`` where there are scales.

    Raises:
        InputError: the folder cannot be made or written.
    """
    texts = {
        "answers.csv": _csv(
            _ANSWERS, [(v.rater, v.stimulus, v.question, "|".join(v.systems), v.system, v.value) for v in votes]
        )
    }
    scales = {question.name for question in plan.questions if question.kind == "scale"}
    for question in plan.questions:
        if question.kind == "prefer":
            texts[f"{question.name}.csv"] = _csv(_VOTES, [_vote(v) for v in votes if v.question == question.name])
    if scales:
        rows = [(v.rater, v.stimulus, v.system, v.question, v.value) for v in votes if v.question in scales]
        texts["ratings.csv"] = _csv(_RATINGS, rows)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make {str(folder)!r}: {error.strerror}", "name another folder") from None
    targets = [folder / name for name in texts]
    with all_or_none(targets) as place:
        for target in targets:
            place(target).write_text(texts[target.name], "utf-8")
    return targets
