"""Edits of finished motion: cut, join, loop, another face. Times are in seconds from the first frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError, say_count
from .curves import smoothstep
from .motion import Motion
from .rotations import Array, quat_conjugate, quat_continuous, quat_multiply, quat_to_rotvec, rotvec_to_quat
from .skeletons.arkit import ARKIT

__all__ = ["BLEND", "OffsetFade", "check_blend", "cut", "decay", "join", "loop", "replace_face"]

_BLENDS = (0.0, 10.0)
"""Range of the length of a blend in seconds [ours: from none to longer than any gesture]."""
BLEND = 0.4  # shortest time in which a joint goes from one clip to the other, seconds [ours: about a gesture's preparation]
_HAND_SPEED, _HIP_SPEED = 1.2, 0.2
"""Highest speed of joints, and of the hips, from one clip to the other if no time is given, metres per second. [ours: the peak
of a reach, and of a shift of the weight]"""
_PEAK = 1.5  # highest speed of a smoothstep, divided by its mean


class OffsetFade:
    """Fades out the difference between two poses: the first frames of a clip go on from the pose before it.

    No time is lost or doubled, as it would be if two clips overlapped. So each clip stays in step with its sound.

    Args:
        rotations, root: (J, 4) and (3,) the pose before the clip.
        to_rotations, to_root: (J, 4) and (3,) the first pose of the clip.
        turning, moving: (J, 3) radians and (3,) metres per frame: the speed before the clip, less that of the clip.
    """

    def __init__(
        self, rotations: Array, root: Array, to_rotations: Array, to_root: Array, *,
        turning: Array | float = 0.0, moving: Array | float = 0.0,
    ) -> None:  # fmt: skip
        self.turns = _turn_between(to_rotations, rotations)
        self.way: Array = np.asarray(root, float) - np.asarray(to_root, float)
        self._turning, self._moving = turning, moving

    def apply(self, rotations: Array, root: Array, remainder: Array, drift: Array | float = 0.0) -> tuple[Array, Array]:
        """Add a part of the difference to frames of the clip; returns rotations (n, J, 4) and positions (n, 3).

        Args:
            rotations, root: of the clip.
            remainder: (n,) part of the difference that is added, before smoothing; at 0 nothing changes.
            drift: (n,) number of frames for which the difference of the speeds is added.
        """
        share, further = smoothstep(remainder)[:, None], np.broadcast_to(drift, remainder.shape)[:, None]
        turns = share[..., None] * self.turns + further[..., None] * self._turning
        result = quat_multiply(rotvec_to_quat(turns), rotations.astype(float))
        is_changed = (share > 0) | (further > 0)
        result = np.where(is_changed[..., None], result, rotations).astype(rotations.dtype)
        return result, (root + share * self.way + further * self._moving).astype(root.dtype)


def cut(motion: Motion, start: float | None = None, end: float | None = None) -> Motion:
    """The frames from ``start`` up to ``end`` seconds; None means the beginning or the end.

    Raises:
        InputError: no frame lies between them.
    """
    lasts = f"the motion lasts from 0 to {motion.duration:g} s"
    if start is not None and start < 0:
        raise InputError(f"{start:g} s is before the motion", lasts)
    times = np.arange(len(motion)) / motion.fps
    first = 0 if start is None else int(np.searchsorted(times, start - 1e-9))
    last = len(motion) if end is None else int(np.searchsorted(times, end - 1e-9))
    if first >= last:
        span = " to ".join("the end" if value is None else f"{value:g} s" for value in (start or 0.0, end))
        raise InputError(f"no frame from {span}", lasts)
    return motion[first:last]


def join(motions: Sequence[Motion], *, blend: float | None = None) -> Motion:
    """Join clips. Each goes on from the last pose of the one before, with its speed.

    Args:
        motions: of one skeleton; the rate is that of the first. If one has a face, the faces of those without are neutral.
        blend: seconds until a clip has its own poses; None: `BLEND`, or more if the poses are far apart.

    Raises:
        InputError: there is none, or their skeletons differ.
    """
    motions = [motion for motion in motions if len(motion)]
    if not motions:
        raise InputError("no motion to join")
    check_blend(blend)
    head = motions[0]
    if any(motion.skeleton != head.skeleton for motion in motions):
        raise InputError(
            "clips of different skeletons cannot be joined", "retarget them to one first: motion.retarget('humanoid')"
        )
    has_face = any(motion.face is not None for motion in motions)
    clips = [_with_face(motion) if has_face else motion for motion in motions]
    parts = clips[:1]
    for motion in clips[1:]:
        parts.append(_go_on(parts[-1], motion.resample(head.fps), blend))
    return Motion.concatenate(parts)


def loop(motion: Motion, *, blend: float | None = None) -> Motion:
    """Let the end of a motion lead into its beginning, so that it can be repeated without a jump.

    The first frame follows the last one, a frame later and with its speed: repeat all frames.

    Args:
        blend: seconds before the end in which the poses go to those of the beginning, at most half of the motion; None: as in
            `join`.
    """
    if len(motion) < 2:
        raise InputError(f"{say_count(len(motion), 'frame')} cannot be looped", "give two or more")
    check_blend(blend)
    backwards = _reverse(motion)
    seconds = _time_of(backwards[-1:], backwards[:1]) if blend is None else blend
    result = _reverse(_go_on(backwards[-2:], backwards, min(seconds, motion.duration / 2)))
    return replace(result, rotations=quat_continuous(result.rotations), start=motion.start)


def replace_face(motion: Motion, other: Motion) -> Motion:
    """Give the body and hands of one motion the face of another, resampled to the same rate and cut to the same length.

    A shorter face goes to rest after its end.

    Raises:
        InputError: the other has no face, or no frames.
    """
    if not len(other):
        raise InputError("the other motion has no frames", "is it a slice beyond the end?")
    if other.face is None:
        raise InputError("the other motion has no face", "give a .json, .csv, .glb or .vrma with one")
    face = other.resample(motion.fps).face
    assert face is not None
    longer = max(len(motion) - len(face), 0)
    rest = decay(longer, motion.fps, BLEND)[:, None] * face[-1:]
    return replace(motion, face=np.concatenate([face[: len(motion)], rest]).astype(face.dtype))


def _go_on(before: Motion, motion: Motion, blend: float | None) -> Motion:
    """Change the beginning of a motion so that it follows another one by a frame, at first with the speed of that one."""
    seconds = _time_of(before[-1:], motion[:1]) if blend is None else blend
    turning, moving = _last_step(before)
    back, way_back = _last_step(_reverse(motion[:2]))  # the step from the second frame back to the first
    rotations = quat_multiply(rotvec_to_quat(back), motion.rotations[0].astype(float))
    root = motion.root[0].astype(float) + way_back
    fade = OffsetFade(before.rotations[-1], before.root[-1], rotations, root, turning=turning + back, moving=moving + way_back)
    share = decay(len(motion), motion.fps, seconds)
    slower = decay(len(motion), motion.fps, min(seconds, BLEND))
    drift = np.square(slower) * (1 + np.arange(len(motion)))
    new_rotations, new_root = fade.apply(motion.rotations, motion.root, share, drift)
    face = motion.face
    if face is not None and before.face is not None:
        first = np.clip(2 * face[0] - face[min(1, len(face) - 1)], 0, 1)
        face = np.clip(face + smoothstep(share)[:, None] * (before.face[-1] - first), 0, 1).astype(face.dtype)
    return replace(motion, rotations=new_rotations, root=new_root, face=face)


def check_blend(blend: float | None) -> None:
    """Raise an InputError if a blend does not last 0 … 10 seconds."""
    low, high = _BLENDS
    if blend is not None and not low <= blend <= high:
        raise InputError(f"blend {blend:g}", f"{low:g} … {high:g} seconds")


def _with_face(motion: Motion) -> Motion:
    """A motion with a face: a neutral one if it had none."""
    return motion if motion.face is not None else replace(motion, face=np.zeros((len(motion), len(ARKIT)), np.float32))


def _reverse(motion: Motion) -> Motion:
    face = None if motion.face is None else motion.face[::-1]
    return replace(motion, rotations=motion.rotations[::-1], root=motion.root[::-1], face=face)


def _time_of(before: Motion, after: Motion) -> float:
    """Seconds in which no joint is too fast from one pose to another; both are motions of one frame."""
    ways = np.linalg.norm(after.positions()[0] - before.positions()[0], axis=-1)
    hips = float(np.linalg.norm(after.root[0] - before.root[0]))
    return max(BLEND, _PEAK * float(ways.max()) / _HAND_SPEED, _PEAK * hips / _HIP_SPEED)


def _turn_between(before: Array, after: Array) -> Array:
    """(J, 3) rotation vectors from one pose (J, 4) to another."""
    return quat_to_rotvec(quat_multiply(np.asarray(after, float), quat_conjugate(np.asarray(before, float))))


def _last_step(motion: Motion) -> tuple[Array, Array]:
    """(J, 3) turns and (3,) way of the last step of a motion; zero if it has one frame."""
    last = max(len(motion) - 2, 0)
    way = motion.root[-1].astype(float) - motion.root[last].astype(float)
    return _turn_between(motion.rotations[last], motion.rotations[-1]), way


def decay(frames: int, fps: float, blend: float, first: int = 0) -> Array:
    """(frames,) part of an offset that remains in the frames from ``first`` on: all of it a frame before frame 0, none after
    ``blend`` seconds."""
    return np.clip(1 - (first + np.arange(frames) + 1) / max(blend * fps, 1), 0, 1)
