"""Errors against the recording: mean |Δ| of coordinates (MAE), of positions (APE), and of accelerations.

One speech has many good gestures: these say how near *one* of them is, and the mean pose does best. Relative to the root, which
is left out, as are frames that were given; GFGE and HA2G count the root.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .interval import mean_score
from .metric import metric, pair_samples
from .sample import Sample, Score, Tools

__all__ = ["acceleration_error", "ape", "mae"]


def _gaps(generated: Sequence[Sample], reference: Sequence[Sample], order: int) -> tuple[list[np.ndarray], list[str]]:
    """The gap to the recording, or its derivative, of each sample that is long enough; and the group of each."""
    gaps, groups = [], []
    for sample, _, motion, true in pair_samples(generated, reference, "positions"):
        gap = ((motion - motion[:, :1]) - (true - true[:, :1]))[sample.seed_frames :, 1:]
        gap = np.diff(gap, n=order, axis=0) * sample.fps**order
        if gap.size:
            gaps.append(gap)
            groups.append(sample.group)
    return gaps, groups


@metric("positions", better="lower", paired=True, unit="m")
def mae(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mean |Δ coordinate| to the recording, m."""
    gaps, groups = _gaps(generated, reference, 0)
    return mean_score([float(np.abs(gap).mean()) for gap in gaps], [gap.size for gap in gaps], groups=groups, seed=tools.seed)


@metric("positions", better="lower", paired=True, unit="m")
def ape(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mean distance of the joints to the recording's (average position error, Gesticulator), m."""
    gaps, groups = _gaps(generated, reference, 0)
    values = [float(np.linalg.norm(gap, axis=-1).mean()) for gap in gaps]
    return mean_score(values, [gap.size for gap in gaps], groups=groups, seed=tools.seed)


@metric("positions", better="lower", paired=True, unit="m/s²")
def acceleration_error(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mean |Δ acceleration| to the recording (GFGE, HA2G; there per frame², here per s²), m/s²."""
    gaps, groups = _gaps(generated, reference, 2)
    return mean_score([float(np.abs(gap).mean()) for gap in gaps], [gap.size for gap in gaps], groups=groups, seed=tools.seed)
