"""Rows of the movement statistics for the hands: speed, strokes, place, spectrum.

Each function takes the series of the whole motion and a window (a slice of frames): filters run over the whole motion, so that
a window has no edges of its own.
"""

import numpy as np

from ..motion.rotations import Array
from ._scipy import scipy
from .movement_signal import FPS, REST, norm, percentiles, rate, spectrum

__all__ = ["STROKE", "place_rows", "spectrum_rows", "speed_rows", "stroke_rows"]

STROKE = {"height": 0.5, "prominence": 0.25, "distance": round(0.17 * FPS)}  # m/s, m/s, frames (benchmarks/README.md)
CHEST = 0.6  # of the way from hips to shoulders (benchmarks/README.md)
SPECTRUM = 17.0  # seconds per spectrum. Ours: long enough for 0.1 Hz, and the real take comes out at the printed means


def speed_rows(wrists: Array, window: slice) -> dict[str, float]:
    speed, acceleration, jerk = (norm(rate(wrists, order))[window] for order in (1, 2, 3))
    return {
        **percentiles("wrist speed", ", m/s", speed, (10, 25, 50, 75, 90, 99)),
        **percentiles("left", "", speed[:, 0], (50, 90, 99)),
        **percentiles("right", "", speed[:, 1], (50, 90, 99)),
        "speed SD / mean": float(speed.std() / max(speed.mean(), 1e-12)),
        **percentiles("acceleration", ", m/s²", acceleration, (50, 90, 99)),
        **percentiles("jerk", ", m/s³", jerk, (50, 90, 99)),
    }


def stroke_rows(smooth: Array, window: slice) -> dict[str, float]:
    """Rest, strokes and the share of the hands, from positions below 6 Hz."""
    find_peaks = scipy("signal").find_peaks
    speed, jerk = norm(rate(smooth))[window], norm(rate(smooth, 3))[window]
    minutes = len(speed) / FPS / 60
    counts, peaks, durations, smoothness = [], [], [], []
    for v, j in zip(speed.T, jerk.T, strict=True):
        strokes = find_peaks(v, **STROKE)[0]
        lows = np.concatenate([[0], find_peaks(-v)[0], [len(v) - 1]])
        starts, stops = lows[np.searchsorted(lows, strokes) - 1], lows[np.searchsorted(lows, strokes)]
        lasts = (stops - starts) / FPS
        energy = np.array([np.sum(j[a : b + 1] ** 2) / FPS for a, b in zip(starts, stops, strict=True)])
        counts.append(len(strokes))
        peaks.append(v[strokes])
        durations.append(lasts)
        smoothness.append(-np.log(np.maximum(lasts**3 / v[strokes] ** 2 * energy, 1e-12)))
    rest = speed < REST
    moving = speed.std(0).min() > 1e-9
    rows = {
        "left at rest (< 0.1 m/s)": rest[:, 0].mean(),
        "right at rest": rest[:, 1].mean(),
        "both at rest": rest.all(1).mean(),
        "strokes per min, left": counts[0] / minutes,
        "strokes per min, right": counts[1] / minutes,
        "strokes per min and hand": sum(counts) / 2 / minutes,
        "left–right speed correlation": np.corrcoef(speed.T)[0, 1] if moving else np.nan,
        "right share of speed": speed[:, 1].sum() / max(speed.sum(), 1e-12),
    }
    if sum(counts):
        rows["median stroke peak, m/s"] = np.median(np.concatenate(peaks))
        rows["log dimensionless jerk per stroke"] = np.median(np.concatenate(smoothness))
        rows |= percentiles("stroke duration", ", s", np.concatenate(durations), (10, 50, 90))
    return {name: float(value) for name, value in rows.items()}


def place_rows(parts: dict[str, Array], window: slice) -> dict[str, float]:
    """Where the hands are: heights, shares, distances, elbows."""
    shoulders, elbows, wrists = (parts[name][window] for name in ("shoulders", "elbows", "wrists"))
    upper, fore = elbows - shoulders, wrists - elbows
    arm = (norm(upper) + norm(fore)).mean(0)[:, None]
    middle = shoulders.mean(1, keepdims=True)
    outward = np.array([1.0, -1.0])
    place = (wrists - middle) / arm
    level = wrists[..., 1] / middle[..., 1]
    flexion = np.degrees(np.arctan2(norm(np.cross(upper, fore)), np.sum(upper * fore, -1)))
    shares = {
        "share of time: wrist below hip": level < 0,
        "share of time: hip to chest": (level >= 0) & (level < CHEST),
        "share of time: chest to shoulder": (level >= CHEST) & (level < 1),
        "share of time: above shoulder": level >= 1,
        "share beyond the midline": place[..., 0] * outward < 0,
    }
    return {
        **{name: float(there.mean()) for name, there in shares.items()},
        **percentiles("height over shoulders / arm,", "", place[..., 1], (5, 50, 95)),
        **percentiles("outward of own shoulder / arm,", "", ((wrists - shoulders) / arm)[..., 0] * outward, (5, 50, 95)),
        **percentiles("forward of shoulders / arm,", "", place[..., 2], (5, 50, 95)),
        "SD of height / arm": float(place[..., 1].std(0).mean()),
        "SD of lateral / arm": float(place[..., 0].std(0).mean()),
        "SD of forward / arm": float(place[..., 2].std(0).mean()),
        **percentiles("elbow flexion left", ", deg", flexion[:, 0], (5, 50, 95)),
        **percentiles("elbow flexion right", ", deg", flexion[:, 1], (5, 50, 95)),
    }


def spectrum_rows(wrists: Array, window: slice) -> dict[str, float]:
    frequency, position = spectrum(wrists[window], SPECTRUM)
    velocity = spectrum(rate(wrists)[window], SPECTRUM)[1]
    band = (frequency >= 0.1) & (frequency <= 10)
    fast = frequency > 4
    strongest = max(velocity[(frequency >= f - 0.15) & (frequency <= f + 0.15)].sum() for f in frequency)
    return {
        "slope of log position power, 0.1–10 Hz": float(np.polyfit(np.log(frequency[band]), np.log(position[band]), 1)[0]),
        "position power above 4 Hz": float(position[fast].sum() / position.sum()),
        "velocity power above 4 Hz": float(velocity[fast].sum() / velocity.sum()),
        "velocity power in the strongest 0.3 Hz": float(strongest / velocity.sum()),
    }
