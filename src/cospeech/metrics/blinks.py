"""Blinks: how often, how long, and how irregular, against the recordings.

A blink is a peak of the mean of both ``eyeBlink`` weights that stands out by 0.3; its duration is the width at half of that; it
lasts 0.5 s at most. Gaps are from peak to peak within a clip; their coefficient of variation is 0 for a metronome and about 1
for chance. `blinks` is the mean of |a − b| / (a + b) over rate, duration and variation: 0 alike, 1 nothing in common.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT_INDEX
from ._scipy import scipy
from .interval import bootstrap, groups_of
from .metric import metric
from .sample import Sample, Score, Tools

__all__ = ["Blinks", "blink_duration", "blink_gaps", "blink_rate", "blinks", "blinks_of"]

DEPTH = 0.3  # least prominence; ours: at 15 frames a second half of a blink's height may fall between two frames
LONGEST = 0.5  # s at half height; ours: longer is a shut eye, blinks are 0.07 to 0.15 s (motion.md)
DRAWS = 400  # ours


@dataclass(frozen=True, eq=False)
class Blinks:
    """The blinks of one clip.

    Args:
        seconds: duration of the clip.
        widths: (n,) s at half height.
        gaps: (n − 1,) s from blink to blink.
    """

    seconds: float
    widths: Array
    gaps: Array


def blinks_of(face: Array, fps: float) -> Blinks:
    """The blinks of (T, 52) weights."""
    lids = np.asarray(face, np.float64)[:, [ARKIT_INDEX["eyeBlinkLeft"], ARKIT_INDEX["eyeBlinkRight"]]].mean(1)
    signal = scipy("signal")
    peaks, _ = signal.find_peaks(lids, prominence=DEPTH)
    widths = signal.peak_widths(lids, peaks, rel_height=0.5)[0] / fps if len(peaks) else np.zeros(0)
    good = widths <= LONGEST
    return Blinks(len(lids) / fps, widths[good], np.diff(peaks[good]) / fps)


def _rate(clips: Sequence[Blinks]) -> float:
    return 60.0 * sum(len(clip.widths) for clip in clips) / sum(clip.seconds for clip in clips)


def _duration(clips: Sequence[Blinks]) -> float:
    widths = np.concatenate([clip.widths for clip in clips])
    return float(widths.mean()) if len(widths) else np.nan


def _variation(clips: Sequence[Blinks]) -> float:
    gaps = np.concatenate([clip.gaps for clip in clips])
    return float(gaps.std() / gaps.mean()) if len(gaps) > 1 else np.nan


def _apart(a: float, b: float) -> float:
    """Relative difference of two values, 0 … 1. It is 1 where only one of them is known, 0 where neither is."""
    if not (np.isfinite(a) and np.isfinite(b)):
        return float(np.isfinite(a) or np.isfinite(b))
    return abs(a - b) / (a + b) if a + b > 0 else 0.0


def _clips(samples: Sequence[Sample]) -> list[Blinks]:
    return [blinks_of(sample.face, sample.fps) for sample in samples if sample.face is not None]


def _score(samples: Sequence[Sample], figure: Callable[[Sequence[Blinks]], float], tools: Tools) -> Score:
    clips, groups = _clips(samples), groups_of([sample for sample in samples if sample.face is not None])
    resamples = bootstrap(lambda k: figure([clips[i] for i in k]), groups, draws=DRAWS, seed=tools.seed)
    return Score(figure(clips), resamples.interval, sum(len(clip.widths) for clip in clips), draws=resamples.draws)


@metric("face", better="reference", unit="per minute")
def blink_rate(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Blinks per minute; best where it equals the reference's."""
    return _score(generated, _rate, tools)


@metric("face", better="reference", unit="s")
def blink_duration(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Mean duration of a blink at half height, s; best where it equals the reference's."""
    return _score(generated, _duration, tools)


@metric("face", better="reference")
def blink_gaps(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Coefficient of variation of the gaps between blinks: 0 for a metronome; best where it equals the reference's."""
    return _score(generated, _variation, tools)


@metric("face", better="lower")
def blinks(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Difference of the rate, duration and variation of blinks from the reference's: 0 is alike, 1 is nothing in common."""
    if not reference:
        raise InputError("blinks without a reference", "give recordings to compare with")
    true = _clips(reference)
    targets = [figure(true) for figure in (_rate, _duration, _variation)]
    if not targets[0] > 0:
        raise InputError("the reference does not blink", "recordings of faces with eyelids")

    def distance(clips: Sequence[Blinks]) -> float:
        figures = [figure(clips) for figure in (_rate, _duration, _variation)]
        return float(np.mean([_apart(a, b) for a, b in zip(figures, targets, strict=True)]))

    return _score(generated, distance, tools)
