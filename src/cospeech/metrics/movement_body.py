"""Rows of the movement statistics for torso, head, fingers, hips and feet.

Each function takes the series of the whole motion and a window (a slice of frames): filters run over the whole motion, so that
a window has no edges of its own.
"""

import numpy as np

from ..motion.rotations import Array, quat_angle, quat_conjugate, quat_multiply, quat_rotate, quat_to_rotvec
from ._scipy import scipy
from .movement_signal import FPS, REST, SMOOTH, low_pass, norm, percentiles, rate, spectrum

__all__ = ["finger_rows", "ground_rows", "head_rows", "torso_rows"]

NOD = 3.0  # degrees; prominence of a nod. Ours: half the measured SD of head pitch
STEP, APART = 0.3, round(0.17 * FPS)  # m/s (benchmarks/README.md); frames, as for strokes
SWAY = 20.0  # seconds per spectrum: resolves the slowest sway of the table, 0.15 Hz. Ours


def torso_rows(shoulders: Array, window: slice) -> dict[str, float]:
    line, up = shoulders[:, 0] - shoulders[:, 1], shoulders.mean(1)
    pitch, roll = np.arctan2(up[:, 2], up[:, 1]), np.arctan2(up[:, 0], up[:, 1])
    yaw = np.arctan2(-line[:, 2], line[:, 0])
    angles = np.degrees(np.stack([pitch, roll, yaw], -1))
    speed = norm(rate(angles))[window]
    angles = angles[window]
    frequency, power = spectrum(angles[:, :2], SWAY)
    band = frequency >= 0.1
    spread = np.ptp(np.percentile(angles, (5, 95), axis=0), axis=0)
    return {
        **{f"torso {name} SD, deg": float(x) for name, x in zip(("pitch", "roll", "yaw"), angles.std(0), strict=True)},
        **{f"torso {name} 5–95 %, deg": float(x) for name, x in zip(("pitch", "roll", "yaw"), spread, strict=True)},
        "sway peak of f·P(f), Hz": float(frequency[band][np.argmax((frequency * power)[band])]),
        "torso speed median, deg/s": float(np.median(speed)),
    }


def _turning(rotations: Array) -> Array:
    """Angular speed of ``rotations (T, …, 4)`` in degrees per second, (T − 1, …)."""
    return np.degrees(quat_angle(rotations[:-1], rotations[1:])) * FPS


def head_rows(head: Array, window: slice) -> dict[str, float]:
    """``head (T, 4)``: world rotation with the slow heading removed."""
    face, left = (quat_rotate(head, np.array(axis)) for axis in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    pitch = np.degrees(np.arcsin(np.clip(-face[:, 1], -1, 1)))  # nodding down is positive
    yaw = np.degrees(np.unwrap(np.arctan2(face[:, 0], face[:, 2])))
    roll = np.degrees(np.arcsin(np.clip(left[:, 1], -1, 1)))
    nods = scipy("signal").find_peaks(low_pass(pitch, SMOOTH)[window], prominence=NOD)[0]
    return {
        "head pitch SD, deg": float(pitch[window].std()),
        "head yaw SD, deg": float(yaw[window].std()),
        "head roll SD, deg": float(roll[window].std()),
        **percentiles("head speed", ", deg/s", _turning(head[window]), (50, 90, 99)),
        "nods per min": len(nods) / (len(pitch[window]) / FPS / 60),
    }


def finger_rows(fingers: Array, window: slice) -> dict[str, float]:
    """``fingers (T, K, 4)``. A joint's range is taken about the axis it turns most about."""
    local = fingers[window]
    middle = quat_conjugate(local[len(local) // 2])
    turns = np.degrees(quat_to_rotvec(quat_multiply(middle, local)))
    turns = turns - turns.mean(0)
    axes = np.linalg.eigh(np.einsum("tki,tkj->kij", turns, turns))[1][..., -1]
    span = np.ptp(np.percentile(np.einsum("tki,ki->tk", turns, axes), (5, 95), axis=0), axis=0)
    return {
        "finger joint 5–95 %, median joint, deg": float(np.median(span)),
        "finger joint 5–95 %, largest, deg": float(span.max()),
        **percentiles("finger speed", ", deg/s", _turning(local), (50, 90, 99)),
    }


def ground_rows(hips: Array, feet: Array | None, window: slice) -> dict[str, float]:
    """Hips and feet in the world."""
    minutes = len(hips[window]) / FPS / 60
    rows = {
        "hip path (1 Hz), m/min": float(norm(np.diff(low_pass(hips, 1.0)[window], axis=0)).sum() / minutes),
        "hip SD, m": float(np.sqrt(hips[window].var(0).sum())),
    }
    if feet is None:
        return rows
    speed, smooth = norm(rate(feet))[window], norm(rate(low_pass(feet, SMOOTH)))[window]
    find_peaks = scipy("signal").find_peaks
    steps = sum(len(find_peaks(v, height=STEP, distance=APART)[0]) for v in smooth.T)
    return {
        **rows,
        **percentiles("foot speed", ", m/s", speed, (50, 90, 99)),
        "foot moving (> 0.1 m/s)": float((speed > REST).mean()),
        "steps per min (peaks > 0.3 m/s)": steps / minutes,
    }
