"""PATS: the corpus read as it lies on disk, and written in the same layout."""

from ...motion.poses.keypoints2d import points_of
from .points import hold_arm, mirror
from .statistics import load_statistics

__all__ = ["hold_arm", "load_statistics", "mirror", "points_of"]
