"""Trains in processes of its own: ``python -m tests.support.train_worker WORK``.

WORK is JSON: ``{"jobs": [{"store": …, "out": …, "recipe": {…}}, …]}``.

A job with ``die`` kills its process after so many steps, one with ``interrupt`` sends it what Ctrl-C sends; one with ``slow``
takes large products in each step, and with ``share`` it is interrupted after that share of the step behind ``slow_after``, as
long as the one before; the file ``told`` gets how long that was, how long it took to end, and what was said. Each job has a
process of its own. With ``rank``, ``size`` and ``meet`` (a file) this is one of several processes that do all jobs together.
The exit codes are told as JSON.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from pathlib import Path

import torch
import torch._dynamo  # the optimisers import it: here once, before the jobs fork
from torch import distributed as dist

from cospeech.models import ENTRIES
from cospeech.training.recipe import read_recipe
from cospeech.training.train import train
from tests.support import tiny_models


def do(job: dict) -> None:
    marks, interrupts, notices = [time.monotonic()], [], []

    def interrupt() -> None:
        interrupts.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    def progress(step: float, total: float | None, word: str) -> None:
        marks.append(time.monotonic())
        if step == job.get("slow_after"):
            threading.Timer(job["share"] * (marks[-1] - marks[-2]), interrupt).start()
        if step == job.get("die"):
            os.kill(os.getpid(), signal.SIGKILL)
        if step == job.get("interrupt"):
            os.kill(os.getpid(), signal.SIGINT)

    tiny_models.SLOW["matrices"] = job.get("slow", 0)
    resume = job.get("resume", False)
    try:
        train(read_recipe(job["recipe"]), job["store"], job["out"], resume=resume, progress=progress, notice=notices.append)
    finally:
        if "told" in job:
            Path(job["told"]).write_text(
                json.dumps([marks[-1] - marks[-2], time.monotonic() - interrupts[0], notices]), encoding="utf-8"
            )


def alone(job: dict) -> int:
    """The exit code of a job in a process of its own; minus the signal that ended it; 130 for Ctrl-C."""
    child = os.fork()
    if child == 0:
        signal.signal(signal.SIGINT, signal.default_int_handler)  # the tests may run where Ctrl-C is ignored: behind an &
        code = 1
        try:
            do(job)
            code = 0
        except KeyboardInterrupt:
            code = 130
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def main(work: dict) -> None:
    torch.set_num_threads(1)
    ENTRIES.ours.update(tiny_models.MODELS)
    if "size" not in work:
        sys.stdout.write(json.dumps([alone(job) for job in work["jobs"]]))
        return
    dist.init_process_group("gloo", init_method=f"file://{work['meet']}", rank=work["rank"], world_size=work["size"])
    try:
        for job in work["jobs"]:
            do(job)
    finally:
        dist.destroy_process_group()


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
