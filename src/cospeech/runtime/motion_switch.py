"""Several motions of one speech, of which one is shown at a time; and an old motion of which stretches are kept."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..errors import InputError
from ..motion.curves import smoothstep
from ..motion.motion import Motion
from ..motion.rotations import Array, QuatStream
from ..rules.manner import mix_frames
from ..rules.options import MotionLike
from ..rules.plan_commands import read_stretch
from .pose_transition import PoseTransition

__all__ = ["KeptStretches", "MotionSwitch", "keep_stretches"]

_LEAD = 0.5  # seconds before a kept stretch in which its poses fade in; ours: as styles are faded


class MotionSwitch:
    """Frames of one of several motions; where another takes over, the poses lead from one to the other.

    Args:
        exact: a source whose frames are shown as they are: the frames before lead to them.
    """

    def __init__(self, exact: int | None = None) -> None:
        self._exact = exact
        self._last: Motion | None = None
        self._active = -1
        self._transition: PoseTransition | None = None
        self._signs = QuatStream()

    def push(self, motions: Sequence[Motion], active: Array, share: Array | None = None) -> Motion:
        """The next frames.

        Args:
            motions: the same frames of each source, of our humanoid.
            active: (n,) which of them is shown.
            share: (n,) how far the exact source shows in the frames of others.
        """
        borders = [0, *(np.flatnonzero(np.diff(active)) + 1).tolist(), len(active)]
        parts = list[Motion]()
        for a, b in pairwise(borders):
            part = self._lead(motions[active[a]][a:b], int(active[a]))
            if share is not None and self._exact is not None and active[a] != self._exact:
                part = _mix(part, motions[self._exact][a:b], share[a:b])
            parts.append(self._show(part))
        return Motion.concatenate(parts)

    def _lead(self, motion: Motion, source: int) -> Motion:
        if source != self._active and self._last is not None:
            self._transition = None if source == self._exact else PoseTransition(self._last, motion[:1])
        self._active = source
        if self._transition is not None:
            count = self._transition.remaining_frames(motion.fps)
            lead = self._transition.apply(motion[:count])
            motion = lead if count >= len(motion) else Motion.concatenate([lead, motion[count:]])
            if self._transition.is_over(motion.fps):
                self._transition = None
        return motion

    def _show(self, motion: Motion) -> Motion:
        motion = replace(motion, rotations=self._signs.push(motion.rotations))
        before = motion if self._last is None else Motion.concatenate([self._last, motion])
        self._last = before[-2:]
        return motion


class KeptStretches:
    """An old motion in some stretches, and a new one in the rest; the frames of the stretches are those of the old one.

    Half a second before a stretch the old poses fade in; after it, the new motion takes over without a jump.

    Args:
        old: of any skeleton that is recognised; brought to our humanoid.
        stretches: from and to, seconds.
        fps: of the new motion.

    Raises:
        InputError: a stretch that ends before it begins, or after the old motion.
    """

    def __init__(self, old: Motion, stretches: Sequence[tuple[float, float]], fps: float) -> None:
        for low, high in stretches:
            if not 0 <= low < high:
                raise InputError(f"nothing is kept from {low:g} to {high:g} s", "seconds: 0:3.2")
            if high > old.duration + 1 / fps:
                raise InputError(f"{low:g} to {high:g} s of a motion of {old.duration:g} s cannot be kept", "keep less of it")
        self._old = old.retarget("humanoid").resample(fps)
        self._stretches, self._fps, self._switch = list(stretches), fps, MotionSwitch(1)

    def check_length(self, seconds: float | None, tail: float) -> None:
        """Raise an InputError where a stretch begins after the new motion: ``seconds`` of speech, if known, and of ``tail``."""
        late = [low for low, _ in self._stretches if seconds is not None and low >= seconds + tail]
        if late:
            raise InputError(
                f"{late[0]:g} s, from where old motion is to be kept, is after the end", f"{seconds:g} s of speech"
            )

    def over(self, moving: Iterable[list[Motion]]) -> Iterator[list[Motion]]:
        """Takes of a new motion as they come, each with what is kept."""
        switches = list[MotionSwitch]()
        for takes in moving:
            switches = switches or [MotionSwitch(1) for _ in takes]
            yield [self._push(take, switch) for take, switch in zip(takes, switches, strict=True)]

    def push(self, motion: Motion) -> Motion:
        """The next frames of the new motion, with the old ones where they are kept."""
        return self._push(motion, self._switch)

    def _push(self, motion: Motion, switch: MotionSwitch) -> Motion:
        times = motion.times
        share = np.zeros(len(motion))
        active = np.zeros(len(motion), int)
        for low, high in self._stretches:
            inside = (times >= low - 1e-9) & (times < high - 1e-9)
            active[inside] = 1
            before = (times < low) & (times > low - _LEAD)
            share[before] = np.maximum(share[before], smoothstep(1 - (low - times[before]) / _LEAD))
        rows = np.minimum(np.round(times * self._fps).astype(int), len(self._old) - 1)
        old = _rows(self._old, rows, motion)
        return switch.push([motion, old], active, share)


def keep_stretches(keep: str, old: MotionLike, fps: float) -> KeptStretches | None:
    """The stretches of an old motion that are kept; None where nothing is kept.

    Args:
        keep: stretches as text: ``0:3.2,5:7``, seconds.
        old: a motion, or a file of one.
        fps: of the new motion.

    Raises:
        InputError: one without the other, no stretch, or a file that cannot be read.
    """
    if not keep and old is None:
        return None
    if not keep or old is None:
        problem = "a stretch to keep, and no motion to keep it from" if keep else "a motion to keep, and no stretch of it"
        raise InputError(problem, "--keep 0:3.2 old.bvh")
    stretches = [read_stretch(part)[:2] for part in keep.split(",")]
    return KeptStretches(old if isinstance(old, Motion) else Motion.load(old), stretches, fps)


def _rows(old: Motion, rows: Array, motion: Motion) -> Motion:
    """Frames of a motion, with the times and the face of another where it has none of its own."""
    face = motion.face if old.face is None or motion.face is None else old.face[rows].astype(motion.face.dtype)
    rotations, root = old.rotations[rows].astype(motion.rotations.dtype), old.root[rows].astype(motion.root.dtype)
    return replace(motion, rotations=rotations, root=root, face=face)


def _mix(motion: Motion, old: Motion, share: Array) -> Motion:
    if not share.any():
        return motion
    rotations = mix_frames([(motion.rotations, share), (old.rotations, share)]).astype(motion.rotations.dtype)
    rotations = np.where(share[:, None, None] > 0, rotations, motion.rotations)
    root = mix_frames([(motion.root, share), (old.root, share)]).astype(motion.root.dtype)
    face = motion.face
    if face is not None and old.face is not None:
        face = mix_frames([(face, share), (old.face, share)]).astype(face.dtype)
    return replace(motion, rotations=rotations, root=root, face=face)
