"""The answers to a study, in SQLite: a row for each answer; a power cut damages nothing."""

from __future__ import annotations

import secrets
import sqlite3
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ...errors import InputError
from .plan import StudyPlan
from .session import Trial, answer_keys, make_session, passes

__all__ = ["Answers", "Rater", "RaterSession", "check_answers", "count_checks", "passes_checks"]

FILE = "answers.sqlite"
MOST_RATERS = 20_000
"""Raters of a study [ours: ten times the largest study of the field]. The limit keeps a flood from filling the disk."""
MOST_SECONDS = 86_400.0
"""Seconds that a trial may take; a longer time is cut."""
GONE = 3600.0
"""Seconds without an answer after which another rater gets the session [ours: twice the longest sessions of the field]."""
_TABLES = """
CREATE TABLE IF NOT EXISTS study (digest TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS raters (
    rater TEXT PRIMARY KEY, number INTEGER NOT NULL, participant TEXT NOT NULL, source TEXT NOT NULL, at REAL NOT NULL
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS answers (
    rater TEXT NOT NULL REFERENCES raters, trial INTEGER NOT NULL, question TEXT NOT NULL, place INTEGER NOT NULL,
    value INTEGER NOT NULL, seconds REAL NOT NULL, at REAL NOT NULL, PRIMARY KEY (rater, trial, question, place)
) WITHOUT ROWID;
"""


class Rater(NamedTuple):
    """A person who answers.

    Args:
        rater: a secret name, which the page keeps.
        number: of the session.
        participant: code of the invitation; "" if there is none.
    """

    rater: str
    number: int
    participant: str


class RaterSession(NamedTuple):
    """The session of a rater.

    Args:
        rater: the rater.
        trials: of the session.
        answers: trial → answers.
        seconds: trial → its time in seconds.
        source: ``server`` or ``import``.
        at: when the rater came, seconds since 1970.
    """

    rater: Rater
    trials: list[Trial]
    answers: dict[int, dict[tuple[str, int], int]]
    seconds: dict[int, float]
    source: str
    at: float

    @property
    def is_whole(self) -> bool:
        """Whether all pages are answered."""
        return len(self.answers) == len(self.trials)


def count_checks(plan: StudyPlan, session: RaterSession) -> tuple[int, int]:
    """Numbers of attention checks that a rater has passed, and failed."""
    checks = [k for k, trial in enumerate(session.trials) if trial.check and k in session.answers]
    successes = sum(passes(plan, session.trials[k], session.answers[k]) for k in checks)
    return successes, len(checks) - successes


def passes_checks(plan: StudyPlan, session: RaterSession) -> bool:
    """Whether a rater has failed no more attention checks than the plan allows."""
    return count_checks(plan, session)[1] <= plan.checks - plan.fewest_checks


def check_answers(plan: StudyPlan, trial: Trial, answers: Any) -> dict[tuple[str, int], int]:
    """Check and parse the answers to a trial from a page: ``{"question": value}`` or ``{"question": [value of each clip]}``.

    Raises:
        InputError: an answer is missing, is not one of the options, or belongs to no question.
    """
    if not isinstance(answers, Mapping):
        raise InputError("the answers are no table", "question = value")
    result: dict[tuple[str, int], Any] = {}
    for name, value in answers.items():
        values = enumerate(value) if isinstance(value, list) else [(-1, value)]
        result |= {(name, place): one for place, one in values}
    keys = answer_keys(plan, trial)
    if result.keys() != keys.keys():
        raise InputError("the answers are not those to the questions of this page", "answer all of them")
    for key, value in result.items():
        if type(value) is not int or value not in keys[key]:
            raise InputError(f"no such answer to {key[0]!r}", f"known: {', '.join(map(str, keys[key]))}")
    return result


