"""Edits of finished motion: cut, join, loop, another face. Times are in seconds from the first frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError
from .curves import smoothstep
from .motion import Motion
from .rotations import Array, quat_conjugate, quat_continuous, quat_multiply, quat_to_rotvec, rotvec_to_quat

__all__ = ["BLEND", "OffsetFade", "cut", "join", "loop", "replace_face"]

BLEND = 0.4  # seconds in which a joint comes from one clip to the other; ours: about a preparation of a gesture


class OffsetFade:
    """What is missing from one pose to another, faded out: the first frames go on from where the joints were.

    No time is lost or doubled, as it would be if two clips overlapped, so that each clip stays in step with its sound.

    Args:
        rotations, root: (J, 4) and (3,) the pose to go on from.
        to_rotations, to_root: (J, 4) and (3,) the first pose of what goes on.
    """

    def __init__(self, rotations: Array, root: Array, to_rotations: Array, to_root: Array) -> None:
        gap = quat_multiply(np.asarray(rotations, float), quat_conjugate(np.asarray(to_rotations, float)))
        self.turns: Array = quat_to_rotvec(gap)
        self.way: Array = np.asarray(root, float) - np.asarray(to_root, float)

    def apply(self, rotations: Array, root: Array, left: Array) -> tuple[Array, Array]:
        """Rotations (n, J, 4) and places (n, 3) with the share ``left`` (n,) of what is missing; at 0 they are as they were."""
        share = smoothstep(left)[:, None]
        turned = quat_multiply(rotvec_to_quat(share[..., None] * self.turns), rotations.astype(float))
        turned = np.where(share[..., None] > 0, turned, rotations).astype(rotations.dtype)
        return turned, (root + share * self.way).astype(root.dtype)


def cut(motion: Motion, start: float | None = None, end: float | None = None) -> Motion:
    """The frames from ``start`` up to ``end`` seconds; without one, from the beginning or to the end.

    Raises:
        InputError: no frame lies between them.
    """
    times = np.arange(len(motion)) / motion.fps
    first = 0 if start is None else int(np.searchsorted(times, start - 1e-9))
    last = len(motion) if end is None else int(np.searchsorted(times, end - 1e-9))
    if first >= last or (start is not None and start < 0):
        shown = " to ".join("…" if value is None else f"{value:g}" for value in (start, end))
        raise InputError(f"no frame from {shown} s", f"the motion lasts from 0 to {motion.duration:g} s")
    return motion[first:last]


def join(motions: Sequence[Motion], *, blend: float = BLEND) -> Motion:
    """Clips one after the other, each going on from where the one before ended.

    Args:
        motions: of one skeleton; the rate is that of the first, and there is a face where all have one.
        blend: seconds in which a clip comes to its own poses.

    Raises:
        InputError: there is none, or their skeletons differ.
    """
    if not motions:
        raise InputError("no motion to join")
    head = motions[0]
    if any(motion.skeleton != head.skeleton for motion in motions):
        raise InputError(
            "clips of different skeletons cannot be joined", "retarget them to one first: motion.retarget('humanoid')"
        )
    parts, faces = [head], all(motion.face is not None for motion in motions)
    for motion in motions[1:]:
        parts.append(_go_on(parts[-1], motion.resample(head.fps), blend))
    return Motion.concatenate([part if faces else replace(part, face=None) for part in parts])


def loop(motion: Motion, *, blend: float = BLEND) -> Motion:
    """The same motion whose end leads into its beginning, so that it can be repeated without a jump.

    Args:
        blend: seconds before the end in which it turns towards the beginning; at most half of the motion.
    """
    if len(motion) < 2:
        raise InputError(f"{len(motion)} frames cannot be looped", "give two or more")
    left = _decay(len(motion), motion.fps, min(blend, motion.duration / 2))[::-1]
    fade = OffsetFade(motion.rotations[0], motion.root[0], motion.rotations[-1], motion.root[-1])
    rotations, root = fade.apply(motion.rotations, motion.root, left)
    face = motion.face
    if face is not None:
        face = np.clip(face + smoothstep(left)[:, None] * (face[0] - face[-1]), 0, 1).astype(face.dtype)
    return replace(motion, rotations=quat_continuous(rotations), root=root, face=face)


def replace_face(motion: Motion, other: Motion) -> Motion:
    """Body and hands of one motion with the face of another, which is brought to the same rate and length.

    Raises:
        InputError: the other has no face.
    """
    if other.face is None:
        raise InputError("the other motion has no face", "give a .json, .csv, .glb or .vrma with one")
    face = other.resample(motion.fps).face
    assert face is not None
    last = np.minimum(np.arange(len(motion)), len(face) - 1)  # a face that is shorter keeps its last expression
    return replace(motion, face=face[last])


def _go_on(before: Motion, motion: Motion, blend: float) -> Motion:
    left = _decay(len(motion), motion.fps, blend)
    fade = OffsetFade(before.rotations[-1], before.root[-1], motion.rotations[0], motion.root[0])
    rotations, root = fade.apply(motion.rotations, motion.root, left)
    face = motion.face
    if face is not None and before.face is not None:
        face = np.clip(face + smoothstep(left)[:, None] * (before.face[-1] - face[0]), 0, 1).astype(face.dtype)
    return replace(motion, rotations=rotations, root=root, face=face)


def _decay(frames: int, fps: float, blend: float) -> Array:
    """(frames,) share of an offset that is left: all of it a frame before the first, none after ``blend`` seconds."""
    return np.clip(1 - (np.arange(frames) + 1) / max(blend * fps, 1), 0, 1)
