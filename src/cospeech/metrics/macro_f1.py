"""Macro-F1 of a classification, with an interval over clips: how well emotions are recognised in speech.

The F1 of each class is averaged over the classes that occur. A class counts the same however often it occurs, so that answering
*neutral* all the time scores low. The bootstrap draws whole clips, because the pieces of a clip are alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError, say_count
from ..motion.rotations import Array
from .interval import bootstrap
from .sample import Score

__all__ = ["macro_f1", "mean_f1"]

DRAWS = 1000  # ours, as everywhere


def mean_f1(counts: Array) -> float:
    """Mean F1 over the classes that occur, of (K, K) counts: rows are true classes, columns predictions; NaN where none occurs.

    >>> mean_f1(np.array([[8, 2], [0, 0]]))
    0.888...
    """
    hit, support, predictions = np.diag(counts).astype(float), counts.sum(1), counts.sum(0)
    there = support > 0
    return float(np.mean(2 * hit[there] / (support + predictions)[there])) if there.any() else float("nan")


def macro_f1(true: Sequence[int], predictions: Sequence[int], clips: Sequence[str], *, classes: int, seed: int = 0) -> Score:
    """Macro-F1 of pieces (or whole clips).

    Args:
        true: class of each piece, 0 … classes − 1.
        predictions: the class that was recognised in each piece.
        clips: name of the clip that each piece belongs to.
        classes: K; one that never occurs is not averaged over.
        seed: of the bootstrap.

    Raises:
        InputError: no piece, sequences of different lengths, or a class out of range.
    """
    a, b = np.asarray(true, np.int64), np.asarray(predictions, np.int64)
    if not len(a) == len(b) == len(clips) or not len(a):
        raise InputError(f"{len(a)} true classes, {len(b)} given ones and {len(clips)} clips", "as many of each, and some")
    if min(a.min(), b.min()) < 0 or max(a.max(), b.max()) >= classes:
        raise InputError(f"classes {min(a.min(), b.min())} … {max(a.max(), b.max())}", f"0 … {classes - 1}")
    names = sorted(set(clips))
    counts = np.zeros((len(names), classes, classes))
    np.add.at(counts, (np.searchsorted(names, clips), a, b), 1)
    resamples = bootstrap(lambda k: mean_f1(counts[k].sum(0)), names, draws=DRAWS, seed=seed)
    occurring = int((counts.sum((0, 2)) > 0).sum())
    note = f"{say_count(occurring, 'class', 'classes')}, {say_count(len(names), 'clip')}"
    return Score(mean_f1(counts.sum(0)), resamples.interval, len(a), note, resamples.draws)
