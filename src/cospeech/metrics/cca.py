"""CCA: the first canonical correlation between generated and recorded motion, frame by frame (GENEA).

GENEA fits and scores on the same frames: with many dimensions and few frames anything correlates, white noise too. `cca` finds
the two directions on one half of the clips (or of the frames, where there is one clip) and correlates on the other.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from .interval import groups_of, mean_score, number_groups
from .metric import metric, pair_samples
from .sample import Sample, Score, Tools

__all__ = ["canonical", "cca", "cca_genea"]

STILL = 1e-8  # GENEA cca.py: dimensions with less deviation are left out
RANK = 1e-6  # ours: directions with less of the largest singular value are left out


def _basis(x: Array) -> tuple[Array, Array]:
    """Orthonormal columns that span the centred (T, D) data, and the (D, R) weights that make them."""
    u, s, v = np.linalg.svd(x - x.mean(0), full_matrices=False)
    keep = s > RANK * s.max(initial=0)
    return u[:, keep], v[keep].T / s[keep]


def canonical(a: Array, b: Array) -> tuple[float, Array, Array]:
    """First canonical correlation of (T, D) and (T, E), 0 … 1, and the weights (D,) and (E,).

    Raises:
        InputError: lengths differ, or one side does not move.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    if a.ndim != 2 or b.ndim != 2 or len(a) != len(b) or len(a) < 3:
        raise InputError(f"CCA of shapes {a.shape} and {b.shape}", "the same number of frames, 3 at least")
    if min(a.std(0).max(initial=0), b.std(0).max(initial=0)) <= STILL:
        raise InputError("CCA of a body that does not move")
    (qa, wa), (qb, wb) = _basis(a), _basis(b)
    u, s, v = np.linalg.svd(qa.T @ qb)
    return float(min(s[0], 1.0)), wa @ u[:, 0], wb @ v[0]


def _poses(generated: Sequence[Sample], reference: Sequence[Sample]) -> list[tuple[Array, Array]]:
    pairs = pair_samples(generated, reference, "positions")
    if min(motion.shape[1] for _, _, motion, _ in pairs) < 2:
        raise InputError("CCA of a root alone", "a root and at least one more joint")
    flat = [[(x - x[:, :1])[:, 1:].reshape(len(x), -1) for x in (motion, true)] for _, _, motion, true in pairs]
    return [(motion, true) for motion, true in flat]


@metric("positions", better="higher", paired=True, chance=True)
def cca(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Canonical correlation on clips that the directions were not fitted on, −1 … 1; 0 for noise and for stillness."""
    pairs, groups = _poses(generated, reference), groups_of(generated)
    place = number_groups(groups)
    if not place.any():  # a single recording: its halves
        halves = [(slice(None, len(pair[0]) // 2), slice(len(pair[0]) // 2, None)) for pair in pairs]
        pairs = [(a[cut], b[cut]) for (a, b), cuts in zip(pairs, halves, strict=True) for cut in cuts]
        place, groups = np.tile([0, 1], len(halves)), ["first half", "second half"] * len(halves)
    values, judged_groups = [], list[str]()
    for fold in range(2):  # of groups: takes and parts of one recording are on one side
        fit = [pair for pair, k in zip(pairs, place, strict=True) if k % 2 == fold]
        judge = [pair for pair, k in zip(pairs, place, strict=True) if k % 2 != fold]
        judged_groups += [name for name, k in zip(groups, place, strict=True) if k % 2 != fold]
        motion, true = (np.concatenate([pair[k] for pair in fit]) for k in range(2))
        if motion.std(0).max() <= STILL:
            values += [0.0] * len(judge)
            continue
        _, wa, wb = canonical(motion, true)
        for a, b in judge:
            x, y = a @ wa, b @ wb
            moving = min(x.std(), y.std()) > 1e-12
            values.append(float(np.corrcoef(x, y)[0, 1]) if moving else 0.0)
    return mean_score(values, groups=judged_groups, seed=tools.seed)


@metric("positions", better="higher", paired=True)
def cca_genea(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """GENEA's global CCA: fitted and scored on the same frames, so that everything that moves scores well."""
    pairs = _poses(generated, reference)
    motion, true = (np.concatenate([pair[k] for pair in pairs]) for k in range(2))
    return Score(canonical(motion, true)[0], None, len(motion))
