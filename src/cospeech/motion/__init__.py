"""Motion: rotations, skeletons, poses, retargeting and kinematics.

`Motion` is imported on first use: the command line reads names from this package before it needs NumPy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .motion import Motion

__all__ = ["Motion"]


def __getattr__(name: str) -> object:
    if name != "Motion":
        raise AttributeError(f"module 'cospeech.motion' has no attribute {name!r}")
    from .motion import Motion

    return Motion
