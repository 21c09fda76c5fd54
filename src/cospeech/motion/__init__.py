"""Motion: rotations, skeletons, poses, retargeting and kinematics."""

from .motion import Motion

__all__ = ["Motion"]
