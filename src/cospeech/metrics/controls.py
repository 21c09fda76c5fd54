"""The control rows that stand beside every table, and whether a metric puts them in the right order.

* ground truth: the clips themselves.
* frozen pose: the mean pose of all clips, with 1e-6 rad (or m, px) of jitter, which misleads metrics that count peaks.
* white noise: independent from frame to frame, with the mean and the deviation of the clips.
* shuffled speech: the true motion beside another clip's speech; only metrics that hear the speech can notice.
* another clip: another clip's true motion beside this one's speech.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.rotations import Array, quat_conjugate, quat_multiply, quat_normalize, quat_to_rotvec, rotvec_to_quat
from .metric import About
from .sample import Score

__all__ = [
    "CONTROLS",
    "UNSURE",
    "WRONG",
    "another_clip",
    "control_rows",
    "faults_of_order",
    "freeze_pose",
    "shuffle_speech",
    "white_noise",
]

CONTROLS = ("ground truth", "frozen pose", "white noise", "shuffled speech", "another clip")
JITTER = 1e-6  # rad, m, px: what is on a body that "does not move" after a network or a file format
WRONG, UNSURE = "not worse than", "too near to tell from"
CLOSE = 1e-9  # ours: values that differ by less of their size are equal

Clip = Any
"""A frozen dataclass with ``name``, ``speech``, and ``motion`` or ``points`` (`cospeech.corpora.Clip`)."""


def _body(clip: Clip) -> Any:
    return clip.motion if clip.motion is not None else clip.points


def _kin(clips: Sequence[Clip], clip: Clip) -> list[Clip]:
    """The clips that have the same joints, this one first and then in cyclic order."""
    start = next(k for k, other in enumerate(clips) if other is clip)
    order = [*clips[start:], *clips[:start]]
    return [other for other in order if _shape(other) == _shape(clip)]


def _shape(clip: Clip) -> tuple[bool, tuple[int, ...]]:
    body = _body(clip)
    return (True, body.rotations.shape[1:]) if isinstance(body, Motion) else (False, body.values.shape[1:])


def _mean_quats(q: Array) -> Array:
    """(J, 4) mean of (T, J, 4): the sum of all, on the half-sphere of the first."""
    signs = np.where((q * q[:1]).sum(-1, keepdims=True) < 0, -1.0, 1.0)
    return quat_normalize((q * signs).sum(0))


def _noisy_face(clip: Clip, kin: Sequence[Clip], size: float | None, rng: np.random.Generator) -> Array | None:
    """The mean face of the clips that have one, with noise as in `_noisy`; the weights stay within 0 … 1."""
    if clip.motion.face is None:
        return None
    faces = np.concatenate([c.motion.face for c in kin if c.motion.face is not None])
    noise = rng.normal(size=clip.motion.face.shape) * (faces.std(0) if size is None else size)
    return np.clip(faces.mean(0) + noise, 0, 1)


def _noisy(clip: Clip, clips: Sequence[Clip], size: float | None, rng: np.random.Generator) -> Clip:
    """The mean pose with noise of deviation ``size``; None: the deviation of the clips."""
    kin, body = _kin(clips, clip), _body(clip)
    if isinstance(body, Motion):
        rotations = np.concatenate([np.asarray(c.motion.rotations, np.float64) for c in kin])
        roots = np.concatenate([c.motion.root for c in kin])
        mean = _mean_quats(rotations)
        spread = quat_to_rotvec(quat_multiply(quat_conjugate(mean), rotations)).std(0) if size is None else size
        turns = rotvec_to_quat(rng.normal(size=(len(body), len(mean), 3)) * spread)
        root = roots.mean(0) + rng.normal(size=(len(body), 3)) * (roots.std(0) if size is None else size)
        face = _noisy_face(clip, kin, size, rng.spawn(1)[0])
        return replace(clip, motion=replace(body, rotations=quat_multiply(mean, turns), root=root, face=face))
    values = np.concatenate([c.points.values for c in kin])
    noise = rng.normal(size=body.values.shape) * (values.std(0) if size is None else size)
    return replace(clip, points=replace(body, values=values.mean(0) + noise))


def freeze_pose(clips: Sequence[Clip], *, seed: int = 0) -> list[Clip]:
    """The mean pose of all clips, with 1e-6 of jitter."""
    rng = np.random.default_rng(seed)
    return [_noisy(clip, clips, JITTER, rng) for clip in clips]


def white_noise(clips: Sequence[Clip], *, seed: int = 0) -> list[Clip]:
    """Noise with the clips' mean pose and deviation, joint by joint."""
    rng = np.random.default_rng(seed)
    return [_noisy(clip, clips, None, rng) for clip in clips]


