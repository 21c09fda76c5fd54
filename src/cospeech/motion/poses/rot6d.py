"""Rotations in six numbers (Zhou et al. 2019, "On the Continuity of Rotation Representations"): two columns of the matrix.

It has no jumps, and one vector for each rotation; any six numbers decode to a near pair of right-angled columns.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..motion import Motion
from ..rotations import Array, matrix_to_quat, quat_to_rot6d, rot6d_to_matrix
from ..skeleton import Skeleton, find_skeleton
from .euler import JOINTS
from .joints import build_motion, pick, size

__all__ = ["HUMANOID", "ROT6D", "SMPLX", "Rot6D"]


@dataclass(frozen=True)
class Rot6D:
    """``encode(Motion) -> (T, 6 K)``, ``decode((T, 6 K), fps, skeleton) -> Motion``.

    Args:
        joints: K names; the default is BEAT's 47 (282 numbers).
        skeleton: the skeleton that has them.
    """

    joints: tuple[str, ...] = JOINTS
    name: str = "rot6d"
    source: str = "motion"
    skeleton: str = "beat"
    fps: float = 15.0  # as `cospeech.motion.poses.euler`, whose joints it has

    @property
    def dimensions(self) -> int:
        return 6 * len(self.joints)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"{joint}.{column}{axis}" for joint in self.joints for column in "xy" for axis in "XYZ")

    def encode(self, source: Motion) -> Array:
        return quat_to_rot6d(pick(source, self.joints, self.skeleton)).reshape(len(source), self.dimensions)

    def decode(self, vectors: Array, fps: float = fps, skeleton: Skeleton | None = None) -> Motion:
        """Decode to a motion, by default on the representation's skeleton; joints that the vectors lack keep the T-pose."""
        columns = size(vectors, self.dimensions, self.name).reshape(len(vectors), -1, 6)
        rotations = matrix_to_quat(rot6d_to_matrix(columns))
        return build_motion(fps, skeleton or find_skeleton(self.skeleton), self.joints, rotations)


ROT6D = Rot6D()
SMPLX = Rot6D(find_skeleton("smplx").names, "rot6d-smplx", skeleton="smplx", fps=30.0)
HUMANOID = Rot6D(find_skeleton("humanoid").names, "rot6d-humanoid", skeleton="humanoid", fps=30.0)
