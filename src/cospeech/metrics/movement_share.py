"""Movement: in how many of the statistics of `movement_reference` does somebody move as real speakers do?"""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import InputError
from .interval import mean_score
from .metric import metric
from .movement import window_statistics
from .movement_reference import REFERENCE
from .sample import Sample, Score, Tools

__all__ = ["movement"]

SHORTEST = 3.0  # seconds; what `movement_statistics` takes at least


@metric("track", "positions", better="higher")
def movement(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Share of the movement statistics inside the range of real speakers, per window of 30 s."""
    shares, groups = [], []
    for sample in generated:
        assert sample.track is not None
        if len(sample.track.hips) < SHORTEST * sample.track.fps:
            continue
        for rows in window_statistics(sample.track):
            hits = [REFERENCE[name].holds(value) for name, value in rows.items() if name in REFERENCE]
            shares.append(sum(hits) / len(hits))
            groups.append(sample.group)
    if not shares:
        raise InputError(f"no clip is longer than {SHORTEST:g} s")
    return mean_score(shares, groups=groups, seed=tools.seed, note="the ranges are of windows of 30 s")
