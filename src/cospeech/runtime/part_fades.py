"""Parts of a character that are switched off and on while it moves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..motion.curves import smoothstep
from ..motion.motion import Motion
from ..motion.part_joints import eye_joints, resting_joints
from ..motion.parts import PARTS
from ..motion.rotations import Array, quat_identity, quat_slerp
from ..motion.skeleton import humanoid
from .crossfade import FADE

__all__ = ["PartFades"]


class PartFades:
    """Brings parts to their neutral pose and back, within `cospeech.runtime.crossfade.FADE` seconds each.

    Args:
        parts: those that the motion has; all of them are on.
        fps: of the motion.
    """

    def __init__(self, parts: tuple[str, ...], fps: float) -> None:
        self._parts, self._fps = parts, fps
        self._goals = dict.fromkeys(parts, 1.0)
        self._shares = dict.fromkeys(parts, 1.0)  # before the fade, and of the last frame

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
        self._goals = {part: float(part in names) for part in self._parts}

    def apply(self, motion: Motion) -> Motion:
        """The next frames, with the parts that are on."""
        if self._shares == self._goals and min(self._shares.values()) == 1.0:
            return motion
        rotations, root, face = motion.rotations.copy(), motion.root, motion.face
        for part in self._parts:
            share = smoothstep(self._next_shares(part, len(motion)))[:, None]
            if part == "face" and face is not None:
                face = (face * share).astype(face.dtype)
            joints = _joints(part)
            neutral = np.broadcast_to(quat_identity(1), rotations[:, joints].shape)
            rotations[:, joints] = quat_slerp(neutral, rotations[:, joints].astype(float), share)
            if part == "body":
                rest = humanoid().offsets[0]
                root = (rest + share * (root - rest)).astype(root.dtype)
        return replace(motion, rotations=rotations, root=root, face=face)

    def _next_shares(self, part: str, frames: int) -> Array:
        """(n,) straight from where the part is to where it should be."""
        goal, now = self._goals[part], self._shares[part]
        steps = np.arange(1, frames + 1) / (FADE * self._fps)
        shares = np.minimum(now + steps, goal) if goal > now else np.maximum(now - steps, goal)
        self._shares[part] = float(shares[-1])
        return shares  # type: ignore[no-any-return]


def _joints(part: str) -> list[int]:
    """Joints of a part; the eyes are the face's."""
    if part == "face":
        return eye_joints()
    without = ("face", "hands") if part == "body" else ("face", "body")
    return [k for k in resting_joints(without) if k not in eye_joints()]
