"""Movement statistics: how fast, how far, how often and how smoothly somebody moves while speaking.

The rows are those of `cospeech.metrics.movement_reference.REFERENCE`. Everything is taken at 30 frames per second, from
positions less the hips' and turned by the *slow heading* (the yaw of the shoulder line below 0.1 Hz). Speed, acceleration
and jerk are central differences without smoothing; rest, strokes and hands' correlation are taken below 6 Hz. Heights and
distances are relative to the middle of the shoulders (outward: to the own shoulder) and divided by the *arm*, shoulder to
wrist. A *stroke* is a peak of wrist speed ≥ 0.5 m/s with prominence ≥ 0.25 m/s, at least 0.17 s from the next; it lasts
from one minimum of the speed to the next. *Chest level* is 60 % of the way from hips to shoulders; the *torso* is the
frame of shoulder line and the line from hips to mid-shoulder.

Where the published definition leaves a choice (difference scheme, limits of a stroke, spectral windows), we took the one
with which every window of a real take falls inside the printed ranges. That take has no head, fingers and feet: their exact
definitions are ours.
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.rotations import Array, quat_multiply, quat_rotate
from .movement_body import finger_rows, ground_rows, head_rows, torso_rows
from .movement_hands import place_rows, spectrum_rows, speed_rows, stroke_rows
from .movement_reference import REFERENCE
from .movement_signal import FPS, SMOOTH, low_pass, norm, rate

__all__ = ["Track", "arms_of", "mean_rows", "movement_statistics", "window_statistics", "wrist_speeds"]

WINDOW = 30.0  # seconds per window (benchmarks/README.md)
HEADING = 0.1  # Hz; "slow heading removed". Ours: with 0.1 the torso's yaw of the real take lies inside the ranges


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
        pelvis: (T, 4) world rotation of the hips, or None (`cospeech.metrics.body` alone asks for it and for clavicles).
        clavicles: (T, 2, 4) local rotations, or None.
    """

    fps: float
    hips: Array
    shoulders: Array
    elbows: Array
    wrists: Array
    head: Array | None = None
    fingers: Array | None = None
    feet: Array | None = None
    pelvis: Array | None = None
    clavicles: Array | None = None

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
            pelvis=world[:, skeleton.index["hips"]],
            clavicles=np.asarray(
                motion.rotations[:, [skeleton.index["leftShoulder"], skeleton.index["rightShoulder"]]], np.float64
            ),
        )


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


def arms_of(track: Track) -> dict[str, Array]:
    """(T, 2, 3) of shoulders, elbows and wrists relative to the hips, the slow heading removed."""
    return _local(track)[0]


def wrist_speeds(track: Track) -> Array:
    """(T, 2) speed of the left and right wrist relative to hips and slow heading, below 6 Hz, in m/s."""
    return norm(rate(low_pass(_local(track)[0]["wrists"], SMOOTH)))


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
        rows = speed_rows(parts["wrists"], cut) | stroke_rows(smooth, cut) | place_rows(parts, cut)
        rows |= spectrum_rows(parts["wrists"], cut) | torso_rows(parts["shoulders"], cut)
        rows |= {} if head is None else head_rows(head, cut)
        rows |= {} if track.fingers is None else finger_rows(track.fingers, cut)
        result.append(rows | ground_rows(track.hips, track.feet, cut))
    return result


def movement_statistics(motion: Motion | Track, *, window: float = WINDOW) -> dict[str, float]:
    """Mean over windows of every row, in the order of `REFERENCE`; see the module for definitions.

    Raises:
        InputError: as `window_statistics`.
    """
    return mean_rows(window_statistics(motion, window=window))


def mean_rows(windows: list[dict[str, float]]) -> dict[str, float]:
    """Mean of each row over the windows that have it, in the order of `REFERENCE`."""
    rows = {name: [w[name] for w in windows if np.isfinite(w.get(name, np.nan))] for name in REFERENCE}
    return {name: float(np.mean(values)) for name, values in rows.items() if values}
