"""Between motions of any skeleton and formats that know only our humanoid, or only a face."""

from __future__ import annotations

import numpy as np

from ..motion.motion import Motion
from ..motion.rotations import Array, axis_angle_to_quat, quat_identity
from ..motion.skeleton import humanoid

__all__ = ["ARMS_DOWN", "as_humanoid", "make_standing"]

ARMS_DOWN = np.radians(72)  # ours: from the T-pose; hangs beside the body without touching it


def as_humanoid(motion: Motion) -> Motion:
    """``motion`` itself where it is on our humanoid (names and proportions), else retargeted to it.

    Raises:
        InputError: the skeleton is not recognised.
    """
    if motion.skeleton is humanoid() or (motion.skeleton.kind == "humanoid" and motion.skeleton == humanoid()):
        return motion
    return motion.retarget("humanoid")


def make_standing(frames: int, *, fps: float, face: Array | None = None) -> Motion:
    """Our humanoid standing still with hanging arms: the body for files that hold only a face."""
    skeleton = humanoid()
    rotations = quat_identity(frames, len(skeleton))
    for side, sign in (("left", -1), ("right", 1)):
        rotations[:, skeleton.index[f"{side}UpperArm"]] = axis_angle_to_quat((0, 0, 1), sign * ARMS_DOWN)
    root = np.tile(skeleton.offsets[0], (frames, 1))
    return Motion(fps=fps, rotations=rotations, root=root, face=face, skeleton=skeleton)
