"""Body: does the trunk move as that of a person does, and do the strokes? Statistics beside those of `movement`.

All at 30 frames per second. *World* series are as they are; wrists are relative to the hips with the slow heading removed
(`cospeech.metrics.movement.arms_of`). *Smooth* is below 6 Hz. A stroke is a peak of the movement statistics (smooth wrist
speed ≥ 0.5 m/s). For its shape, it begins where the speed rises through a fifth of the peak, or at the minimum before, and it
ends where the speed falls through the same fifth, or at the minimum after. Spreads are taken in windows of 30 s and averaged.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.rotations import Array, quat_angle, quat_conjugate, quat_multiply, quat_to_rotvec
from ._scipy import scipy
from .movement import WINDOW, Track, arms_of
from .movement_body import finger_rows
from .movement_hands import STROKE, stroke_rows
from .movement_signal import FPS, SMOOTH, low_pass, norm, rate

__all__ = ["BODY_TARGETS", "BodyRange", "body_statistics"]

EDGE = 0.2
"""Share of its peak speed at which a stroke begins and ends. [ours] With it a real take has a straightness of .89 and an SD of
.117, as printed for real people (.90; .093 and .118), and the rules of before .995 and .042 (.995 and .047)."""
STILL = 0.08  # m/s; slower wrists are still (docs/models/rules.md)
SHORTEST = 3.0  # seconds; [ours] a motion shorter than this has no statistics


class BodyRange(NamedTuple):
    """Lowest and highest value that a person has; infinite where one side is open."""

    low: float
    high: float

    def holds(self, value: float) -> bool:
        """Whether ``value`` lies in the range, bounds included; NaN does not."""
        return self.low <= value <= self.high


BODY_TARGETS: dict[str, BodyRange] = {
    "stroke straightness": BodyRange(0.86, 0.95),
    "time to peak, SD over strokes": BodyRange(0.08, 0.13),
    "mid-shoulder speed, mm/s": BodyRange(35, np.inf),
    "pelvis rotation SD, deg": BodyRange(7, 12),
    "hip height SD, cm": BodyRange(0.5, 2.6),
    "hip travel SD, cm": BodyRange(5, 27),
    "clavicle rotation SD, deg": BodyRange(4, np.inf),
    "still spells 90 %, s": BodyRange(0.6, 1.3),
    "r of wrist and mid-shoulder speed": BodyRange(0.3, 0.5),
    "r of wrist and head speed": BodyRange(0.15, 0.45),
    "mirror correlation of the hands": BodyRange(0.1, 0.5),
    "finger joint range, largest, deg": BodyRange(57, np.inf),
    "log dimensionless jerk per stroke": BodyRange(-5.3, -4.7),
}
"""Statistic → range between two recorded people, measured on takes of 34 s and more (docs/models/rules.md)."""


def body_statistics(motion: Motion | Track) -> dict[str, float]:
    """Every statistic of `BODY_TARGETS` that the track has the joints for; NaN where it is not defined.

    Raises:
        InputError: shorter than 3 s, another skeleton than our humanoid, or a track that is not at 30 frames per second.
    """
    track = Track.of(motion) if isinstance(motion, Motion) else motion
    if track.fps != FPS or len(track.hips) < SHORTEST * FPS:
        raise InputError(f"{len(track.hips)} frames at {track.fps} per second", f"{SHORTEST:g} s at {FPS:g} or more")
    smooth = low_pass(arms_of(track)["wrists"], SMOOTH)
    speed = norm(rate(smooth))
    rows = _stroke_shapes(smooth, speed)
    shoulders = norm(rate(low_pass(track.shoulders.mean(1), SMOOTH)))
    rows["mid-shoulder speed, mm/s"] = float(np.median(shoulders)) * 1000
    rows |= _spreads(track)
    rows["still spells 90 %, s"] = _still_spells(speed)
    rows["r of wrist and mid-shoulder speed"] = _correlation(speed.mean(1), shoulders)
    if track.head is not None:
        turning = np.degrees(quat_angle(track.head[:-1], track.head[1:])) * FPS
        rows["r of wrist and head speed"] = _correlation(speed.mean(1)[1:], low_pass(turning, SMOOTH))
    velocity = rate(smooth)
    mirrored = velocity[:, 1] * np.array([-1.0, 1.0, 1.0])
    rows["mirror correlation of the hands"] = _correlation(velocity[:, 0], mirrored)
    cuts = _windows(len(smooth))
    if track.fingers is not None:
        ranges = [finger_rows(track.fingers, cut)["finger joint 5–95 %, largest, deg"] for cut in cuts]
        rows["finger joint range, largest, deg"] = float(np.mean(ranges))
    jerks = [stroke_rows(smooth, cut).get("log dimensionless jerk per stroke", np.nan) for cut in cuts]
    rows["log dimensionless jerk per stroke"] = _mean(jerks)
    return {name: rows[name] for name in BODY_TARGETS if name in rows}


def _stroke_shapes(smooth: Array, speed: Array) -> dict[str, float]:
    """How straight strokes are, and how much the position of their peaks varies; both hands together."""
    find_peaks = scipy("signal").find_peaks
    straight, share = [], []
    for side in (0, 1):
        v = speed[:, side]
        peaks = find_peaks(v, **STROKE)[0]
        lows = np.concatenate([[0], find_peaks(-v)[0], [len(v) - 1]])
        for peak, k in zip(peaks, np.searchsorted(lows, peaks), strict=True):
            a, z = _edges(v, int(peak), int(lows[k - 1]), int(lows[k]))
            way = smooth[a : z + 1, side]
            path = norm(np.diff(way, axis=0)).sum()
            straight.append(float(np.linalg.norm(way[-1] - way[0]) / max(path, 1e-9)))
            share.append((peak - a) / max(z - a, 1))
    return {
        "stroke straightness": float(np.median(straight)) if straight else np.nan,
        "time to peak, SD over strokes": float(np.std(share)) if len(share) > 1 else np.nan,
    }


def _edges(v: Array, peak: int, low: int, high: int) -> tuple[int, int]:
    """First and last frame of the stroke around a peak of the speed, between the minima ``low`` and ``high``."""
    slow = v < EDGE * v[peak]
    before, after = np.flatnonzero(slow[low:peak]), np.flatnonzero(slow[peak : high + 1])
    return (low + int(before[-1]) if len(before) else low), (peak + int(after[0]) if len(after) else high)


def _windows(frames: int) -> list[slice]:
    """Full windows of 30 s; one window of all frames where there are fewer."""
    length = min(frames, round(WINDOW * FPS))
    return [slice(a, a + length) for a in range(0, frames - length + 1, length)]


def _spreads(track: Track) -> dict[str, float]:
    """Spread of pelvis, hips and clavicles, mean over windows."""
    cuts = _windows(len(track.hips))
    rows = {
        "hip height SD, cm": _mean([track.hips[cut, 1].std() * 100 for cut in cuts]),
        "hip travel SD, cm": _mean([np.sqrt(track.hips[cut][:, [0, 2]].var(0).sum()) * 100 for cut in cuts]),
    }
    if track.pelvis is not None:
        rows["pelvis rotation SD, deg"] = _mean([_turn_spread(track.pelvis[cut]) for cut in cuts])
    if track.clavicles is not None:
        sides = [_turn_spread(track.clavicles[cut, side]) for cut in cuts for side in (0, 1)]
        rows["clavicle rotation SD, deg"] = _mean(sides)
    return rows


def _turn_spread(rotations: Array) -> float:
    """Root of the sum over axes of the variance of ``rotations (T, 4)`` about their mean, degrees."""
    aligned = rotations * np.sign(np.einsum("ti,i->t", rotations, rotations[0]) + 1e-12)[:, None]
    middle = aligned.mean(0) / np.linalg.norm(aligned.mean(0))
    turns = np.degrees(quat_to_rotvec(quat_multiply(quat_conjugate(middle), rotations)))
    return float(np.sqrt(turns.var(0).sum()))


def _still_spells(speed: Array) -> float:
    """90th percentile of how long a wrist stays below `STILL`, seconds; 0 where it never does."""
    lasts: list[int] = []
    for v in speed.T:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], (v < STILL).astype(int), [0]])))
        lasts += list(edges[1::2] - edges[::2])
    return float(np.percentile(lasts, 90)) / FPS if lasts else 0.0


def _correlation(a: Array, b: Array) -> float:
    """Correlation of all values of two series; NaN where one does not move."""
    if min(a.std(), b.std()) < 1e-9:
        return np.nan
    return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])


def _mean(values: list[float]) -> float:
    finite = [float(v) for v in values if np.isfinite(v)]
    return float(np.mean(finite)) if finite else np.nan
