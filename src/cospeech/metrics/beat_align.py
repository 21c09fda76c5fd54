"""Beat alignment: the three forms of the papers, which reward jitter, and the lift over chance, in which noise earns nothing.

    closeness = mean over a of exp(−min_b |a − b|² / 2σ²)

Dense motion beats are near to everything, so that white noise, or a body frozen but for 1e-6 of noise, scores what
people do, or more. `beat_align` compares with the same motion slid along the same speech (`beat_lift`), the
beats of short clips end to end.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..motion.poses.euler import to_angles
from ..motion.rotations import Array
from ._scipy import scipy
from .beat_lift import accents, lift_of_times, wrist_peaks
from .interval import groups_of, mean_score
from .metric import metric
from .movement import Track
from .onsets import HOP, backtrack, onset_frames, onset_strength, onset_times, rms
from .sample import Sample, Score, Tools

__all__ = [
    "angle_changes", "angle_minima", "beat_align", "beat_align_beat", "beat_align_gfge", "beat_align_ha2g", 
    "closeness", "speed_minima",
]  # fmt: skip

FRAMES_SIGMA = 5.0  # frames (flow paper, "σ = 5"; the unit is not said, MINT's σ = 3 is in frames)
ORDER, ORDER_FPS = 10, 60.0  # MINT calculate_beat_scores.py: 10 frames at 60 per second
HA2G_SIGMA, HA2G_LEAST = 0.1, 0.03  # s, of the normalised angle change (HA2G train.py)
BEAT_SIGMA, BEAT_ORDER, BEAT_FROM, BEAT_TO = 0.3, 2, 10.0, 500.0  # s, frames, s, s (BEAT 2022 utils/metric.py, test.py)
LIBRARY_RATE = 22_050.0
"""Samples per second, the default of librosa. BEAT 2022 (utils/metric.py) computes onset strength at the rate of the sound, and
leaves this default where it picks the peaks and where it computes times: times are × 16000 / 22050."""
SHORTEST, RUN = 1.5, 30.0  # s; ours: clips shorter than RUN are laid end to end, so that they can be shifted
RING = ("RightHandRing2", "rightRingIntermediate")  # the finger whose three columns BEAT 2022 takes for the right wrist


def closeness(beats: Array, others: Array, sigma: float) -> float:
    """Mean over ``beats`` of exp(−d²/2σ²), d the distance to the nearest of ``others``; 0 where either is empty."""
    if not len(beats) or not len(others):
        return 0.0
    gap = np.abs(np.asarray(beats, np.float64)[:, None] - np.asarray(others, np.float64)).min(1)
    return float(np.exp(-np.square(gap) / (2 * sigma**2)).mean())


def _minima(x: Array, order: int) -> Array:
    return scipy("signal").argrelextrema(x, np.less, order=max(order, 1))[0]


def speed_minima(positions: Array, order: int) -> Array:
    """Frames where the summed joint speed of (T, J, 3) is least within ``order`` frames either side (MINT)."""
    speed = np.zeros(len(positions))
    speed[1:] = np.linalg.norm(np.diff(positions, axis=0), axis=-1).sum(1)
    return _minima(speed, order)


def angle_changes(track: Track) -> Array:
    """(T, 4) change per frame of the angles shoulder line–upper arm and upper arm–forearm, both arms, in π; 0 first."""
    line = track.shoulders - track.shoulders[:, ::-1]
    upper, fore = track.elbows - track.shoulders, track.wrists - track.elbows
    angles = []
    for a, b in ((line, upper), (upper, fore)):
        size = np.maximum(np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1), 1e-12)
        angles.append(np.arccos(np.clip((a * b).sum(-1) / size, -1, 1)) / np.pi)
    change = np.abs(np.diff(np.concatenate(angles, 1), axis=0))
    return np.concatenate([np.zeros((1, change.shape[1])), change])


def angle_minima(change: Array) -> Array:
    """Frames where the normalised change is below both neighbours, and by .03 below one of them (HA2G)."""
    before, here, after = change[1:-2], change[2:-1], change[3:]
    deep = (before - here >= HA2G_LEAST) | (after - here >= HA2G_LEAST)
    return np.flatnonzero((here < before) & (here < after) & deep) + 2


def _speech(sample: Sample) -> tuple[Array, float]:
    assert sample.speech is not None
    return np.asarray(sample.speech.samples, np.float64), float(sample.speech.rate)


@metric("speech", "track", better="higher", hears=True)
def beat_align(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Lift over chance: how far the hands follow the accents; 0 for noise, for stillness and for the wrong speech."""
    runs: list[tuple[Array, Array, float]] = []
    for sample in generated:
        assert sample.track is not None
        samples, rate = _speech(sample)
        seconds = len(samples) / rate
        if min(seconds, len(sample.track.hips) / sample.track.fps) < SHORTEST:
            continue
        here = (accents(samples, rate), wrist_peaks(sample.track), seconds)
        if runs and runs[-1][2] < RUN:
            a, b, before = runs[-1]
            runs[-1] = (np.concatenate([a, here[0] + before]), np.concatenate([b, here[1] + before]), before + seconds)
        else:
            runs.append(here)
    lift = lift_of_times(runs, seed=tools.seed)
    return Score(lift.far, lift.interval, lift.accents, f"lag {lift.lag:+.2f} s", lift.draws)


