"""Jaw lag: how many seconds the jaw is behind the loudness of the speech, and how closely it follows it.

Correlation of ``jawOpen`` with the level in dB, both at 100 values a second and without their mean over the clip, at lags of
−0.5 … 0.5 s; over all clips together. Positive: the jaw comes after the sound. Noise and the wrong speech have a best lag, too:
`jaw_correlation` says how much it is worth.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT_INDEX
from .interval import bootstrap
from .metric import metric
from .sample import Sample, Score, Tools
from .speech_level import RATE, at_rate, level

__all__ = ["LAGS", "correlations", "jaw_correlation", "jaw_lag"]

LAGS = np.arange(-50, 51)  # of 1/RATE s; ours: half a second is beyond any muscle or model
SHORTEST = 2.0  # s; ours: shorter clips leave too little beside the lags
STILL = 1e-4  # deviation of jawOpen; ours: less is rounding, as on a frozen face
DRAWS = 400  # ours


def _moments(sample: Sample) -> Array | None:
    """(3, lags) sums of a clip over the frames that have both: jaw · level, jaw², level²; None where the clip is too short."""
    assert sample.speech is not None
    assert sample.face is not None
    loud = level(sample.speech)
    count = min(len(loud), int(len(sample.face) / sample.fps * RATE))
    if count < SHORTEST * RATE:
        return None
    jaw = at_rate(sample.face[:, ARKIT_INDEX["jawOpen"]], sample.fps, count)
    jaw, loud = jaw - jaw.mean(), loud[:count] - loud[:count].mean()
    rows = []
    for lag in map(int, LAGS):
        a = jaw[max(lag, 0) : count + min(lag, 0)]
        b = loud[max(-lag, 0) : count - max(lag, 0)]
        rows.append((a @ b, a @ a, b @ b))
    return np.array(rows).T


def _of(moments: Array) -> Array:
    """(lags,) correlations of sums (3, lags)."""
    values: Array = moments[0] / np.sqrt(np.maximum(moments[1] * moments[2], 1e-300))
    return values


def _all(samples: Sequence[Sample]) -> tuple[Array, list[str]]:
    """(clips, 3, lags) sums of the clips that are long enough, and their groups.

    Raises:
        InputError: no clip is long enough.
    """
    rows = [(sums, sample.group) for sample in samples if (sums := _moments(sample)) is not None]
    if not rows:
        raise InputError(f"no clip is longer than {SHORTEST:g} s", "longer clips with speech and a face")
    return np.stack([sums for sums, _ in rows]), [group for _, group in rows]


def correlations(samples: Sequence[Sample]) -> Array:
    """(101,) correlation of jaw and level at each of `LAGS`, over all clips."""
    return _of(_all(samples)[0].sum(0))


def _moves(samples: Sequence[Sample]) -> bool:
    jaws = [sample.face[:, ARKIT_INDEX["jawOpen"]] for sample in samples if sample.face is not None]
    return max(float(jaw.std()) for jaw in jaws) > STILL


@metric("face", "speech", better="reference", hears=True, unit="s")
def jaw_lag(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Seconds that the jaw is behind the level of the speech, at the best correlation; best where it equals the reference's."""
    if not _moves(generated):
        raise InputError("the jaw stands still", "a lag is of jaws that move")
    clips, groups = _all(generated)
    best = _of(clips.sum(0))

    def lag(indices: Array) -> float:
        return float(LAGS[_of(clips[indices].sum(0)).argmax()] / RATE)

    resamples = bootstrap(lag, groups, draws=DRAWS, seed=tools.seed)
    note = f"correlation {best.max():.2f}"
    return Score(float(LAGS[best.argmax()] / RATE), resamples.interval, len(clips), note, resamples.draws)


@metric("face", "speech", better="higher", hears=True)
def jaw_correlation(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Correlation of the jaw with the level of the speech at the best lag, −1 … 1; 0 for a jaw that does not move."""
    clips, groups = _all(generated)
    if not _moves(generated):
        return Score(0.0, None, len(clips), "the jaw stands still")

    def best(indices: Array) -> float:
        return float(_of(clips[indices].sum(0)).max())

    values = _of(clips.sum(0))
    resamples = bootstrap(best, groups, draws=DRAWS, seed=tools.seed)
    note = f"lag {LAGS[values.argmax()] / RATE:+.2f} s"
    return Score(float(values.max()), resamples.interval, len(clips), note, resamples.draws)
