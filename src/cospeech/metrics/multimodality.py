"""Multimodality: how much several takes of *one* speech differ. The flow paper reports it without a definition; ours is below.

    MM = mean over speeches, over pairs of takes, over frames and joints of |Δ position|        (millimetres)

Takes share `Sample.condition`. Best where it equals that of real takes; noise is as "multimodal" as you like.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ..errors import InputError, say_count
from .interval import mean_score
from .metric import metric
from .sample import Sample, Score, Tools, pose_vectors

__all__ = ["multimodality", "multimodality_ha2g"]

MILLI = 1000.0  # metres → millimetres
SHUFFLES = 500  # HA2G embedding_space_evaluator: 500 batches


@metric("positions|points", better="reference", unit="mm (px)", same=("rate",))
def multimodality(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mean distance between the joints of takes of one speech, mm, without the root and the seed frames."""
    takes: dict[str, list[Sample]] = {}
    for sample in generated:
        takes.setdefault(sample.condition, []).append(sample)
    values, groups = [], []
    for name, group in takes.items():
        poses = [pose_vectors(sample)[sample.seed_frames :] for sample in group]
        if len({pose.shape for pose in poses}) > 1:
            raise InputError(f"takes of {name!r} have shapes {sorted({pose.shape for pose in poses})}")
        if len(group) < 2 or not len(poses[0]):
            continue
        size = 3 if group[0].positions is not None else 2
        gaps = [np.linalg.norm((a - b).reshape(len(a), -1, size), axis=-1).mean() for a, b in combinations(poses, 2)]
        values.append(float(np.mean(gaps)) * (MILLI if size == 3 else 1))
        groups.append(group[0].group)
    if not values:
        raise InputError("no speech has two takes", "generate several per speech, and give them one condition")
    return mean_score(values, groups=groups, seed=tools.seed, note=f"{len(generated)} takes of {len(takes)} speeches")


@metric("features", better="higher", same=("rate", "joints"))
def multimodality_ha2g(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """HA2G's diversity: mean |Δ feature| between random windows of any speech; not a multimodality."""
    assert tools.features is not None
    rows = np.concatenate([w for s in generated if len(w := tools.features.windows(s))] or [np.zeros((0, 1))])
    if len(rows) < 2:
        raise InputError(say_count(len(rows), "window"), "longer clips, or more of them")
    rng = np.random.default_rng(tools.seed)
    a, b = (rng.integers(0, len(rows), SHUFFLES) for _ in range(2))
    return Score(float(np.abs(rows[a] - rows[b]).mean(1).mean()), None, len(rows), tools.features.name)
