"""TED: the corpus read as it lies on disk, and written in the same layout."""

from ...motion.poses.direction_vectors import points_of

__all__ = ["points_of"]
