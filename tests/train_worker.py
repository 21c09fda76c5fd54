"""Trains a tiny model in a process of its own: ``python train_worker.py '{"store": …, "out": …, "recipe": {…}}'``.

With ``rank``, ``size`` and ``meet`` (a file) it is one of several processes; with ``die`` it kills itself after so many steps.
"""

from __future__ import annotations

import json
import os
import signal
import sys

import torch
from torch import distributed as dist

import tiny_models
from cospeech.models import MODELS
from cospeech.recipe import read_recipe
from cospeech.train import train


def main(job: dict) -> None:
    torch.set_num_threads(1)
    MODELS.update(tiny_models.MODELS)
    if "size" in job:
        dist.init_process_group("gloo", init_method=f"file://{job['meet']}", rank=job["rank"], world_size=job["size"])

    def progress(done: float, total: float | None, word: str) -> None:
        if done == job.get("die"):
            os.kill(os.getpid(), signal.SIGKILL)
        if done == job.get("interrupt"):
            os.kill(os.getpid(), signal.SIGINT)

    try:
        train(read_recipe(job["recipe"]), job["store"], job["out"], resume=job.get("resume", False), progress=progress)
    finally:
        if "size" in job:
            dist.destroy_process_group()


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
