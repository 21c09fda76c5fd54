"""Trains in processes of its own: ``python train_worker.py '{"jobs": [{"store": …, "out": …, "recipe": {…}}, …]}'``.

A job with ``die`` kills its process after so many steps, one with ``interrupt`` sends it what Ctrl-C sends; each job has a
process of its own. With ``rank``, ``size`` and ``meet`` (a file) this is one of several processes that do all jobs together.
The exit codes are told as JSON.
"""

from __future__ import annotations

import json
import os
import signal
import sys

import torch
import torch._dynamo  # the optimisers import it: here once, before the jobs fork
from torch import distributed as dist

import tiny_models
from cospeech.models import NETWORKS
from cospeech.recipe import read_recipe
from cospeech.train import train


def do(job: dict) -> None:
    def progress(done: float, total: float | None, word: str) -> None:
        if done == job.get("die"):
            os.kill(os.getpid(), signal.SIGKILL)
        if done == job.get("interrupt"):
            os.kill(os.getpid(), signal.SIGINT)

    train(read_recipe(job["recipe"]), job["store"], job["out"], resume=job.get("resume", False), progress=progress)


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
    NETWORKS.update(tiny_models.MODELS)
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
