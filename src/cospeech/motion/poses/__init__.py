"""Pose representations: they encode motion as vectors for networks, and decode it again; one module for each.

Every representation has ``name``, ``dimensions``, ``names`` (one per dimension), ``fps`` (of the papers), ``source`` (the
field of a `Clip` that it encodes: "points" or "motion"; for the latter also ``skeleton``, a name of
`cospeech.motion.skeletons.SKELETONS`), ``encode(source) -> (T, D)`` and ``decode(vectors, fps, …)`` back.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, Protocol

from ...errors import InputError, nearest
from ..rotations import Array

__all__ = ["POSES", "Pose", "find_pose"]

POSES: dict[str, str] = {
    "direction-vectors": "cospeech.motion.poses.direction_vectors:DIRECTION_VECTORS",
    "keypoints2d": "cospeech.motion.poses.keypoints2d:KEYPOINTS2D",
    "expmap-upper": "cospeech.motion.poses.expmap:UPPER",
    "expmap-full": "cospeech.motion.poses.expmap:FULL",
    "expmap-humanoid": "cospeech.motion.poses.humanoid:HUMANOID",
    "face": "cospeech.motion.poses.face:FACE",
    "euler": "cospeech.motion.poses.euler:EULER",
    "rot6d": "cospeech.motion.poses.rot6d:ROT6D",
    "rot6d-smplx": "cospeech.motion.poses.rot6d:SMPLX",
    "rot6d-humanoid": "cospeech.motion.poses.rot6d:HUMANOID",
}
"""Name → "module:object"; ``prepare --pose`` takes these."""


class Pose(Protocol):
    """The interface of a representation."""

    @property
    def name(self) -> str: ...
    @property
    def dimensions(self) -> int: ...
    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def fps(self) -> float: ...
    @property
    def source(self) -> str: ...
    def encode(self, source: Any) -> Array: ...
    def decode(self, vectors: Array, fps: float, *options: Any) -> Any: ...


def find_pose(name: str) -> Pose:
    """The representation of that name.

    >>> find_pose("direction-vectors").dimensions, find_pose("euler").dimensions
    (27, 141)

    Raises:
        InputError: unknown name.
    """
    if name not in POSES:
        raise InputError(f"no pose representation is called {name!r}", nearest(name, POSES))
    module, _, item = POSES[name].partition(":")
    return getattr(import_module(module), item)  # type: ignore[no-any-return]
