"""Real-time factor of the systems of the papers' tables at the papers' size, beside the code of their authors: rows for docs.

    OMP_NUM_THREADS=1 python benchmarks/systems.py TED [TRINITY BEAT …]

The arguments are stores (`cospeech prepare`). Each system is built by its recipe, with random weights, and is trained for one
step of two windows, which sets its statistics. Then it makes ten seconds for one speech, from features to poses, without
decoding, face layers or writing. One thread; processor time; the best of three after one that warms up.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from cospeech.corpora.store import Store
from cospeech.experiments.playing import threads
from cospeech.experiments.tables import TABLES
from cospeech.experiments.tables.inputs import StoreInputs, generate_rows
from cospeech.experiments.tables.runs import PlayableRun, Runs
from cospeech.training.recipe import SHIPPED, load_recipe

SECONDS, RUNS, GIVEN = 10.0, 3, 4
CONTEXT = 40  # frames; more than any network looks back
ABLATIONS = ("_no_perceptual", "_no_encoder", "_baseline", "_authors", "_wav2vec")
AUTHORS = {
    "stylised-flow, ted": (0.79, 123_611_408),
    "stylised-flow, trinity": (1.29, 146_478_480),
    "moglow, trinity": (1.71, 82_004_080),
    "trimodal, ted": (0.013, 15_004_939),
    "speech2gesture, ted": (0.016, 6_438_347),
    "joint-embedding, ted": (0.013, 15_759_275),
    "seq2seq, ted": (0.006, 9_739_027),
    "gesticulator, trinity": (0.011, 2_756_147),
    "mix-stage, pats": (0.007, 15_320_000),
    "stage, pats": (0.005, 9_560_000),
    "camn, beat": (0.011, 16_370_000),
    "multi-context, beat": (0.010, 8_380_000),
}
"""System and corpus → (real-time factor, parameters) of the authors' public code with random weights, on one thread of an AMD
EPYC with other work on it. Word tables are of their sizes. [measured from the authors' code, 2026-11]"""


def measure(player: PlayableRun, store: Store) -> float:
    """Seconds of processor time per second of motion."""
    frames, inputs = round(SECONDS * store.fps), StoreInputs(store)
    speaker, start = store.clips[0].speaker, np.array([CONTEXT])  # rows of several clips where one is shorter: it is only timed
    best = np.inf
    for _ in range(RUNS + 1):
        began = time.process_time()
        generate_rows(player, inputs, start, frames, [speaker], seed_frames=GIVEN, seed=0)
        best = min(best, time.process_time() - began)
    return best / SECONDS


def main(folders: list[str]) -> None:
    rows = {row.recipe: None for table in TABLES.values() for part in table.parts for row in part.rows if row.recipe}
    print("| system | corpus | parameters | real-time factor | authors' code: parameters | real-time factor |")
    print("|---|---|---:|---:|---:|---:|")
    with TemporaryDirectory() as scratch, threads(1):
        for folder in folders:
            store = Store(folder)
            for recipe in rows:
                plain = load_recipe(SHIPPED / f"{recipe}.toml")
                if plain.data.corpus != store.corpus or recipe.endswith(ABLATIONS):
                    continue
                if plain.needs:
                    recipe += ABLATIONS[0]  # the same network, without the training of a feature network
                brief = ("train.steps=1", "train.batch=2", "train.validate_every=0", "data.mirror=false")
                player = Runs(folder, Path(scratch) / "runs", overrides=brief, threads=1).player(recipe)
                factor, (theirs, size) = measure(player, store), AUTHORS.get(f"{plain.model}, {store.corpus}", (None, None))
                other = f"{size:,}" if size else "–"
                ours = [f"`{plain.model}`", store.corpus, f"{player.parameters:,}", f"{factor:.2g}"]
                print(f"| {' | '.join(ours)} | {other} | {theirs or '–'} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
