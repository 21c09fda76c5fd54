"""Real-time factor of every model whose weights ship, and of `rules` without the learnt mouth: rows for docs/benchmarks.md.

    OMP_NUM_THREADS=1 python benchmarks/models.py SPEECH

The speech is repeated to a minute. It is in memory, and so is the motion: the figure holds features, body, hands and face, but
neither decoding nor writing. It is processor time, so that other work on the machine disturbs it less than it does a clock; the
best of five runs counts, after one that warms up.
"""

from __future__ import annotations

import os
import platform
import sys
import time
from functools import partial

import numpy as np

import cospeech
from cospeech.models import MODELS, NETWORKS, SHIPPED, Model
from cospeech.rules import RuleBasedModel

SECONDS = 60
RUNS = 5


def measure(model: Model, speech: cospeech.Speech) -> tuple[float, float]:
    """(seconds of processor time per second of speech, frames per second) of a model."""
    best = np.inf
    parts = tuple(part for part in ("face", "body", "hands") if part in model.makes)
    for _ in range(RUNS + 1):
        began = time.process_time()
        motion = model.generate(speech, parts=parts)
        best = min(best, time.process_time() - began)
    return best / speech.seconds, motion.fps


def main(path: str) -> None:
    one = cospeech.Speech.load(path)
    samples = np.resize(one.samples, SECONDS * one.rate)
    speech = cospeech.Speech(samples, one.rate)
    print(f"{platform.processor() or platform.machine()}, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores\n")
    shipped = [name for name in MODELS if name not in NETWORKS or (SHIPPED / f"{name}.cospeech").is_file()]
    rows = {"`rules`, mouth by rule": RuleBasedModel} | {f"`{name}`": partial(cospeech.load, name) for name in shipped}
    for name, make in rows.items():
        factor, fps = measure(make(), speech)
        print(f"| {name} | {factor:.2g} | {fps:g} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
