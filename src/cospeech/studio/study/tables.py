"""Write CSV files of a study: all answers, the raters, and votes in the layout of the GENEA leaderboard.

GENEA has a file of votes for each question, and in it a row for each comparison, with the columns ``user, input_code, model_a,
model_b, winner, is_strong, juiceOptions, juiceOtherReason`` (public votes of systems on the leaderboard, 2025). ``model_a`` was
on the left. ``winner`` is ``model_a``, ``model_b`` or ``tie``. ``is_strong`` marks a clear preference. We do not ask for
reasons, so the last two are empty. GENEA has no layout for ratings; ours has the columns ``user, input_code, model, question,
rating``.
"""

from __future__ import annotations

import csv
import io
from collections import defaultdict
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from ...errors import InputError
from ...files import all_or_none
from .answers import Answers, RaterSession, count_checks
from .plan import StudyPlan, load_plan
from .report import Vote, count_raters, name_rater, read_votes

__all__ = ["write_tables"]

_VOTES = ("user", "input_code", "model_a", "model_b", "winner", "is_strong", "juiceOptions", "juiceOtherReason")
_RATINGS = ("user", "input_code", "model", "question", "rating")
_ANSWERS = ("user", "page", "input_code", "question", "shown", "model", "answer", "seconds", "check", "outcome")
_RATERS = (
    "user", "participant", "outcome", "source", "session", "began", "pages", "of", "checks_passed", "checks_failed", "minutes",
    "seconds_of_fastest_page", "left_share",
)  # fmt: skip
_FORMULA = ("=", "+", "-", "@", "\t", "\r")


def _plain(value: object) -> str:
    """A cell that no spreadsheet runs as a formula."""
    text = str(value)
    return f"'{text}" if text.startswith(_FORMULA) and not isinstance(value, int) else text


def _csv(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(head)
    writer.writerows([_plain(value) for value in row] for row in rows)
    return buffer.getvalue()


def _vote(vote: Vote) -> tuple[object, ...]:
    winner = "tie" if vote.value == 0 else "model_a" if vote.value < 0 else "model_b"
    return (vote.rater, vote.stimulus, *vote.systems, winner, abs(vote.value) == 2, "[]", "")


def write_tables(study: Path, folder: Path, *, incomplete: bool = False) -> list[Path]:
    """Write ``answers.csv``, ``raters.csv``, a file of votes for each question of preference, and ``ratings.csv`` for scales.

    ``answers.csv`` and ``raters.csv`` have all raters, with their outcome; the other files have those who count. Only
    ``raters.csv`` has the codes of invitations.

    Args:
        study: its folder.
        folder: folder for the files.
        incomplete: whether raters who stopped early count, too.

    Raises:
        InputError: no study is there, or the folder cannot be made or written.
    """
    plan = load_plan(study)
    with Answers(study, plan) as answers:
        raters, sessions = count_raters(plan, answers, incomplete=incomplete), list(answers.sessions())
        every = read_votes(plan, answers, checks=True)
    outcomes = dict.fromkeys(raters.kept, "counts") | dict.fromkeys(raters.failed, "failed checks")
    valid, by_rater = {*raters.kept}, defaultdict[str, list[Vote]](list)
    for vote in every:
        by_rater[vote.rater].append(vote)
    votes = [vote for vote in every if vote.rater in valid and not vote.check]
    texts = {
        "answers.csv": _csv(_ANSWERS, [_answer(vote, outcomes.get(vote.rater, "stopped")) for vote in every]),
        "raters.csv": _csv(
            _RATERS, [_rater(plan, session, outcomes, by_rater[name_rater(session.rater)]) for session in sessions]
        ),
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
            place(target).write_text(texts[target.name], "utf-8", newline="\n")
    return targets


def _answer(vote: Vote, outcome: str) -> tuple[object, ...]:
    systems = "|".join(vote.systems)
    about = (vote.rater, vote.page, vote.stimulus, vote.question, systems, vote.system, vote.value)
    return (*about, f"{vote.seconds:.2f}", vote.check, outcome)


def _rater(plan: StudyPlan, session: RaterSession, outcomes: Mapping[str, str], votes: Sequence[Vote]) -> tuple[object, ...]:
    """The row of a rater. Its last column is the share of the left side in preferences; a tie counts half."""
    name, prefers = name_rater(session.rater), {question.name for question in plan.questions if question.kind == "prefer"}
    sides = [v.value for v in votes if v.question in prefers and not v.check]
    left_share = f"{sum((value < 0) + (value == 0) / 2 for value in sides) / len(sides):.3f}" if sides else ""
    began = datetime.fromtimestamp(session.at, UTC).isoformat(timespec="seconds")
    seconds = session.seconds.values()
    return (
        name, session.rater.participant, outcomes.get(name, "stopped"), session.source, session.rater.number, began,
        len(session.answers), len(session.trials), *count_checks(plan, session), f"{sum(seconds) / 60:.2f}",
        f"{min(seconds):.2f}" if seconds else "", left_share,
    )  # fmt: skip
