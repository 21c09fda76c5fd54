"""Movement statistics: how fast, how far, how often and how smoothly somebody moves while speaking.

The rows are those of `cospeech.metrics.movement_reference.REFERENCE`. Everything is taken at 30 frames per second, from
positions less the hips' and turned by the *slow heading* (the yaw of the shoulder line below 0.1 Hz). Speed, acceleration
and jerk are central differences without smoothing; rest, strokes and hands' correlation are taken below 6 Hz. Heights and
distances are relative to the middle of the shoulders (outward: to the own shoulder) and divided by the *arm*, shoulder to
wrist. A *stroke* is a peak of wrist speed ≥ 0.5 m/s with prominence ≥ 0.25 m/s, at least 0.17 s from the next; it lasts
from one minimum of the speed to the next. *Chest level* is 60 % of the way from hips to shoulders; the *torso* is the
frame of shoulder line and the line from hips to mid-shoulder.

Where the definition on the motion page leaves a choice (difference scheme, limits of a stroke, spectral windows) the one
was taken with which every window of a real take falls inside the printed ranges. Head, fingers and feet are not in that
take: their exact definitions are ours.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..motion import Motion
from ..rotations import Array, quat_angle, quat_conjugate, quat_multiply, quat_rotate, quat_to_rotvec

__all__ = ["FPS", "STROKE", "Track", "low_pass", "movement_statistics", "window_statistics", "wrist_speeds"]

FPS = 30.0  # frames per second of every statistic (motion page, §1)
WINDOW = 30.0  # seconds per window (motion page, §1)
HEADING = 0.1  # Hz; "slow heading removed". Ours: with 0.1 the torso's yaw of the real take lies inside the ranges
SMOOTH = 6.0  # Hz; rest, strokes and coupling (motion page, §1)
REST = 0.1  # m/s (motion page, §1)
STROKE = {"height": 0.5, "prominence": 0.25, "distance": round(0.17 * FPS)}  # m/s, m/s, frames (motion page, §1)
CHEST = 0.6  # of the way from hips to shoulders (motion page, §1)
NOD = 3.0  # degrees; prominence of a nod. Ours: half the measured SD of head pitch
STEP = 0.3  # m/s (motion page, §1, last row)


@dataclass(frozen=True)
class Track:
    """World positions (metres, Y up, facing about +Z) and rotations (xyzw) that the statistics need; left before right.

    Args:
        fps: frames per second.
        hips: (T, 3).
        shoulders, elbows, wrists: (T, 2, 3).
        head: (T, 4) world rotation, or None: rows of the head are then left out.
        fingers: (T, K, 4) local rotations, or None.
        feet: (T, 2, 3) ankles, or None.
    """

    fps: float
    hips: Array
    shoulders: Array
    elbows: Array
    wrists: Array
    head: Array | None = None
    fingers: Array | None = None
    feet: Array | None = None

    @staticmethod
    def of(motion: Motion) -> "Track":
        """The track of a motion on our humanoid, at 30 frames per second."""
        if motion.skeleton.kind != "humanoid":
            raise InputError(f"movement statistics of a {motion.skeleton.kind!r} skeleton", "retarget('humanoid') first")
        motion = motion.resample(FPS)
        skeleton = motion.skeleton
        positions, world = skeleton.forward(motion.rotations, motion.root)

        def pair(part: str) -> Array:
            return positions[:, [skeleton.index["left" + part], skeleton.index["right" + part]]]

        return Track(
            fps=FPS,
            hips=positions[:, skeleton.index["hips"]],
            shoulders=pair("UpperArm"),
            elbows=pair("LowerArm"),
            wrists=pair("Hand"),
            head=world[:, skeleton.index["head"]],
            fingers=np.asarray(motion.rotations[:, [*skeleton.left_hand, *skeleton.right_hand]], np.float64),
            feet=pair("Foot"),
        )


def low_pass(x: Array, cutoff: float, fps: float = FPS) -> Array:
    """``x (T, …)`` below ``cutoff`` Hz, without delay (Butterworth of second order, forwards and backwards)."""
    from scipy.signal import butter, sosfiltfilt

    return sosfiltfilt(butter(2, cutoff, fs=fps, output="sos"), x, axis=0, padlen=min(len(x) - 1, int(3 * fps / cutoff)))


def _rate(x: Array, order: int = 1) -> Array:
    """Central differences of ``x (T, …)`` along time, ``order`` times."""
    for _ in range(order):
        x = np.gradient(x, axis=0) * FPS
    return x


def _norm(x: Array) -> Array:
    return np.linalg.norm(x, axis=-1)


def _local(track: Track) -> tuple[dict[str, Array], Array]:
    """Arms relative to the hips with the slow heading removed, and the quaternions (T, 4) that remove it."""
    line = track.shoulders[:, 0] - track.shoulders[:, 1]
    yaw = low_pass(np.unwrap(np.arctan2(-line[:, 2], line[:, 0])), HEADING)
    turn = np.zeros((len(yaw), 4))
    turn[:, 1], turn[:, 3] = np.sin(-yaw / 2), np.cos(yaw / 2)
    parts = {
        name: quat_rotate(turn[:, None], getattr(track, name) - track.hips[:, None])
        for name in ("shoulders", "elbows", "wrists")
    }
    return parts, turn


def wrist_speeds(track: Track) -> Array:
    """(T, 2) speed of the left and right wrist relative to hips and slow heading, below 6 Hz, in m/s."""
    return _norm(_rate(low_pass(_local(track)[0]["wrists"], SMOOTH)))


def _percentiles(name: str, unit: str, x: Array, levels: tuple[int, ...]) -> dict[str, float]:
    return {f"{name} {level} %{unit}": float(np.percentile(x, level)) for level in levels}


def _speed_rows(wrists: Array, window: slice) -> dict[str, float]:
    speed, acceleration, jerk = (_norm(_rate(wrists, order))[window] for order in (1, 2, 3))
    return {
        **_percentiles("wrist speed", ", m/s", speed, (10, 25, 50, 75, 90, 99)),
        **_percentiles("left", "", speed[:, 0], (50, 90, 99)),
        **_percentiles("right", "", speed[:, 1], (50, 90, 99)),
        "speed SD / mean": float(speed.std() / max(speed.mean(), 1e-12)),
        **_percentiles("acceleration", ", m/s²", acceleration, (50, 90, 99)),
        **_percentiles("jerk", ", m/s³", jerk, (50, 90, 99)),
    }


def _stroke_rows(smooth: Array, window: slice) -> dict[str, float]:
    """Rest, strokes and the share of the hands, from positions below 6 Hz."""
    from scipy.signal import find_peaks

    speed, jerk = _norm(_rate(smooth))[window], _norm(_rate(smooth, 3))[window]
    minutes = len(speed) / FPS / 60
    counts, peaks, durations, smoothness = [], [], [], []
    for v, j in zip(speed.T, jerk.T, strict=True):
        found = find_peaks(v, **STROKE)[0]
        lows = np.concatenate([[0], find_peaks(-v)[0], [len(v) - 1]])
        starts, stops = lows[np.searchsorted(lows, found) - 1], lows[np.searchsorted(lows, found)]
        lasts = (stops - starts) / FPS
        energy = np.array([np.sum(j[a : b + 1] ** 2) / FPS for a, b in zip(starts, stops, strict=True)])
        counts.append(len(found))
        peaks.append(v[found])
        durations.append(lasts)
        smoothness.append(-np.log(np.maximum(lasts**3 / v[found] ** 2 * energy, 1e-12)))
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
        rows |= _percentiles("stroke duration", ", s", np.concatenate(durations), (10, 50, 90))
    return {name: float(value) for name, value in rows.items()}


def _place_rows(parts: dict[str, Array], window: slice) -> dict[str, float]:
    """Where the hands are: heights, shares, distances, elbows."""
    shoulders, elbows, wrists = (parts[name][window] for name in ("shoulders", "elbows", "wrists"))
    upper, fore = elbows - shoulders, wrists - elbows
    arm = (_norm(upper) + _norm(fore)).mean(0)[:, None]
    middle = shoulders.mean(1, keepdims=True)
    outward = np.array([1.0, -1.0])
    place = (wrists - middle) / arm
    level = wrists[..., 1] / middle[..., 1]
    flexion = np.degrees(np.arctan2(_norm(np.cross(upper, fore)), np.sum(upper * fore, -1)))
    shares = {
        "share of time: wrist below hip": level < 0,
        "share of time: hip to chest": (level >= 0) & (level < CHEST),
        "share of time: chest to shoulder": (level >= CHEST) & (level < 1),
        "share of time: above shoulder": level >= 1,
        "share beyond the midline": place[..., 0] * outward < 0,
    }
    return {
        **{name: float(there.mean()) for name, there in shares.items()},
        **_percentiles("height over shoulders / arm,", "", place[..., 1], (5, 50, 95)),
        **_percentiles("outward of own shoulder / arm,", "", ((wrists - shoulders) / arm)[..., 0] * outward, (5, 50, 95)),
        **_percentiles("forward of shoulders / arm,", "", place[..., 2], (5, 50, 95)),
        "SD of height / arm": float(place[..., 1].std(0).mean()),
        "SD of lateral / arm": float(place[..., 0].std(0).mean()),
        "SD of forward / arm": float(place[..., 2].std(0).mean()),
        **_percentiles("elbow flexion left", ", deg", flexion[:, 0], (5, 50, 95)),
        **_percentiles("elbow flexion right", ", deg", flexion[:, 1], (5, 50, 95)),
    }


def _spectrum(x: Array, seconds: float) -> tuple[Array, Array]:
    """Frequencies and power of ``x (T, …)``, summed over all channels (Welch, Hann)."""
    from scipy.signal import welch

    frequency, power = welch(x, FPS, nperseg=min(len(x), round(seconds * FPS)), axis=0, detrend="constant")
    return frequency, power.reshape(len(frequency), -1).sum(1) + 1e-30


def _spectrum_rows(wrists: Array, window: slice) -> dict[str, float]:
    frequency, position = _spectrum(wrists[window], 17.0)  # 17 s: Ours, see the module's docstring
    velocity = _spectrum(_rate(wrists)[window], 17.0)[1]
    band = (frequency >= 0.1) & (frequency <= 10)
    fast = frequency > 4
    strongest = max(velocity[(frequency >= f - 0.15) & (frequency <= f + 0.15)].sum() for f in frequency)
    return {
        "slope of log position power, 0.1–10 Hz": float(np.polyfit(np.log(frequency[band]), np.log(position[band]), 1)[0]),
        "position power above 4 Hz": float(position[fast].sum() / position.sum()),
        "velocity power above 4 Hz": float(velocity[fast].sum() / velocity.sum()),
        "velocity power in the strongest 0.3 Hz": float(strongest / velocity.sum()),
    }


def _torso_rows(shoulders: Array, window: slice) -> dict[str, float]:
    line, up = shoulders[:, 0] - shoulders[:, 1], shoulders.mean(1)
    pitch, roll = np.arctan2(up[:, 2], up[:, 1]), np.arctan2(up[:, 0], up[:, 1])
    yaw = np.arctan2(-line[:, 2], line[:, 0])
    angles = np.degrees(np.stack([pitch, roll, yaw], -1))
    speed = _norm(_rate(angles))[window]
    angles = angles[window]
    frequency, power = _spectrum(angles[:, :2], 20.0)
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


def _head_rows(head: Array, window: slice) -> dict[str, float]:
    """``head (T, 4)``: world rotation with the slow heading removed."""
    from scipy.signal import find_peaks

    face, left = (quat_rotate(head, np.array(axis)) for axis in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    pitch = np.degrees(np.arcsin(np.clip(-face[:, 1], -1, 1)))  # nodding down is positive
    yaw = np.degrees(np.unwrap(np.arctan2(face[:, 0], face[:, 2])))
    roll = np.degrees(np.arcsin(np.clip(left[:, 1], -1, 1)))
    nods = find_peaks(low_pass(pitch, SMOOTH)[window], prominence=NOD)[0]
    return {
        "head pitch SD, deg": float(pitch[window].std()),
        "head yaw SD, deg": float(yaw[window].std()),
        "head roll SD, deg": float(roll[window].std()),
        **_percentiles("head speed", ", deg/s", _turning(head[window]), (50, 90, 99)),
        "nods per min": len(nods) / (len(pitch[window]) / FPS / 60),
    }


def _finger_rows(fingers: Array, window: slice) -> dict[str, float]:
    """``fingers (T, K, 4)``. A joint's range is taken about the axis it turns most about."""
    local = fingers[window]
    middle = quat_conjugate(local[len(local) // 2])
    turned = np.degrees(quat_to_rotvec(quat_multiply(middle, local)))
    turned = turned - turned.mean(0)
    axes = np.linalg.eigh(np.einsum("tki,tkj->kij", turned, turned))[1][..., -1]
    span = np.ptp(np.percentile(np.einsum("tki,ki->tk", turned, axes), (5, 95), axis=0), axis=0)
    return {
        "finger joint 5–95 %, median joint, deg": float(np.median(span)),
        "finger joint 5–95 %, largest, deg": float(span.max()),
        **_percentiles("finger speed", ", deg/s", _turning(local), (50, 90, 99)),
    }


def _ground_rows(hips: Array, feet: Array | None, window: slice) -> dict[str, float]:
    """Hips and feet in the world."""
    from scipy.signal import find_peaks

    minutes = len(hips[window]) / FPS / 60
    rows = {
        "hip path (1 Hz), m/min": float(_norm(np.diff(low_pass(hips, 1.0)[window], axis=0)).sum() / minutes),
        "hip SD, m": float(np.sqrt(hips[window].var(0).sum())),
    }
    if feet is None:
        return rows
    speed, smooth = _norm(_rate(feet))[window], _norm(_rate(low_pass(feet, SMOOTH)))[window]
    steps = sum(len(find_peaks(v, height=STEP, distance=STROKE["distance"])[0]) for v in smooth.T)
    return {
        **rows,
        **_percentiles("foot speed", ", m/s", speed, (50, 90, 99)),
        "foot moving (> 0.1 m/s)": float((speed > REST).mean()),
        "steps per min (peaks > 0.3 m/s)": steps / minutes,
    }


def window_statistics(motion: Motion | Track, *, window: float = WINDOW) -> list[dict[str, float]]:
    """The rows of every full window of ``window`` seconds (of the whole motion where it is shorter than one).

    A row that does not exist in a window (the duration of strokes where there are none) is absent from its dictionary.

    Raises:
        InputError: shorter than 3 s, another skeleton than ours, or a track that is not at 30 frames per second.
    """
    track = Track.of(motion) if isinstance(motion, Motion) else motion
    frames = len(track.hips)
    if track.fps != FPS:
        raise InputError(f"a track at {track.fps} frames per second", f"resample to {FPS:g}")
    if frames < 3 * FPS:
        raise InputError(f"{frames / FPS:.2f} s of motion", "movement statistics need 3 s at least, better 30")
    parts, turn = _local(track)
    smooth = low_pass(parts["wrists"], SMOOTH)
    head = None if track.head is None else quat_multiply(turn, track.head)
    length = min(frames, round(window * FPS))
    result = []
    for start in range(0, frames - length + 1, length):
        cut = slice(start, start + length)
        rows = _speed_rows(parts["wrists"], cut) | _stroke_rows(smooth, cut) | _place_rows(parts, cut)
        rows |= _spectrum_rows(parts["wrists"], cut) | _torso_rows(parts["shoulders"], cut)
        rows |= {} if head is None else _head_rows(head, cut)
        rows |= {} if track.fingers is None else _finger_rows(track.fingers, cut)
        result.append(rows | _ground_rows(track.hips, track.feet, cut))
    return result


def movement_statistics(motion: Motion | Track, *, window: float = WINDOW) -> dict[str, float]:
    """Mean over windows of every row, in the order of `REFERENCE`; see the module for definitions.

    Raises:
        InputError: as `window_statistics`.
    """
    return mean_rows(window_statistics(motion, window=window))


def mean_rows(windows: list[dict[str, float]]) -> dict[str, float]:
    """Mean of each row over the windows that have it, in the order of `REFERENCE`."""
    from .movement_reference import REFERENCE

    found = {name: [w[name] for w in windows if np.isfinite(w.get(name, np.nan))] for name in REFERENCE}
    return {name: float(np.mean(values)) for name, values in found.items() if values}
