"""Likelihood of the test windows: how well a flow predicts recorded motion, and how much of that is due to the speech.

    nll          = −1/(N F) Σ ln p(x_t | the recorded poses before it, its speech)
    hearing gain = nll with the speech of another window of the same speaker − nll with the own speech

Both are in nats per frame, exact, and need no sampling. p is the density of poses standardised by the *store*. Where a run
has another standardisation, the logarithm of the determinant is added, so that rows can be compared. A network that predicts
the difference to the last pose (``residual``) has the same density, because a shift has the determinant 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import InputError, say_count
from ...metrics.interval import mean_score
from ...motion.rotations import Array
from ...training.batch_loader import standard_pose
from ..hearing import measure_likelihood
from .excerpts import Excerpts
from .paper_tables import HEARING, LIKELIHOOD, Cells
from .runs import PlayableRun
from .scores import as_cell

__all__ = ["COLUMNS", "STILL", "order_within_speakers", "score_likelihood", "score_still"]

COLUMNS = (LIKELIHOOD, HEARING)
STILL = "the last pose, and a normal step"
"""Control row: it knows the mean and the deviation of the step from pose to pose, and nothing else."""
STEP_FLOOR = 1e-3
"""Least deviation of a step, in deviations of the poses; ours: the density of a number that never moves has no limit."""


def order_within_speakers(speakers: Sequence[str], clips: Array, starts: Array, frames: int) -> Array:
    """(N,) for each window another window of the same speaker, half of the speaker's windows away if that shares no frame.

    A speaker without such a window gets one half of all windows away. So the words and their times differ, not the voice.

    Args:
        speakers: of each window.
        clips, starts: (N,) the clip of each window, and its first row in the store.
        frames: of a window, with all that a network hears.
    """
    names, everyone = np.array(speakers), np.arange(len(speakers))

    def choose(k: int, own: Array) -> int | None:
        """The first window without a shared frame, from the one on that is half of them away."""
        turn = np.roll(own, len(own) // 2 - int(np.searchsorted(own, k)))
        apart = turn[(clips[turn] != clips[k]) | (np.abs(starts[turn] - starts[k]) >= frames)]
        return int(apart[0]) if len(apart) else None

    order = []
    for k in range(len(speakers)):
        other = choose(k, np.flatnonzero(names == names[k]))
        other = choose(k, everyone) if other is None else other
        order.append((k + len(everyone) // 2) % len(everyone) if other is None else other)
    return np.array(order)


def score_likelihood(player: PlayableRun, excerpts: Excerpts, *, threads: int = 0) -> Cells:
    """Both columns of a run, on the windows for which systems make motion."""
    from ..playing import threads as limited

    if not hasattr(player.net, "log_prob"):
        return {name: {"why": "the network has no likelihood"} for name in COLUMNS}
    before, after = player.context
    excerpts.check_context(before, after)
    frames, speakers = before + excerpts.protocol.made + after, excerpts.speakers()
    arrays = excerpts.inputs.gather(player, excerpts.starts - before, frames, speakers)
    try:
        with limited(threads):
            order = order_within_speakers(speakers, excerpts.clips, excerpts.starts, frames)
            likelihoods = measure_likelihood(player.net, arrays, order)
    except InputError as problem:
        return {name: {"why": str(problem)} for name in COLUMNS}
    ours, theirs = player.statistics["pose_std"], standard_pose(excerpts.store).std
    determinant = float(np.log(np.asarray(ours, np.float64)).sum() - np.log(np.asarray(theirs, np.float64)).sum())
    return {
        LIKELIHOOD: _over_clips(determinant - likelihoods.own, excerpts),
        HEARING: _over_clips(likelihoods.own - likelihoods.other, excerpts),
    }


def score_still(excerpts: Excerpts) -> Cells:
    """Both columns of `STILL`: independent normal steps, with the mean and deviation of the steps in the training split."""
    store, standard = excerpts.store, standard_pose(excerpts.store)
    poses = [standard(store.clip(clip)["pose"]).astype(np.float64) for clip in store.clips if clip.split == "train"]
    steps = np.concatenate([np.diff(clip, axis=0) for clip in poses])
    mean, std = steps.mean(0), np.maximum(steps.std(0), STEP_FLOOR)
    z = (np.diff(standard(excerpts.rows("pose", 1, 0)).astype(np.float64), axis=1) - mean) / std
    nll = (z**2 / 2 + np.log(std) + np.log(2 * np.pi) / 2).sum(-1)
    return {LIKELIHOOD: _over_clips(nll, excerpts), HEARING: _over_clips(0 * nll, excerpts)}


def _over_clips(values: Array, excerpts: Excerpts) -> dict[str, Any]:
    """The mean of (N, F) values. The bootstrap draws whole clips, because windows of a clip overlap."""
    _, place, counts = np.unique(excerpts.clips, return_inverse=True, return_counts=True)
    means = np.bincount(place, values.mean(1)) / counts
    return as_cell(
        mean_score([*means], [*counts], note=f"{say_count(len(counts), 'clip')}, {say_count(len(values), 'window')}")
    )