@metric("speech", "positions", better="higher", hears=True)
def beat_align_gfge(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Flow paper's BA (MINT's formula, σ = 5 frames): mean over *motion* beats; rewards jitter."""
    values = []
    for sample in generated:
        assert sample.positions is not None
        motion = speed_minima(sample.positions, round(ORDER * sample.fps / ORDER_FPS))
        values.append(closeness(motion, onset_times(*_speech(sample)) * sample.fps, FRAMES_SIGMA))
    return mean_score(values, groups=groups_of(generated), seed=tools.seed, note=f"{generated[0].fps:g} fps")


@metric("speech", "track", better="higher", hears=True)
def beat_align_ha2g(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """HA2G's beat consistency (σ = .1 s): mean over *audio* beats, motion beats where arm angles pause; rewards jitter."""
    if min(len(s.track.hips) for s in (*reference, *generated) if s.track is not None) < 4:
        raise InputError("a clip of fewer than 4 frames", "minima need neighbours")
    norm = np.concatenate([angle_changes(s.track)[1:] for s in (reference or generated) if s.track is not None]).mean(0)
    norm = np.where(norm > 0, norm, 1.0)
    total, weight, groups = [], [], []
    for sample in generated:
        assert sample.track is not None
        motion = angle_minima((angle_changes(sample.track) / norm).mean(1)) / sample.track.fps
        audio = onset_times(*_speech(sample))
        if len(motion) and len(audio):  # as coded: clips without motion beats do not count at all
            total.append(closeness(audio, motion, HA2G_SIGMA))
            weight.append(float(len(audio)))
            groups.append(sample.group)
    if not total:
        return Score(0.0, None, 0, "no motion beats")
    return mean_score(total, weight, groups=groups, seed=tools.seed)


@metric("speech", "rotations", better="higher", hears=True)
def beat_align_beat(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """BEAT's BeatAlign as CoG quotes it (σ = .3 s, one finger, audio times × .7256): over audio beats; rewards jitter.

    As coded: the peak windows of the onsets are those of 22,050 Hz, and onsets move back to a minimum of the Hann-weighted rms.
    """
    values, groups = [], []
    for sample in generated:
        assert sample.rotations is not None
        if not sample.rotations.shape[1]:
            raise InputError(f"{sample.name!r} has no joints")
        samples, rate = _speech(sample)
        samples = samples[round(BEAT_FROM * rate) : round(BEAT_TO * rate)]
        frames = slice(round(BEAT_FROM * sample.fps), round(BEAT_TO * sample.fps) + 1)  # one more, for the last velocity
        joint = next((sample.names.index(name) for name in RING if name in sample.names), sample.rotations.shape[1] - 1)
        angles = to_angles(sample.rotations[frames, joint])
        if len(samples) < rate or len(angles) < sample.fps:
            continue
        motion = _minima(np.linalg.norm(np.diff(angles, axis=0), axis=1), BEAT_ORDER) / sample.fps
        onsets = backtrack(onset_frames(onset_strength(samples, rate), LIBRARY_RATE), rms(samples, hann=True))
        values.append(closeness(onsets * (HOP / LIBRARY_RATE), motion, BEAT_SIGMA))
        groups.append(sample.group)
    if not values:
        raise InputError("no clip is longer than 11 s", f"BEAT's form leaves out the first {BEAT_FROM:g} s")
    return mean_score(values, groups=groups, seed=tools.seed)
