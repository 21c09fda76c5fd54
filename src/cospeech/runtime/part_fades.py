"""Parts of a character that are switched off and on while it moves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..motion.curves import smoothstep
from ..motion.motion import Motion
from ..motion.part_joints import eye_joints, resting_joints
from ..motion.parts import PARTS
from ..motion.rotations import Array, quat_continuous, quat_identity, quat_slerp
from ..motion.skeleton import humanoid
from .crossfade import FADE

__all__ = ["PartFades"]

_MEMORY = 40.0  # s for which changes are kept [ours: longer than a live session can take frames back]


class _Change(NamedTuple):
    """Other goals from a frame on: 1 for a part that is on, 0 for one that is off."""

    frame: int
    shares: dict[str, float]
    """Of the parts in the frame before."""
    goals: dict[str, float]


class PartFades:
    """Brings parts to their neutral pose and back, within `cospeech.runtime.crossfade.FADE` seconds each.

    Args:
        parts: those that the motion has; all of them are on.
        fps: of the motion.
    """

    def __init__(self, parts: tuple[str, ...], fps: float) -> None:
        self._parts, self._fps = parts, fps
        self._changes = [_Change(0, dict.fromkeys(parts, 1.0), dict.fromkeys(parts, 1.0))]
        self._frame = 0  # the next one
        self._last: Array | None = None  # (1, J, 4) of the frame before

    def set_parts(self, parts: Iterable[str]) -> None:
        """The parts that are on from the next frame on.

        Raises:
            InputError: one that the motion does not have, or no names.
        """
        if not isinstance(parts, Iterable):
            raise InputError(f"parts {parts!r:.60}", f"some of {','.join(PARTS)}")
        names = tuple(parts.split(",") if isinstance(parts, str) else parts)
        for part in names:
            if part not in PARTS:
                raise InputError(f"no part is called {part!r}", f"some of {','.join(PARTS)}")
            if part not in self._parts:
                raise InputError(f"this session does not make the part {part!r}", "open it with all parts that are ever on")
        self._change({part: float(part in names) for part in self._parts})

    def go_back(self, frame: int) -> None:
        """Drop the frames from this one on: the next ones go on from the frame before, to the parts that are on now."""
        goals, is_late = self._changes[-1].goals, self._changes[-1].frame > frame
        while len(self._changes) > 1 and self._changes[-1].frame > frame:
            self._changes.pop()
        self._frame = frame
        if is_late:
            self._change(goals)

    def apply(self, motion: Motion) -> Motion:
        """The next frames, with the parts that are on."""
        if len(self._changes) > 1:  # until a part is switched, frames stay as they are, bit for bit
            motion = self._fade(motion)
        self._frame += len(motion)
        self._last = motion.rotations[-1:] if len(motion) else self._last
        return motion

    def _fade(self, motion: Motion) -> Motion:
        """The next frames, each part as far as its share says; no sign of a rotation flips."""
        frames = self._frame + np.arange(len(motion))
        rotations, root, face = motion.rotations.copy(), motion.root, motion.face
        for part in self._parts:
            share = smoothstep(self._find_shares(part, frames))[:, None]
            if share.min(initial=1.0) == 1.0:
                continue
            if part == "face" and face is not None:
                face = (face * share).astype(face.dtype)
            joints = _joints(part)
            neutral = np.broadcast_to(quat_identity(1), rotations[:, joints].shape)
            rotations[:, joints] = quat_slerp(neutral, rotations[:, joints].astype(float), share)
            if part == "body":
                rest = humanoid().offsets[0]
                root = (rest + share * (root - rest)).astype(root.dtype)
        if self._last is not None:
            rotations = quat_continuous(np.concatenate([self._last, rotations]))[1:]
        return replace(motion, rotations=rotations, root=root, face=face)

    def _change(self, goals: dict[str, float]) -> None:
        """Other goals from the next frame on."""
        shares = {part: float(self._find_shares(part, np.array([self._frame - 1]))[0]) for part in self._parts}
        self._changes.append(_Change(self._frame, shares, goals))
        while len(self._changes) > 2 and self._changes[1].frame < self._frame - _MEMORY * self._fps:
            del self._changes[0]

    def _find_shares(self, part: str, frames: Array) -> Array:
        """(n,) of frames since the last change, and the one before: straight from where the part was to where it should be."""
        change = self._changes[-1]
        goal, before = change.goals[part], change.shares[part]
        steps = (frames - change.frame + 1) / (FADE * self._fps)
        return np.minimum(before + steps, goal) if goal > before else np.maximum(before - steps, goal)  # type: ignore[no-any-return]


def _joints(part: str) -> list[int]:
    """Joints of a part; the eyes are the face's."""
    if part == "face":
        return eye_joints()
    without = ("face", "hands") if part == "body" else ("face", "body")
    return [k for k in resting_joints(without) if k not in eye_joints()]
