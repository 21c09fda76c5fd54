"""A store of a few hundred frames, whose poses follow its audio so that there is something to learn."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cospeech.corpora.store import Entry
from cospeech.corpora.store_writer import Piece, write_store

__all__ = ["POSE", "make_store"]

POSE = 6
COLUMNS = 5


def _piece(name: str, speaker: str, split: str, frames: int, seed: int) -> Piece:
    rng = np.random.default_rng(seed)
    audio = np.cumsum(rng.normal(size=(frames, COLUMNS)), 0) * 0.3
    pose = audio @ np.random.default_rng(7).normal(size=(COLUMNS, POSE)) + 0.1 * rng.normal(size=(frames, POSE)) + 3
    pose[:, -1] = 2  # does not move
    values = {"pose": pose.astype(np.float32), "audio": audio.astype(np.float32)}
    return Piece(Entry(name, speaker, split, 0, frames, 0.0, tuple(values)), (), lambda: dict(values))


def make_store(folder: Path, *, mirrored: bool = False, validation: bool = True, alone: bool = False) -> Path:
    """Three speakers with much, some and little; a clip of each for validation. Or one clip ``alone``."""
    rows = [("ann", 300), ("bob", 120), ("cleo", 40)]
    pieces = [_piece(f"{name}-1", name, "train", frames, k) for k, (name, frames) in enumerate(rows)]
    pieces += [_piece(f"{name}-2", name, "train", 35, 10 + k) for k, (name, _) in enumerate(rows)]
    if mirrored:
        pieces += [_piece("ann-1|mirror", "ann|mirror", "train", 50, 20)]
    if validation:
        pieces += [_piece(f"{name}-3", name, "validation", 50, 30 + k) for k, (name, _) in enumerate(rows)]
    pieces += [_piece("ann-4", "ann", "test", 50, 40)]
    pieces = pieces[:1] if alone else pieces
    names = {"pose": tuple("abcdef"), "audio": tuple("vwxyz")}
    write_store(folder, pieces, corpus="beat", pose="none", fps=15.0, names=names)
    return folder
