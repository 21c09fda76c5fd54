"""One source of motion takes over from another, without a jump: the difference between the two fades out.

This is inertialisation (Bollo, "Inertialization: High-Performance Animation Transitions in Gears of War", GDC 2018). The new
source is played at once. On top of it lies the offset to the pose that was shown last. The offset dies away along a
polynomial of degree five. A joint brakes from the speed that it had, so that place and speed go on as they were. Feet step
from stance to stance.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import ceil

import numpy as np

from ..motion.curves import smoothstep
from ..motion.motion import Motion
from ..motion.rotations import Array, quat_conjugate, quat_multiply, quat_to_rotvec, rotvec_to_quat
from ..motion.skeleton import humanoid
from ..motion.skeletons.arkit import ARKIT
from .step_over import StepOver, decay, run_out

__all__ = ["LIPS", "PoseTransition"]

LIPS = 0.2
"""Seconds in which a mouth comes to its new shape [ours: a pause's closure takes .1 to .2 s]."""
_LIDS = 0.12  # s [ours]: lids close within about .1 s
_ARMS, _TRUNK, _HEAD, _EYES = 0.6, 0.9, 0.5, 0.3  # s [ours: an unhurried retraction takes .5 to .8 s (`motion.md` §1)]
_HIPS = 1.4  # s [ours]: while both feet step (`cospeech.runtime.step_over`)
_TURN, _EASE = 34.0, 21.0
"""Rad/s² at most with which the speed that a joint had dies away, and with which the offset does [ours: so that no step from
frame to frame, at 30 a second, differs from the one before by more than 3 degrees]."""
_SOONEST = 0.25  # s in which a slow joint turns back [ours]
_PEAK = 10 / 3**0.5  # the largest acceleration of a minimum-jerk reach of 1 in 1 s (Flash & Hogan 1985)
_LENGTH = 2.0  # s until nothing is left [ours: the end of the steps]


@cache
def _seconds() -> Array:
    """(J, 1) seconds of each joint."""
    names = humanoid().names
    seconds = np.full((len(names), 1), _ARMS)
    parts = {("spine", "chest", "upperChest"): _TRUNK, ("neck", "head", "jaw"): _HEAD, ("leftEye", "rightEye"): _EYES}
    for members, value in parts.items():
        seconds[[k for k, name in enumerate(names) if name in members]] = value
    seconds[names.index("hips")] = _HIPS
    return seconds


@cache
def _face_seconds() -> Array:
    """(52,) seconds of each weight."""
    return np.array([_LIDS if "Blink" in name or "Wide" in name or "eyeLook" in name else LIPS for name in ARKIT])


class PoseTransition:
    """The offset to the pose that was shown last, laid over the frames that come next.

    Args:
        last: the last two frames that were shown, or the last one.
        new: the frames of the new source at the same times; or its first frame alone, where it begins there: how fast it
            moves is then known at its second frame, and the first one goes on as what was shown.
    """

    def __init__(self, last: Motion, new: Motion) -> None:
        self._last: Motion | None = last[-1:] if len(new) == 1 else None  # until it is known how fast the new source moves
        self._first: tuple[Motion, Motion] | None = None  # the first frame of such a source, and what was made of it
        self._start(last, new)

    def _start(self, last: Motion, new: Motion) -> None:
        self._frame = 0  # frames since then
        old_q, new_q = last.rotations.astype(float), new.rotations.astype(float)
        self._turns: Array = quat_to_rotvec(quat_multiply(old_q[-1], quat_conjugate(new_q[-1])))
        self._turning: Array = _speed(old_q, last.fps) - _speed(new_q, new.fps)
        fast = np.linalg.norm(self._turning, axis=-1, keepdims=True)
        self._running: Array = np.clip(4 * fast / _TURN, _SOONEST, _LENGTH)
        far = np.linalg.norm(self._turns, axis=-1, keepdims=True)
        self._seconds: Array = np.maximum(_seconds(), np.sqrt(_PEAK / _EASE * far))
        self._way: Array = last.root[-1].astype(float) - new.root[-1]
        moving = [(m.root[-1].astype(float) - m.root[-2]) * m.fps if len(m) > 1 else np.zeros(3) for m in (last, new)]
        self._moving: Array = moving[0] - moving[1]
        faces = last.face is not None and new.face is not None
        self._face: Array | None = last.face[-1].astype(float) - new.face[-1] if faces else None  # type: ignore[index]
        self._steps = StepOver(last)

    def apply(self, motion: Motion) -> Motion:
        """The next frames of the new source, with what is left of the offset."""
        if self._last is None or not len(motion):
            return self._apply(motion)
        if self._first is None:
            output = self._apply(motion[:1])
            self._first, self._frame = (motion[:1], output), 0
            return output if len(motion) == 1 else Motion.concatenate([output, self.apply(motion[1:])])
        first, output = self._first
        self._start(Motion.concatenate([self._last, output]), Motion.concatenate([_extrapolate_back(first, motion), first]))
        self._last = None
        return self._apply(motion)

    def _apply(self, motion: Motion) -> Motion:
        times = (self._frame + 1 + np.arange(len(motion)))[:, None, None] / motion.fps
        self._frame += len(motion)
        rest = decay(times / self._seconds)
        runs = rotvec_to_quat(_turn_back(times, self._running) * self._turning)  # a joint first keeps its speed
        pose = quat_multiply(runs, quat_multiply(rotvec_to_quat(rest * self._turns), motion.rotations.astype(float)))
        root = motion.root + decay(times[:, 0] / _HIPS) * self._way + run_out(times[:, 0]) * self._moving
        root = self._steps.apply(times[:, 0, 0], motion, pose, root)
        face = motion.face
        if face is not None and self._face is not None:
            share = smoothstep(1 - times[:, 0] / _face_seconds())
            face = np.clip(face + share * self._face, 0, 1).astype(face.dtype)
        rotations = pose.astype(motion.rotations.dtype)
        return replace(motion, rotations=rotations, root=root.astype(motion.root.dtype), face=face)

    def remaining_frames(self, fps: float) -> int:
        """How many frames it still changes, at most."""
        more = self._last is not None and self._first is None
        return max(ceil(_LENGTH * fps) + more - self._frame, 0)

    def is_over(self, fps: float) -> bool:
        """Whether nothing is left of it."""
        return self._frame >= _LENGTH * fps


def _turn_back(times: Array, seconds: Array) -> Array:
    """Seconds of travel at the first speed: slope 1 at 0, back and at rest after ``seconds``; it brakes hardest at once."""
    u = np.clip(times / seconds, 0, 1)
    return seconds * u * (1 - u) ** 2  # type: ignore[no-any-return]


def _extrapolate_back(first: Motion, second: Motion) -> Motion:
    """The frame before the first of two, if it moved as from the first to the second."""
    q, after = first.rotations.astype(float), second.rotations[:1].astype(float)
    back = quat_multiply(quat_conjugate(quat_multiply(after, quat_conjugate(q))), q)
    root = 2 * first.root.astype(float) - second.root[:1]
    return replace(first, rotations=back, root=root)


def _speed(rotations: Array, fps: float) -> Array:
    """(J, 3) rotation vector per second, at the end of (1 or 2, J, 4)."""
    if len(rotations) < 2:
        return np.zeros(rotations.shape[1:-1] + (3,))
    return quat_to_rotvec(quat_multiply(rotations[-1], quat_conjugate(rotations[-2]))) * fps  # type: ignore[no-any-return]