class Answers:
    """The database in the folder of a study.

    Args:
        study: the folder.
        plan: its plan.

    Raises:
        InputError: after the first rater came, the plan was changed in a way that changes the meaning of the answers.
    """

    def __init__(self, study: Path, plan: StudyPlan) -> None:
        self._plan, self._lock = plan, threading.Lock()
        self._failures: dict[str, bool] = {}  # rater → whether the checks of the whole session were failed
        path = study / FILE
        try:
            self._base = sqlite3.connect(path, check_same_thread=False, timeout=10.0, isolation_level=None)
            try:
                self._check_plan(study)
            except BaseException:
                self._base.close()  # Windows moves no file that is open
                raise
        except sqlite3.DatabaseError as error:
            spoilt = not isinstance(error, sqlite3.OperationalError)
            hint = "it is damaged: put a copy of it in its place, or move it away" if spoilt else "may you write there?"
            raise InputError(f"cannot keep answers in {str(path)!r}: {error}", hint) from None

    def _check_plan(self, study: Path) -> None:
        """Make the tables where there are none, and compare the plan with that of the answers."""
        self._base.execute("PRAGMA journal_mode = WAL")
        self._base.execute("PRAGMA synchronous = NORMAL")
        self._base.executescript(_TABLES)
        row = self._base.execute("SELECT digest FROM study").fetchone()
        has_raters = self._base.execute("SELECT count(*) FROM raters").fetchone()[0] > 0
        if row is not None and row[0] != self._plan.digest and has_raters:
            raise InputError(
                f"{str(study / 'plan.json')!r} was changed after the first rater", f"take the change back, or move {FILE} away"
            )

    def close(self) -> None:
        """Write all to the file, and close it."""
        with self._lock:
            self._base.close()

    def __enter__(self) -> Answers:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @contextmanager
    def _change(self) -> Iterator[None]:
        """Make changes to the database in one transaction: after an error, none of them."""
        with self._lock:
            self._base.execute("BEGIN IMMEDIATE")
            try:
                yield
            except BaseException:
                self._base.execute("ROLLBACK")
                raise
            self._base.execute("COMMIT")

    def add_rater(self, participant: str = "") -> Rater:
        """Add a rater, with the first free session. A rater with a known code continues the session of this code.

        The session of a rater who stopped `GONE` seconds ago, or who failed the attention checks, is free again, so that all
        speeches are seen equally often.

        Raises:
            InputError: there are too many raters.
        """
        with self._change():
            query = "SELECT rater, number, participant FROM raters WHERE participant = ? AND source = 'server'"
            row = self._base.execute(query, (participant,)).fetchone() if participant else None
            if row is not None:
                return Rater(*row)
            if self._base.execute("SELECT count(*) FROM raters WHERE source = 'server'").fetchone()[0] >= MOST_RATERS:
                raise InputError(f"the study has {MOST_RATERS} raters", "it takes no more")
            rater = Rater(secrets.token_urlsafe(16), self._find_number(), participant)
            self._keep_digest()
            self._base.execute("INSERT INTO raters VALUES (?, ?, ?, 'server', ?)", (*rater, time.time()))
            return rater

    def _keep_digest(self) -> None:
        """Store the digest of the plan with the first rater. The caller holds the lock."""
        self._base.execute("DELETE FROM study WHERE NOT EXISTS (SELECT 1 FROM raters)")
        self._base.execute("INSERT INTO study SELECT ? WHERE NOT EXISTS (SELECT 1 FROM study)", (self._plan.digest,))

    def _find_number(self) -> int:
        """The first session that no rater has, or that all its raters left or failed. The caller holds the lock."""
        pages, numbers, late = len(make_session(self._plan, 0)), set[int](), time.time() - GONE
        counts = """SELECT r.rater, r.number, r.participant, r.at, count(DISTINCT a.trial), max(a.at)
            FROM raters AS r LEFT JOIN answers AS a ON a.rater = r.rater WHERE r.source = 'server' GROUP BY r.rater"""
        for name, number, participant, came, page_count, last in self._base.execute(counts).fetchall():
            if page_count == pages:
                if name not in self._failures:
                    session = next(self._read_sessions([(name, number, participant, "server", came)]))
                    self._failures[name] = not passes_checks(self._plan, session)
                if not self._failures[name]:
                    numbers.add(number)
            elif max(came, last or 0.0) > late:
                numbers.add(number)
        return next(number for number in count() if number not in numbers)

    def find_rater(self, rater: str) -> Rater | None:
        """Find a rater by the secret name."""
        with self._lock:
            row = self._base.execute("SELECT rater, number, participant FROM raters WHERE rater = ?", (rater,)).fetchone()
        return None if row is None else Rater(*row)

    def add(self, rater: Rater, trial: int, answers: Mapping[tuple[str, int], int], seconds: float) -> None:
        """Store the answers to a trial; later answers to the same trial replace them."""
        now, time_spent = time.time(), min(max(seconds, 0.0), MOST_SECONDS)
        rows = [(rater.rater, trial, name, place, value, time_spent, now) for (name, place), value in answers.items()]
        with self._change():
            self._base.executemany("INSERT OR REPLACE INTO answers VALUES (?, ?, ?, ?, ?, ?, ?)", rows)

    def add_session(
        self, rater: Rater, trials: Mapping[int, tuple[dict[tuple[str, int], int], float]]
    ) -> Literal["added", "known", "twice"]:
        """Add a whole session that was answered elsewhere, in one transaction.

        Returns:
            ``added``; ``known``: it is there already; ``twice``: another one of the same participant is there. The last two
            are not added.
        """
        now = time.time()
        rows = [
            (rater.rater, trial, name, place, value, min(max(seconds, 0.0), MOST_SECONDS), now)
            for trial, (answers, seconds) in trials.items()
            for (name, place), value in answers.items()
        ]
        with self._change():
            if self._base.execute("SELECT 1 FROM raters WHERE rater = ?", (rater.rater,)).fetchone():
                return "known"
            same = "SELECT 1 FROM raters WHERE participant = ?"
            if rater.participant and self._base.execute(same, (rater.participant,)).fetchone():
                return "twice"
            self._keep_digest()
            self._base.execute("INSERT INTO raters VALUES (?, ?, ?, 'import', ?)", (*rater, now))
            self._base.executemany("INSERT INTO answers VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
            return "added"

    def list_trials(self, rater: Rater) -> list[int]:
        """Numbers of the trials that a rater has answered."""
        with self._lock:
            rows = self._base.execute("SELECT DISTINCT trial FROM answers WHERE rater = ? ORDER BY trial", (rater.rater,))
            return [row[0] for row in rows]

    def sessions(self) -> Iterator[RaterSession]:
        """Yield the session of every rater, in the order in which they came."""
        with self._lock:
            query = "SELECT rater, number, participant, source, at FROM raters ORDER BY at, rater"
            raters = self._base.execute(query).fetchall()
            result = list(self._read_sessions(raters))
        yield from result

    def _read_sessions(self, raters: Sequence[tuple[str, int, str, str, float]]) -> Iterator[RaterSession]:
        """Read the sessions for rows of the table of raters. The caller holds the lock."""
        for name, number, participant, source, at in raters:
            answers: dict[int, dict[tuple[str, int], int]] = {}
            seconds: dict[int, float] = {}
            rows = "SELECT trial, question, place, value, seconds FROM answers WHERE rater = ? ORDER BY trial"
            for trial, question, place, value, time_spent in self._base.execute(rows, (name,)):
                answers.setdefault(trial, {})[question, place] = value
                seconds[trial] = time_spent
            trials = make_session(self._plan, number)
            yield RaterSession(Rater(name, number, participant), trials, answers, seconds, source, at)
