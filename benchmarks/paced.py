"""Several talking characters at once, as a live show has them: ``python benchmarks/paced.py --sessions 8 --minutes 5``.

Every session is pushed 1/30 s of sound 30 times a second, on the clock, the sessions one after the other within the slot,
spread over as many processes as there are cores. A frame is *late* when the answer to its piece of sound is not there at the
end of its slot, 33 ms after the piece came. Printed are the share of late frames and how long a push takes, on the clock, and
how much of a core the sessions of a process keep busy. The first seconds, in which tables are made, count too. On a machine
with other work to do, its turns count as well: the load is printed.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import time
from dataclasses import dataclass

import numpy as np
from speed import machine

from cospeech.audio.speech import Speech, example
from cospeech.models import load


@dataclass(frozen=True)
class Show:
    """Settings of a run."""

    model: str
    sessions: int
    fps: float
    minutes: float


def play(show: Show, numbers: list[int], begin: float) -> tuple[list[float], list[float]]:
    """Play the sessions of these numbers; seconds of every push, and seconds from a slot's begin to the answer.

    Args:
        begin: when the first slot begins, by `time.time`; every process has its own clock of finer steps.
    """
    audio, _ = example()
    speech, size = Speech.load(audio), round(16_000 / show.fps)
    pieces = [Speech(speech.samples[at : at + size]) for at in range(0, len(speech) - size, size)]
    model = load(show.model)
    sessions = {number: model.session(seed=number, fps=show.fps) for number in numbers}
    took, waits = list[float](), list[float]()
    zero = time.perf_counter() + begin - time.time()
    for slot in range(round(show.minutes * 60 * show.fps)):
        for number, session in sessions.items():
            due = zero + (slot + number / show.sessions) / show.fps
            if (early := due - time.perf_counter()) > 0:
                time.sleep(early)
            start = time.perf_counter()
            for _ in session.push(pieces[(slot + 97 * number) % len(pieces)]):
                pass
            end = time.perf_counter()
            took.append(end - start)
            waits.append(end - due)
    return took, waits


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=8)
    parser.add_argument("--fps", type=float, default=30.0)
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--model", default="rules")
    parser.add_argument("--processes", type=int, default=len(os.sched_getaffinity(0)), help="one for each core where not given")
    options = parser.parse_args()
    show = Show(options.model, options.sessions, options.fps, options.minutes)
    count = min(options.processes, show.sessions)
    print(f"{show.sessions} sessions of {show.model} at {show.fps:g} frames a second for {show.minutes:g} minutes, "
          f"{count} processes; {machine()}; load {os.getloadavg()[0]:.1f}", flush=True)  # fmt: skip
    shares = [list(range(first, show.sessions, count)) for first in range(count)]
    begin = time.time() + 5.0  # all have loaded their model by then
    with multiprocessing.get_context("spawn").Pool(count) as pool:
        results = pool.starmap(play, [(show, numbers, begin) for numbers in shares])
    busy = max(sum(each[0]) for each in results) / (60 * show.minutes)
    took, waits = (1e3 * np.concatenate([np.array(each[k]) for each in results]) for k in (0, 1))
    late = waits > 1e3 / show.fps
    p50, p99, p999 = np.percentile(took, (50, 99, 99.9))
    print(f"a push: p50 {p50:.2f} ms, p99 {p99:.2f} ms, p99.9 {p999:.2f} ms, at most {took.max():.1f} ms; "
          f"a core is busy for {100 * busy:.0f} % of the time")  # fmt: skip
    print(f"late frames: {late.sum()} of {len(late):,} ({100 * late.mean():.4f} %); "
          f"a frame is ready after {np.percentile(waits, 99.9):.1f} ms (p99.9), {waits.max():.1f} ms at most")  # fmt: skip


if __name__ == "__main__":
    main()
