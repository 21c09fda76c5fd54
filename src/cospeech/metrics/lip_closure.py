"""Lip closure: whether the mouth is shut where nobody speaks, and whether it shuts when the recorded one does.

A mouth is shut where ``jawOpen`` < 0.1. `lip_closure` is the share of silent frames in which it is; who never opens it gets 1,
so that its note has the share in speech, too. `lip_closure_agreement` is Cohen's κ of shut and open against the recording:
0 for whoever is always shut, always open, or shut at random.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT_INDEX
from .interval import bootstrap, groups_of, mean_score
from .metric import metric, pair_samples
from .sample import Sample, Score, Tools
from .speech_level import at_rate, level, silent

__all__ = ["is_shut", "kappa", "lip_closure", "lip_closure_agreement"]

SHUT = 0.1  # of jawOpen; ours: at rest faces of BEAT and GRID are below
DRAWS = 1000  # ours, as of `mean_score`


def is_shut(face: Array) -> Array:
    """(T,) whether the mouth of (T, 52) weights is shut."""
    return np.asarray(face)[:, ARKIT_INDEX["jawOpen"]] < SHUT


def kappa(counts: Array) -> float:
    """Cohen's κ of a (2, 2) table of counts: how often two judges say no and yes; 0 where one of them always says the same.

    >>> round(kappa(np.array([[20.0, 5.0], [10.0, 15.0]])), 6)
    0.4
    """
    total = counts.sum()
    chance = float(counts.sum(0) @ counts.sum(1)) / total**2
    return float((np.trace(counts) / total - chance) / (1 - chance)) if chance < 1 else 0.0


@metric("face", "speech", better="higher", hears=True)
def lip_closure(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Share of silent frames in which the mouth is shut (jawOpen < 0.1)."""
    values, weights, speaking, groups = [], [], [], []
    for sample in generated:
        assert sample.speech is not None
        assert sample.face is not None
        levels = level(sample.speech)
        jaw = sample.face[:, ARKIT_INDEX["jawOpen"]]
        levels = levels[: int(len(jaw) / sample.fps * 100)]
        if not len(levels):
            continue
        pause, closed = silent(levels), at_rate(jaw, sample.fps, len(levels)) < SHUT
        speaking.append(closed[~pause])
        if pause.any():
            values.append(float(closed[pause].mean()))
            weights.append(float(pause.sum()))
            groups.append(sample.group)
    if not values:
        raise InputError("no clip has silence", "pauses of 0.15 s at least")
    note = f"in speech {np.concatenate(speaking).mean():.2f}"
    return mean_score(values, weights, groups=groups, seed=tools.seed, note=note)


@metric("face", better="higher", paired=True, chance=True)
def lip_closure_agreement(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Cohen's κ between when the mouth is shut and when the recorded one is; 0 is chance, 1 is perfect."""
    tables = []
    for sample, _, face, true in pair_samples(generated, reference, "face"):
        pairs = 2 * is_shut(true)[sample.seed_frames :].astype(int) + is_shut(face)[sample.seed_frames :]
        tables.append(np.bincount(pairs, minlength=4).reshape(2, 2).astype(float))
    every = np.stack(tables)
    if not all(every.sum(0).sum(1) > 0):
        raise InputError("the recorded mouth never opens, or never shuts", "recordings of faces that speak and pause")
    resamples = bootstrap(lambda indices: kappa(every[indices].sum(0)), groups_of(generated), draws=DRAWS, seed=tools.seed)
    return Score(kappa(every.sum(0)), resamples.interval, int(every.sum()), draws=resamples.draws)