def _there_and_back(length: int, count: int, start: int = 0) -> Array:
    """``count`` frame numbers from ``start`` on: up to length − 1, back to 0, up again and so on, without a jump."""
    if length < 2:
        return np.zeros(count, int)
    at = (start + np.arange(count)) % (2 * length - 2)
    return np.where(at < length, at, 2 * length - 2 - at)


def another_clip(clips: Sequence[Clip], *, seed: int = 0) -> list[Clip]:
    """The motion of the next clip, to and fro until it is as long as this one; a single clip's own, from its middle on."""
    row = []
    for clip in clips:
        kin, body = _kin(clips, clip), _body(clip)
        other = _body(kin[1] if len(kin) > 1 else clip)
        frames = _there_and_back(len(other), len(body), 0 if len(kin) > 1 else len(body) // 2)
        if isinstance(body, Motion):
            face = None if other.face is None else other.face[frames]
            motion = replace(other, rotations=other.rotations[frames], root=other.root[frames], face=face, start=body.start)
            row.append(replace(clip, motion=motion))
        else:
            row.append(replace(clip, points=replace(other, values=other.values[frames])))
    return row


def shuffle_speech(clips: Sequence[Clip], *, seed: int = 0) -> list[Clip]:
    """The speech of the next clip, repeated or cut to the length of this one; a single clip's own, its second half first."""
    speaking = [clip for clip in clips if clip.speech is not None]
    row = []
    for clip in clips:
        if clip.speech is None:
            row.append(clip)
            continue
        k = next(k for k, other in enumerate(speaking) if other is clip)
        other = speaking[(k + 1) % len(speaking)].speech
        count = round(float(clip.speech.duration) * other.rate)
        samples = np.resize(other.samples if len(speaking) > 1 else np.roll(other.samples, len(other) // 2), count)
        row.append(replace(clip, speech=type(other)(samples, other.rate, None, name=other.name)))
    return row


def control_rows(clips: Sequence[Clip], *, seed: int = 0) -> dict[str, list[Clip]]:
    """All control rows, by name, in the order of `CONTROLS`.

    Raises:
        InputError: there is no clip, or one has neither motion nor key points.
    """
    if not clips:
        raise InputError("no clips to make control rows of")
    still = next((clip.name for clip in clips if _body(clip) is None or not len(_body(clip))), None)
    if still is not None:
        raise InputError(f"clip {still!r} has no motion", "control rows are made of clips with motion or key points")
    makers: tuple[Callable[..., list[Clip]], ...] = (freeze_pose, white_noise, shuffle_speech, another_clip)
    rows = {CONTROLS[0]: list(clips)}
    return rows | {name: make(clips, seed=seed) for name, make in zip(CONTROLS[1:], makers, strict=True)}


def faults_of_order(about: About, scores: Mapping[str, Score | None]) -> list[str]:
    """What a metric puts in the wrong order among the control rows; an empty list where the order is right.

    Frozen pose and white noise must be worse than the ground truth. For a metric that hears the speech, shuffled speech and
    another clip must be worse, too; for one that compares with the recording, another clip. Another clip is real motion: for a
    metric that does not hear, it must be better than frozen pose and white noise, unless chance gives 0. A row that is worse
    but lies inside the interval of the ground truth is listed as unsure: it takes more clips to tell.
    """
    truth, frozen, noise, shuffled, another = CONTROLS
    value_of = {name: score.value for name, score in scores.items() if score is not None and np.isfinite(score.value)}
    if truth not in value_of:
        return []

    def good(name: str) -> float:
        value = value_of[name]
        return {"higher": value, "lower": -value, "reference": -abs(value - value_of[truth])}[about.better]

    pairs = [(truth, frozen), (truth, noise)]
    pairs += [(truth, shuffled)] if about.hears else []
    pairs += [(truth, another)] if about.hears or about.paired else []
    pairs += [] if about.hears or about.chance else [(another, frozen), (another, noise)]
    slack = CLOSE * max(abs(value) for value in value_of.values())
    faults = []
    for better, bad in pairs:
        if better not in value_of or bad not in value_of:
            continue
        score = scores[better]
        ends = score.interval if score is not None and better == truth else None
        if not good(better) > good(bad) + slack:
            faults.append(f"{bad} is {WRONG} {better}")
        elif ends is not None and ends[0] <= value_of[bad] <= ends[1]:
            faults.append(f"{bad} is {UNSURE} {better}")
    return faults
