"""How many random windows a second the store gives on one core: ``python benchmarks/store.py [frames of the store]``.

A store of 1,000,000 × 210 float32 (840 MB, from the page cache after a first pass), windows of 64 frames in batches of 128.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from cospeech.corpora.store import Entry, Store
from cospeech.corpora.store_writer import Piece, write_store

FRAMES, BATCH, COLUMNS, SECONDS = 64, 128, 210, 3.0


def build(folder: Path, frames: int) -> Store:
    """A store of random clips of 10,000 frames."""
    count = frames // 10_000

    def piece(number: int) -> Piece:
        def load() -> dict[str, np.ndarray]:
            return {"pose": np.random.default_rng(number).random((10_000, COLUMNS), np.float32)}

        return Piece(Entry(f"clip{number}", f"speaker{number % 8}", "train", 0, 10_000, 0.0, ("pose",)), (), load)

    names = {"pose": tuple(f"d{k}" for k in range(COLUMNS))}
    write_store(folder, [piece(k) for k in range(count)], corpus="folder", pose="none", fps=15.0, names=names)
    return Store(folder)


def main() -> None:
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    with tempfile.TemporaryDirectory() as folder:
        store = build(Path(folder), frames)
        float(np.asarray(store.arrays["pose"]).sum())  # once through: into the page cache
        batches = store.windows(FRAMES, batch=BATCH, arrays=("pose",))
        best = 0.0
        for _ in range(3):
            began, count = time.perf_counter(), 0
            while time.perf_counter() - began < SECONDS / 3:
                count += len(next(batches)["pose"])
            best = max(best, count / (time.perf_counter() - began))
    print(f"{best:,.0f} random windows of {FRAMES} × {COLUMNS} float32 a second from {frames:,} frames, one core")


if __name__ == "__main__":
    main()
