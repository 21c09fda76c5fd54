"""Trains and scores the tables of a plan, as long as a budget lasts; started again, it goes on where it was.

    python tools/run_experiments.py PLAN.toml --list
    python tools/run_experiments.py PLAN.toml --budget 2h
    python tools/run_experiments.py PLAN.toml --only flow-1 --only flow-2
    python tools/run_experiments.py PLAN.toml --jobs 12 --pack results.tar.gz

A plan names tables, one ``[[table]]`` each, with the options of ``cospeech evaluate --table``:

    runs = "../runs/experiments"        # outside the repository; paths are relative to the plan

    [[table]]
    name = "flow-2"
    store = "../stores/ted"
    raw = "../raw/ted"                  # optional: the sound, for metrics that hear
    oracle = "../stores/ted-2"          # optional: the same speech with other gestures
    seeds = [0, 1, 2, 3, 4, 5]
    rows = ["full", "global"]           # optional: rows whose names contain one of these
    small = true
    set = ["train.steps=2000", "flow_ted:model.hidden=48"]    # of all rows, and of those of one recipe
    recipes = "recipes"                 # optional: a folder of recipes in place of those that ship
    about = "synthetic"

All rows get the first seed before any row gets the second. When all runs of a table are there, it is scored and written beside
the runs. With ``--jobs``, that many processes train at once.
"""

from __future__ import annotations

import argparse
import re
import signal
import subprocess
import sys
import tarfile
import tomllib
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

from cospeech.errors import CospeechError, InputError, nearest
from cospeech.experiments.tables import Runs, make_table, to_text, write_table
from cospeech.experiments.tables.making import choose_rows, part_of
from cospeech.experiments.tables.runs import of_speakers
from cospeech.training.interrupts import SignalWatch, defer_signals
from cospeech.training.recipe import SHIPPED

KEYS = {"name", "store", "raw", "oracle", "seeds", "rows", "small", "set", "about", "threads", "recipes"}
ALONE: dict[str, Any] = (
    {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP} if sys.platform == "win32" else {"start_new_session": True}
)
"""Options of a process that the Ctrl-C of a terminal does not reach: a second signal would end a run before it has saved."""
POLL = 0.2  # seconds between two looks at processes that train for minutes
UNITS = {"": 1, "s": 1, "m": 60, "h": 3600}
KEPT = (".json", ".md", ".jsonl", ".csv", ".toml")  # what --pack keeps: tables, scores, logs and facts, no weights


@dataclass(frozen=True)
class Job:
    """A run of a table: a recipe with a row's changes, and a seed."""

    table: int
    recipe: str
    seed: int
    changes: tuple[str, ...]

    def __str__(self) -> str:
        return " ".join([self.recipe, f"seed {self.seed}", *self.changes])


