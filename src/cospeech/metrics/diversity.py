"""Diversity: how much motion differs from clip to clip, and within a clip from its mean pose.

More is not better: white noise and a shaking body are diverse. The published forms are "higher is better" and depend on the
order and the batch of clips; `diversity` and `l1_div` do not, and are best where they equal the reference's own value.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..motion.poses.euler import to_angles
from ..motion.rotations import Array
from .interval import bootstrap, groups_of, mean_score
from .metric import metric
from .sample import Sample, Score, Tools, pose_vectors, select_vectors

__all__ = [
    "diversity", "diversity_gfge", "diversity_mix_stage", "l1_div", "l1_div_beat", "mean_pair_distance",
]  # fmt: skip

FRAMES, BATCH = 34, 50  # a sample and a test batch of the flow paper (GFGE cal_metrics.py)
MILLI = 1000.0  # metres → millimetres
DRAWS = 200  # ours


def mean_pair_distance(windows: Array) -> float:
    """Mean over all pairs of rows (N, D) of the mean |difference|, whatever their order, in O(N log N).

    >>> mean_pair_distance(np.array([[0.0], [1.0], [3.0]]))
    2.0

    Raises:
        InputError: fewer than two rows.
    """
    count = len(windows)
    if windows.ndim != 2 or count < 2 or not windows.shape[1]:
        raise InputError(f"diversity of windows of shape {windows.shape}", "two at least")
    place = 2.0 * np.arange(count) - (count - 1)
    return float((place @ np.sort(windows, axis=0)).mean() * 2 / (count * (count - 1)))


def _windows(sample: Sample, *, root: bool = False) -> Array:
    poses = pose_vectors(sample)
    if root:
        poses = np.pad(poses, ((0, 0), (3, 0)))  # which is at 0
    count = len(poses) // FRAMES
    return poses[: count * FRAMES].reshape(count, FRAMES * poses.shape[1])


@metric("positions|points", better="reference", unit="mm (px)", same=("rate", "joints"))
def diversity(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mean distance of all pairs of windows (34 frames), mm per coordinate; best where it equals the reference's."""
    own = [(windows, sample.group) for sample in generated if len(windows := _windows(sample))]
    clips, groups = [windows for windows, _ in own], [group for _, group in own]
    sizes = np.array([len(windows) for windows in clips], np.int64)
    unit = MILLI if generated[0].positions is not None else 1.0

    def of(indices: Array) -> float:
        rows = np.concatenate([clips[k] for k in indices])
        times = np.bincount(indices, minlength=len(clips))
        pairs = len(rows) ** 2 - int(times**2 @ sizes)  # of different windows: one that is drawn twice is no pair
        return mean_pair_distance(rows) * unit * len(rows) * (len(rows) - 1) / pairs if pairs else float("nan")

    value = of(np.arange(len(clips))) if clips else float("nan")
    if not np.isfinite(value):
        raise InputError(f"fewer than two windows of {FRAMES} frames", "longer clips, or more of them")
    resamples = bootstrap(of, groups, draws=DRAWS, seed=tools.seed)
    return Score(value, resamples.interval, sum(map(len, clips)), draws=resamples.draws)


@metric("positions", better="higher", unit="mm", same=("rate", "joints"))
def diversity_gfge(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Div of the flow paper: pairs within batches of 50 consecutive windows, without a smaller last batch; depends on order.

    As coded, the root counts as a joint that never differs: with the 10 joints of TED, 9/10 of the value without it.
    """
    rows = np.concatenate([w for s in generated if len(w := _windows(s, root=True))] or [np.zeros((0, 1))])
    batches = [rows[k : k + BATCH] for k in range(0, len(rows) - BATCH + 1, BATCH)]
    if not batches:
        raise InputError(f"{len(rows)} windows of {FRAMES} frames", f"a batch is {BATCH}, and smaller ones are dropped")
    return mean_score([mean_pair_distance(batch) * MILLI for batch in batches], seed=tools.seed, note="depends on order")


@metric("positions|points", better="higher", unit="mm (px)", same=("joints",))
def diversity_mix_stage(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mix-StAGE's diversity: mean |coordinate − mean pose of the reference|; not of neck, nose and eyes of PATS."""
    if not reference:
        raise InputError("no reference clips", "the mean pose is theirs")
    mean = np.concatenate([select_vectors(sample) for sample in reference]).mean(0)
    unit = MILLI if generated[0].positions is not None else 1.0
    values = [float(np.abs(select_vectors(sample) - mean).mean() * unit) for sample in generated]
    return mean_score(values, [len(sample) for sample in generated], groups=groups_of(generated), seed=tools.seed)


@metric("positions|points", better="reference", unit="mm (px)")
def l1_div(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mean |coordinate − the clip's own mean pose|, mm per coordinate; best where it equals the reference's."""
    unit = MILLI if generated[0].positions is not None else 1.0
    values = []
    for sample in generated:
        poses = pose_vectors(sample)
        values.append(float(np.abs(poses - poses.mean(0)).mean() * unit))
    return mean_score(values, [len(sample) for sample in generated], groups=groups_of(generated), seed=tools.seed)


@metric("rotations", better="higher", unit="° summed over coordinates")
def l1_div_beat(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """L1div of BEAT: Σ |angle − clip mean| over all Euler angles per frame, degrees; grows with the number of joints.

    Angles run on beyond ±180°, as in BEAT's files: a jump by a turn is no motion.
    """
    values = []
    for sample in generated:
        assert sample.rotations is not None
        angles = to_angles(sample.rotations).reshape(len(sample.rotations), -1)
        values.append(float(np.abs(angles - angles.mean(0)).sum() / len(angles)))
    return mean_score(values, [len(sample) for sample in generated], groups=groups_of(generated), seed=tools.seed)
