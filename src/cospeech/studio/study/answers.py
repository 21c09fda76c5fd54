"""The answers to a study, in SQLite: one row an answer, safe against a power cut in the middle of one."""

from __future__ import annotations

import secrets
import sqlite3
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ...errors import InputError
from .plan import StudyPlan
from .session import Trial, answer_keys, make_session

__all__ = ["Answers", "Rater", "check_answers"]

FILE = "answers.sqlite"
MOST_RATERS = 20_000
"""Of a study; ours: ten times the largest of the field. It keeps a flood from filling the disk."""
MOST_SECONDS = 86_400.0
"""That a trial may take; a longer time is cut."""
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
    """Who answers.

    Args:
        rater: a secret name, which the page keeps.
        number: of the session.
        participant: code of the invitation; "" where there is none.
    """

    rater: str
    number: int
    participant: str


def check_answers(plan: StudyPlan, trial: Trial, given: Any) -> dict[tuple[str, int], int]:
    """The answers to a trial as a page sends them, ``{"question": value}`` or ``{"question": [value of each clip]}``.

    Raises:
        InputError: an answer is missing, is none of the options, or belongs to no question.
    """
    if not isinstance(given, Mapping):
        raise InputError("the answers are no table", "question = value")
    found: dict[tuple[str, int], Any] = {}
    for name, value in given.items():
        values = enumerate(value) if isinstance(value, list) else [(-1, value)]
        found |= {(name, place): one for place, one in values}
    keys = answer_keys(plan, trial)
    if found.keys() != keys.keys():
        raise InputError("the answers are not those to the questions of this page", "answer all of them")
    for key, value in found.items():
        if type(value) is not int or value not in keys[key]:
            raise InputError(f"no such answer to {key[0]!r}", f"known: {', '.join(map(str, keys[key]))}")
    return found


class Answers:
    """The data base of a study's folder.

    Args:
        study: the folder.
        plan: its plan.

    Raises:
        InputError: the plan was changed after the first rater in a way that changes what the answers mean.
    """

    def __init__(self, study: Path, plan: StudyPlan) -> None:
        self._plan, self._lock = plan, threading.Lock()
        path = study / FILE
        try:
            self._base = sqlite3.connect(path, check_same_thread=False, timeout=10.0, isolation_level=None)
            self._base.execute("PRAGMA journal_mode = WAL")
            self._base.execute("PRAGMA synchronous = NORMAL")
            self._base.executescript(_TABLES)
            row = self._base.execute("SELECT digest FROM study").fetchone()
            if row is None:
                self._base.execute("INSERT INTO study VALUES (?)", (plan.digest,))
        except sqlite3.Error as error:
            raise InputError(f"cannot keep answers in {str(path)!r}: {error}", "may you write there?") from None
        if row is not None and row[0] != plan.digest:
            self.close()
            raise InputError(
                f"{str(study / 'plan.json')!r} was changed after the first rater", f"take the change back, or move {FILE} away"
            )

    def close(self) -> None:
        """Write all to the file and let go of it."""
        with self._lock:
            self._base.close()

    def __enter__(self) -> Answers:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def add_rater(self, participant: str = "") -> Rater:
        """A new rater, with the next session; one whose code is known goes on where he stopped.

        Raises:
            InputError: there are too many.
        """
        with self._lock:
            self._base.execute("BEGIN IMMEDIATE")
            try:
                known = "SELECT rater, number, participant FROM raters WHERE participant = ? AND source = 'server'"
                row = self._base.execute(known, (participant,)).fetchone() if participant else None
                if row is not None:
                    return Rater(*row)
                count, last = self._base.execute("SELECT count(*), max(number) FROM raters WHERE source = 'server'").fetchone()
                if count >= MOST_RATERS:
                    raise InputError(f"the study has {MOST_RATERS} raters", "it takes no more")
                made = Rater(secrets.token_urlsafe(16), -1 if last is None else last, participant)
                made = made._replace(number=made.number + 1)
                self._base.execute("INSERT INTO raters VALUES (?, ?, ?, 'server', ?)", (*made, time.time()))
                return made
            finally:
                self._base.execute("COMMIT")

    def find_rater(self, rater: str) -> Rater | None:
        """By the secret name."""
        with self._lock:
            row = self._base.execute("SELECT rater, number, participant FROM raters WHERE rater = ?", (rater,)).fetchone()
        return None if row is None else Rater(*row)

    def add(self, rater: Rater, trial: int, answers: Mapping[tuple[str, int], int], seconds: float) -> None:
        """Keep the answers to a trial; later answers to the same trial take their place."""
        now, took = time.time(), min(max(seconds, 0.0), MOST_SECONDS)
        rows = [(rater.rater, trial, name, place, value, took, now) for (name, place), value in answers.items()]
        with self._lock:
            self._base.execute("BEGIN IMMEDIATE")
            self._base.executemany("INSERT OR REPLACE INTO answers VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
            self._base.execute("COMMIT")

    def add_session(self, rater: Rater, trials: Mapping[int, tuple[dict[tuple[str, int], int], float]]) -> bool:
        """A whole session that was answered elsewhere, at once or not at all; False: it is known already."""
        now = time.time()
        rows = [
            (rater.rater, trial, name, place, value, min(max(seconds, 0.0), MOST_SECONDS), now)
            for trial, (answers, seconds) in trials.items()
            for (name, place), value in answers.items()
        ]
        with self._lock:
            self._base.execute("BEGIN IMMEDIATE")
            try:
                self._base.execute("INSERT INTO raters VALUES (?, ?, ?, 'import', ?)", (*rater, now))
                self._base.executemany("INSERT INTO answers VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
            except sqlite3.IntegrityError:
                self._base.execute("ROLLBACK")
                return False
            self._base.execute("COMMIT")
        return True

    def list_trials(self, rater: Rater) -> list[int]:
        """Numbers of the trials that a rater has answered."""
        with self._lock:
            rows = self._base.execute("SELECT DISTINCT trial FROM answers WHERE rater = ? ORDER BY trial", (rater.rater,))
            return [row[0] for row in rows]

    def sessions(self) -> Iterator[tuple[Rater, list[Trial], dict[int, dict[tuple[str, int], int]], dict[int, float]]]:
        """Of every rater: who, the trials, trial → answers, and trial → seconds."""
        with self._lock:
            raters = [
                Rater(*row) for row in self._base.execute("SELECT rater, number, participant FROM raters ORDER BY at, rater")
            ]
            rows = self._base.execute("SELECT rater, trial, question, place, value, seconds FROM answers").fetchall()
        found: dict[str, dict[int, dict[tuple[str, int], int]]] = {rater.rater: {} for rater in raters}
        seconds: dict[str, dict[int, float]] = {rater.rater: {} for rater in raters}
        for name, trial, question, place, value, took in rows:
            found[name].setdefault(trial, {})[question, place] = value
            seconds[name][trial] = took
        for rater in raters:
            yield rater, make_session(self._plan, rater.number), found[rater.rater], seconds[rater.rater]