@dataclass(frozen=True)
class Plan:
    """Tables, and where their runs lie."""

    path: Path
    runs: Path
    tables: tuple[dict[str, Any], ...]

    @classmethod
    def load(cls, path: Path) -> Plan:
        """Read a plan.

        Raises:
            InputError: it cannot be read, or has an unknown key.
        """
        try:
            data = tomllib.loads(path.read_text("utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise InputError(f"cannot read the plan {str(path)!r}: {error}") from None
        for key in data.keys() - {"runs", "table"}:
            raise InputError(f"{key!r} in {str(path)!r}", nearest(key, ["runs", "table"]))
        if "runs" not in data or not data.get("table"):
            raise InputError(f"{str(path)!r} has no runs or no [[table]]", "see the head of tools/run_experiments.py")
        for entry in data["table"]:
            for key in entry.keys() - KEYS:
                raise InputError(f"{key!r} of a table in {str(path)!r}", nearest(key, sorted(KEYS)))
            if lacking := {"name", "store", "seeds"} - entry.keys():
                raise InputError(f"a table in {str(path)!r} has no {min(lacking)!r}")
        return cls(path, path.parent / data["runs"], tuple(data["table"]))

    def only(self, names: list[str]) -> Plan:
        """The plan with these tables alone, or with all where none is named.

        Raises:
            InputError: no table of the plan has that name.
        """
        tables = [entry["name"] for entry in self.tables]
        for name in names:
            if name not in tables:
                raise InputError(f"{name!r} is no table of {str(self.path)!r}", nearest(name, tables))
        return replace(self, tables=tuple(entry for entry in self.tables if not names or entry["name"] in names))

    def place(self, entry: dict[str, Any], key: str) -> Path | None:
        """A path of an entry, relative to the folder of the plan; None where the entry has none."""
        return self.path.parent / entry[key] if key in entry else None

    def runs_of(self, entry: dict[str, Any]) -> Runs:
        """Settings of the runs of a table."""
        store = self.place(entry, "store")
        assert store is not None
        return Runs(
            store, self.runs, self.place(entry, "recipes") or SHIPPED, small=entry.get("small", False),
            overrides=tuple(entry.get("set", ())), threads=entry.get("threads", 1), oracle=self.place(entry, "oracle"),
            about=entry.get("about", ""), tell=tell,
        )  # fmt: skip

    def jobs(self) -> list[Job]:
        """Every run once, in the order of training: table by table, all rows with a seed before the next seed."""
        by_folder: dict[Path, Job] = {}
        for number, entry in enumerate(self.tables):
            runs = self.runs_of(entry)
            _, part = part_of(entry["name"], runs.store)
            row_names = choose_rows(part.rows, entry.get("rows", ()))
            rows = [row for row in part.rows if row.name in row_names and row.recipe is not None]
            for seed in entry["seeds"]:
                for row in rows:
                    for speakers in row.runs:
                        assert row.recipe is not None
                        job = Job(number, row.recipe, seed, (*row.overrides, *of_speakers(speakers)))
                        by_folder.setdefault(runs.folder_of(job.recipe, seed, job.changes), job)
        return [*by_folder.values()]

    def is_done(self, job: Job) -> bool:
        """Whether a run is trained to its last step."""
        return self.runs_of(self.tables[job.table]).is_done(job.recipe, job.seed, job.changes)

    def train(self, job: Job) -> None:
        """Train a run, or go on with it."""
        self.runs_of(self.tables[job.table]).run(job.recipe, job.seed, job.changes)

    def score(self, number: int) -> None:
        """Score a table whose runs are there, print it and write it."""
        entry = self.tables[number]
        table = make_table(
            entry["name"], self.runs_of(entry), raw=self.place(entry, "raw"), seeds=entry["seeds"],
            only=entry.get("rows", ()), tell=tell,
        )  # fmt: skip
        print(to_text(table))
        for path in write_table(table, self.runs):
            tell(f"wrote {path}")


def tell(text: str) -> None:
    """Print a line about the progress on standard error."""
    print(text, file=sys.stderr, flush=True)


def seconds(text: str) -> float:
    """``90``, ``30m``, ``2h`` or ``1.5h`` in seconds."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?)([smh]?)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is no time, such as 90s, 30m or 2h")
    return float(match[1]) * UNITS[match[2]]


def train_here(plan: Plan, remaining: list[Job]) -> None:
    """One run after the other, in this process; Ctrl-C or the end of the budget saves the run that is under way."""
    began = perf_counter()
    for count, job in enumerate(remaining, 1):
        tell(f"run {count} of {len(remaining)}: {job}")
        plan.train(job)
        minutes = (perf_counter() - began) / 60
        rest = minutes / count * (len(remaining) - count)
        tell(f"{minutes:.1f} minutes so far, some {rest:.0f} more at this rate")


def train_apart(plan: Plan, remaining: list[Job], jobs: int) -> None:
    """Several runs at once, each in a process of its own; as soon as one ends, the next one begins.

    A signal that asks to stop, or a run that fails, stops all others, and they save themselves.

    Raises:
        CospeechError: a run has failed.
        KeyboardInterrupt: a signal has come.
    """
    numbers = {job: number for number, job in enumerate(plan.jobs())}
    waiting = iter(remaining)
    busy: dict[subprocess.Popen[bytes], Job] = {}

    def start() -> Iterator[None]:
        for job in waiting:
            tables = [word for entry in plan.tables for word in ("--only", entry["name"])]
            command = [sys.executable, __file__, str(plan.path), *tables, "--job", str(numbers[job])]
            busy[subprocess.Popen(command, **ALONE)] = job
            yield

    begin = start()
    with defer_signals() as watch:
        try:
            for _ in range(jobs):
                next(begin, None)
            while busy:
                process = wait_for_any(busy, watch)
                job = busy.pop(process)
                if process.returncode:
                    problem = f"the run {job} ended with code {process.returncode}"
                    raise CospeechError(problem, "start again: what is done is kept")
                next(begin, None)
        finally:
            for process in busy:
                stop(process)
            for process in busy:
                process.wait()


def stop(process: subprocess.Popen[bytes]) -> None:
    """Ask a run to save itself and to end."""
    if sys.platform == "win32":
        process.send_signal(signal.CTRL_BREAK_EVENT)  # terminate() would end it at once
    else:
        process.terminate()  # SIGINT is ignored below a shell that put this program in the background


def wait_for_any(processes: Collection[subprocess.Popen[bytes]], watch: SignalWatch) -> subprocess.Popen[bytes]:
    """Wait until a process has ended, and return it.

    Raises:
        KeyboardInterrupt: a signal has come.
    """
    while True:
        for process in processes:
            if process.poll() is not None:
                return process
        if watch.numbers:
            raise KeyboardInterrupt
        sleep(POLL)


def pack(plan: Plan, path: Path) -> None:
    """Pack tables, scores, logs and facts of the runs into one file, without weights."""
    with tarfile.open(path, "w:gz") as archive:
        for file in sorted(plan.runs.rglob("*")):
            if file.suffix in KEPT and file.is_file():
                archive.add(file, file.relative_to(plan.runs))
    tell(f"packed {path}")


def run(plan: Plan, jobs: int, budget: float | None) -> None:
    """Train the missing runs of each table, then score the table."""
    if budget is not None:
        if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell starts what it puts in the background like this
            signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGALRM, lambda number, frame: signal.raise_signal(signal.SIGINT))
        signal.setitimer(signal.ITIMER_REAL, budget)
    every = plan.jobs()
    remaining = [job for job in every if not plan.is_done(job)]
    tell(f"{len(every) - len(remaining)} of {len(every)} runs are there")
    for number in range(len(plan.tables)):
        own = [job for job in remaining if job.table == number]
        train_here(plan, own) if jobs == 1 else train_apart(plan, own, jobs)
        plan.score(number)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("plan", type=Path)
    parser.add_argument("--budget", type=seconds, metavar="TIME", help="stop after so long: 90s, 30m, 2h")
    parser.add_argument("--jobs", type=int, default=1, metavar="NUMBER", help="processes that train at once")
    parser.add_argument("--only", action="append", default=[], metavar="TABLE", help="this table of the plan; may be repeated")
    parser.add_argument("--list", action="store_true", help="print the runs and whether they are there, and do nothing")
    parser.add_argument("--pack", type=Path, metavar="FILE", help="pack tables, scores and logs into this .tar.gz at the end")
    parser.add_argument("--job", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    try:
        plan = Plan.load(options.plan).only(options.only)
        if options.list:
            for job in plan.jobs():
                print(f"{'done' if plan.is_done(job) else 'left'}  {plan.tables[job.table]['name']}: {job}")
            return 0
        if options.job is not None:
            plan.train(plan.jobs()[options.job])
            return 0
        run(plan, max(1, options.jobs), options.budget)
    except KeyboardInterrupt:
        tell("stopped; the same command goes on")
        return 130
    except CospeechError as error:
        tell(f"error: {error}")
        return 2
    finally:
        if options.pack is not None and "plan" in locals():
            pack(plan, options.pack)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
