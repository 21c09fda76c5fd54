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
"""Seconds that a blend may last [ours]: from none to longer than any gesture."""
BLEND = 0.4  # seconds in which a joint comes from one clip to the other, at least; ours: about a preparation of a gesture
_HAND_SPEED, _HIP_SPEED = 1.2, 0.2
"""Metres per second at which joints, and the hips, go from one clip to the other where no time is asked for. [ours: a reach is
so fast at its peak, and a shift of the weight]"""
_PEAK = 1.5  # highest speed of a smoothstep, over its mean


class OffsetFade:
    """What is missing from one pose to another, faded out: the first frames go on from where the joints were.

    No time is lost or doubled, as it would be if two clips overlapped, so that each clip stays in step with its sound.

    Args:
        rotations, root: (J, 4) and (3,) the pose to go on from.
        to_rotations, to_root: (J, 4) and (3,) the first pose of what goes on.
        turning, moving: (J, 3) radians and (3,) metres per frame by which the pose to go on from is faster.
    """

    def __init__(
        self, rotations: Array, root: Array, to_rotations: Array, to_root: Array, *,
        turning: Array | float = 0.0, moving: Array | float = 0.0,
    ) -> None:  # fmt: skip
        self.turns = _turn_between(to_rotations, rotations)
        self.way: Array = np.asarray(root, float) - np.asarray(to_root, float)
        self._turning, self._moving = turning, moving

    def apply(self, rotations: Array, root: Array, left: Array, drift: Array | float = 0.0) -> tuple[Array, Array]:
        """Rotations (n, J, 4) and places (n, 3) with a part of what is missing.

        Args:
            rotations, root: as they were.
            left: (n,) share of the gap that is left; at 0 they are as they were.
            drift: (n,) frames for which the greater speed goes on.
        """
        share, further = smoothstep(left)[:, None], np.broadcast_to(drift, left.shape)[:, None]
        turns = share[..., None] * self.turns + further[..., None] * self._turning
        turned = quat_multiply(rotvec_to_quat(turns), rotations.astype(float))
        touched = (share > 0) | (further > 0)
        turned = np.where(touched[..., None], turned, rotations).astype(rotations.dtype)
        return turned, (root + share * self.way + further * self._moving).astype(root.dtype)


def cut(motion: Motion, start: float | None = None, end: float | None = None) -> Motion:
    """The frames from ``start`` up to ``end`` seconds; without one, from the beginning or to the end.

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
        shown = " to ".join("the end" if value is None else f"{value:g} s" for value in (start or 0.0, end))
        raise InputError(f"no frame from {shown}", lasts)
    return motion[first:last]


def join(motions: Sequence[Motion], *, blend: float | None = None) -> Motion:
    """Clips one after the other, each going on from where the one before ended, at its speed.

    Args:
        motions: of one skeleton; the rate is that of the first. Where one has a face, those without are neutral.
        blend: seconds in which a clip comes to its own poses; None: `BLEND`, or more where the way is long.

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
    shown = any(motion.face is not None for motion in motions)
    clips = [_with_face(motion) if shown else motion for motion in motions]
    parts = clips[:1]
    for motion in clips[1:]:
        parts.append(_go_on(parts[-1], motion.resample(head.fps), blend))
    return Motion.concatenate(parts)


def loop(motion: Motion, *, blend: float | None = None) -> Motion:
    """The same motion whose end leads into its beginning, so that it can be repeated without a jump.

    The first frame follows the last one, a frame later and with its speed: repeat all frames.

    Args:
        blend: seconds before the end in which it turns towards the beginning, at most half of the motion; None: as in `join`.
    """
    if len(motion) < 2:
        raise InputError(f"{say_count(len(motion), 'frame')} cannot be looped", "give two or more")
    check_blend(blend)
    backwards = _reverse(motion)
    seconds = _time_of(backwards[-1:], backwards[:1]) if blend is None else blend
    turned = _reverse(_go_on(backwards[-2:], backwards, min(seconds, motion.duration / 2)))
    return replace(turned, rotations=quat_continuous(turned.rotations), start=motion.start)


def replace_face(motion: Motion, other: Motion) -> Motion:
    """Body and hands of one motion with the face of another, which is brought to the same rate and length.

    A face that is shorter comes to rest after its end.

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
    """A motion that goes on a frame after another one, first with that one's speed."""
    seconds = _time_of(before[-1:], motion[:1]) if blend is None else blend
    turning, moving = _last_step(before)
    back, way_back = _last_step(_reverse(motion[:2]))  # from the second frame to the first: once more, to the one before it
    rotations = quat_multiply(rotvec_to_quat(back), motion.rotations[0].astype(float))
    root = motion.root[0].astype(float) + way_back
    fade = OffsetFade(before.rotations[-1], before.root[-1], rotations, root, turning=turning + back, moving=moving + way_back)
    left = decay(len(motion), motion.fps, seconds)
    slower = decay(len(motion), motion.fps, min(seconds, BLEND))
    drift = np.square(slower) * (1 + np.arange(len(motion)))
    turned, placed = fade.apply(motion.rotations, motion.root, left, drift)
    face = motion.face
    if face is not None and before.face is not None:
        first = np.clip(2 * face[0] - face[min(1, len(face) - 1)], 0, 1)
        face = np.clip(face + smoothstep(left)[:, None] * (before.face[-1] - first), 0, 1).astype(face.dtype)
    return replace(motion, rotations=turned, root=placed, face=face)


def check_blend(blend: float | None) -> None:
    """Raise an InputError where a blend does not last from none to ten seconds."""
    low, high = _BLENDS
    if blend is not None and not low <= blend <= high:
        raise InputError(f"blend {blend:g}", f"{low:g} … {high:g} seconds")


def _with_face(motion: Motion) -> Motion:
    """A motion that has a face: a neutral one where it had none."""
    return motion if motion.face is not None else replace(motion, face=np.zeros((len(motion), len(ARKIT)), np.float32))


def _reverse(motion: Motion) -> Motion:
    face = None if motion.face is None else motion.face[::-1]
    return replace(motion, rotations=motion.rotations[::-1], root=motion.root[::-1], face=face)


def _time_of(before: Motion, after: Motion) -> float:
    """Seconds in which nothing hurries from one pose, of one frame, to another."""
    ways = np.linalg.norm(after.positions()[0] - before.positions()[0], axis=-1)
    hips = float(np.linalg.norm(after.root[0] - before.root[0]))
    return max(BLEND, _PEAK * float(ways.max()) / _HAND_SPEED, _PEAK * hips / _HIP_SPEED)


def _turn_between(before: Array, after: Array) -> Array:
    """(J, 3) rotation vectors from one pose (J, 4) to another."""
    return quat_to_rotvec(quat_multiply(np.asarray(after, float), quat_conjugate(np.asarray(before, float))))


def _last_step(motion: Motion) -> tuple[Array, Array]:
    """(J, 3) and (3,) of the last step of a motion; none where it has one frame."""
    last = max(len(motion) - 2, 0)
    way = motion.root[-1].astype(float) - motion.root[last].astype(float)
    return _turn_between(motion.rotations[last], motion.rotations[-1]), way


def decay(frames: int, fps: float, blend: float, first: int = 0) -> Array:
    """(frames,) share of an offset that is left in the frames from ``first`` on: all of it a frame before frame 0, none after
    ``blend`` seconds."""
    return np.clip(1 - (first + np.arange(frames) + 1) / max(blend * fps, 1), 0, 1)
