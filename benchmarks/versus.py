"""This code against that of another commit, in turns: ``python benchmarks/versus.py COMMIT [--turns 4] [--jobs rules:live …]``

Both are run as a user gets them, with the networks that ship with each, in fresh processes that take turns, each on one core:
old, new, old, new. Processor time per second of speech, so that other work on the machine disturbs less than it does a clock;
least and median of all runs, and their ratios. A process runs each job once before it counts.

Jobs are MODEL:HOW. ``offline`` is `generate` of a speech in memory with the options of `cospeech generate` (``offline-bare``:
without stance and beat alignment); ``live`` is a live session that gets pieces of 20 ms and gives 60 frames a second.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

RUNS = 3  # of a process
OFFLINE, LIVE = 40.0, 15.0  # seconds of speech
JOBS = (
    "rules:offline", "rules:live", "chain-of-generation:offline", "chain-of-generation:offline-bare",
    "chain-of-generation:live", "stylised-flow:live", "mix-stage:live",
)  # fmt: skip
ROOT = Path(__file__).parents[1]


def prepare(job: str) -> tuple[Callable[[], None], float]:
    """A function that plays a job once, and the seconds of its speech."""
    import numpy as np

    import cospeech
    from cospeech.audio.speech import Speech
    from cospeech.cli.demo import EXAMPLE

    name, how = job.split(":")
    seconds = LIVE if how == "live" else OFFLINE
    one = Speech.load(EXAMPLE)
    speech = Speech(np.resize(one.samples, int(seconds * one.rate)), one.rate)
    pieces, model = list(speech.chunks(0.02)), cospeech.load(name)
    options = dict(getattr(model, "for_files", {}))
    if how == "offline-bare":
        layers = ("stance", "holds", "beat_alignment", "rests")  # `LAYERS`, which old commits lack
        options |= {name: False for name in layers if name in options}

    def play() -> None:
        if how != "live":
            model.generate(speech, **options)
            return
        live = cospeech.open_live_session(model, fps=60)
        for piece in pieces:
            for _ in live.push(piece.samples, piece.rate):
                pass
        for _ in live.finish():
            pass

    return play, seconds


def run_job(job: str) -> None:
    """In a process of its own: print seconds of processor time per second of speech, of each run."""
    play, seconds = prepare(job)
    play()
    for _ in range(RUNS):
        began = time.process_time()
        play()
        print((time.process_time() - began) / seconds)


def measure(job: str, source: Path) -> list[float]:
    """Times of a job in one process, which imports the package from ``source``."""
    env = os.environ | {"PYTHONPATH": str(source), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, __file__, "--job", job]
    process = subprocess.run(command, env=env, check=True, capture_output=True, text=True)
    return [float(line) for line in process.stdout.split()]


def compare(commit: str, jobs: list[str], turns: int) -> None:
    """A row for each job."""
    with tempfile.TemporaryDirectory() as folder:
        archive = subprocess.run(["git", "archive", commit, "src"], cwd=ROOT, check=True, capture_output=True).stdout
        subprocess.run(["tar", "-x", "-C", folder], input=archive, check=True)
        sources = {"old": Path(folder) / "src", "new": ROOT / "src"}
        print(f"| job | {commit}, least / median | now | ratio, least / median | load |\n|---|---:|---:|---:|---:|")
        for job in jobs:
            seconds: dict[str, list[float]] = {name: [] for name in sources}
            for _ in range(turns):
                for name, source in sources.items():
                    seconds[name] += measure(job, source)
            least, median = ({name: find(times) for name, times in seconds.items()} for find in (min, statistics.median))
            figures = [f"{least[name]:.5f} / {median[name]:.5f}" for name in sources]
            ratio = f"{least['old'] / least['new']:.2f} / {median['old'] / median['new']:.2f}"
            print(f"| {job} | {' | '.join(figures)} | {ratio} | {os.getloadavg()[0]:.1f} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commit", nargs="?", default="HEAD~1")
    parser.add_argument("--turns", type=int, default=4)
    parser.add_argument("--jobs", nargs="+", default=list(JOBS))
    parser.add_argument("--job", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.job:
        run_job(options.job)
    else:
        compare(options.commit, options.jobs, options.turns)


if __name__ == "__main__":
    main()
