"""What a trained session's frames go through: poses decoded, parts left out, and frames that wait for others."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..motion.points import Points
from ..motion.poses import Pose
from ..motion.poses.lift import lift
from ..motion.rotations import Array, quat_identity
from ..motion.skeleton import humanoid

__all__ = ["WaitingFrames", "decode_poses", "eye_joints", "resting_joints", "select_parts"]

_EYES = ("leftEye", "rightEye")


class WaitingFrames:
    """Frames of arrays that lie side by side, in pieces, until they are wanted."""

    def __init__(self) -> None:
        self._pieces: list[tuple[Array, ...]] = []
        self._frames = 0

    def __len__(self) -> int:
        return self._frames

    def push(self, piece: tuple[Array, ...]) -> None:
        """What comes next."""
        self._pieces.append(piece)
        self._frames += len(piece[0])

    def take(self, count: int) -> tuple[Array, ...]:
        """The first frames, which wait no more."""
        if len(self._pieces) > 1 and len(self._pieces[0][0]) < count:
            self._pieces = [tuple(np.concatenate(arrays) for arrays in zip(*self._pieces, strict=True))]
        first, self._frames = self._pieces[0], self._frames - count
        rest = tuple(array[count:] for array in first)
        self._pieces[:1] = [rest] if len(rest[0]) else []
        return tuple(array[:count] for array in first)


def decode_poses(pose: Pose, vectors: Array, fps: float) -> tuple[Array, Array]:
    """Vectors of any representation as rotations and root of our humanoid, in float32."""
    made = pose.decode(vectors, fps)
    if isinstance(made, Points):
        made = lift(made)
    if made.skeleton != humanoid():
        made = made.retarget("humanoid")
    return made.rotations.astype(np.float32, copy=False), made.root.astype(np.float32, copy=False)


@cache
def resting_joints(parts: tuple[str, ...]) -> list[int]:
    """Joints that were not asked for."""
    s = humanoid()
    fingers = {*s.left_hand, *s.right_hand}
    resting = [] if "hands" in parts else sorted(fingers)
    return resting if "body" in parts else resting + [k for k in range(len(s)) if k not in fingers]


def select_parts(rotations: Array, root: Array, parts: tuple[str, ...]) -> tuple[Array, Array]:
    """Neutral rotations, and the hips at their place, for parts that were not asked for."""
    rotations = rotations.copy()
    rotations[:, resting_joints(parts)] = quat_identity(1)
    if "body" not in parts:
        root = np.broadcast_to(humanoid().offsets[0].astype(np.float32), root.shape).copy()
    return rotations, root


@cache
def eye_joints() -> list[int]:
    """Indices of both eyes."""
    return [humanoid().index[name] for name in _EYES]
