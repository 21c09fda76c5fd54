"""The key points of the TED corpus (Yoon et al. 2020): 10 joints in 3-D.

Names of 2 and 3 are ours, the data's authors only number them. In the files x points to the person's right, y down, z to the
front; in `Points` x points to the left and y up: half a turn about z (`AXES`), so nothing is mirrored.
"""

__all__ = ["AXES", "JOINTS", "PARENTS", "SOURCES"]

JOINTS = (
    "spine", "neck", "nose", "head", "leftShoulder", "leftElbow", "leftWrist", "rightShoulder", "rightElbow", "rightWrist",
)  # fmt: skip

PARENTS = (-1, 0, 1, 2, 1, 4, 5, 1, 7, 8)

AXES = (-1.0, -1.0, 1.0)
"""Factors between the axes of the files and those of `Points`."""

SOURCES: tuple[tuple[str, tuple[float, float, float]], ...] = (
    ("chest", (0.0, 0.02, 0.0)),
    ("neck", (0.0, 0.0, 0.0)),
    ("head", (0.0, 0.05, 0.09)),
    ("head", (0.0, 0.17, 0.0)),
    ("leftUpperArm", (0.0, 0.0, 0.0)),
    ("leftLowerArm", (0.0, 0.0, 0.0)),
    ("leftHand", (0.0, 0.0, 0.0)),
    ("rightUpperArm", (0.0, 0.0, 0.0)),
    ("rightLowerArm", (0.0, 0.0, 0.0)),
    ("rightHand", (0.0, 0.0, 0.0)),
)
"""Where each point lies on our humanoid: joint and offset in its axes, metres. Ours: chosen so that the bones of the middle
measure .26, .17 and .15 m where the authors' table says .26, .18 and .14."""
