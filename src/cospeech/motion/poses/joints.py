"""Read local rotations of named joints from a motion, and build a motion of them; used by the representations of rotations."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from ...errors import InputError
from ..motion import Motion
from ..rotations import Array, quat_continuous, quat_normalize
from ..skeleton import Skeleton, humanoid

__all__ = ["build_motion", "check_humanoid", "hand_columns", "humanoid_vectors", "part_columns", "pick", "size"]

_FARTHEST = 100.0  # metres, radians or a weight; a larger number is a mistake [ours]

_HAND = re.compile(r"(left|right)_?(hand|grip|wrist|thumb|index|middle|ring|pinky|little)", re.IGNORECASE)
_SIDE = re.compile(r"(left|right|[LR](?=[A-Z]))", re.IGNORECASE)
_PARTS = {
    "hand": re.compile(r".{1,5}?_?(hand|grip|wrist|thumb|index|middle|ring|pinky|little)", re.IGNORECASE),
    "leg": re.compile(r".*(leg|hip|knee|ankle|foot|toe)", re.IGNORECASE),
    "head": re.compile(r"(neck|head|nose)", re.IGNORECASE),
}


def hand_columns(names: Sequence[str]) -> list[int]:
    """Columns of a pose that are hands, by their names: rotations of wrists and fingers, and grips.

    Raises:
        InputError: no column is, or all are.
    """
    columns = [k for k, name in enumerate(names) if _HAND.match(name)]
    if not 0 < len(columns) < len(names):
        raise InputError(
            f"a pose of which {len(columns)} of {len(names)} columns are hands", "such as euler or expmap-humanoid"
        )
    return columns


def part_columns(names: Sequence[str]) -> list[list[int]]:
    """Columns of a pose by part, from their names: trunk, head, and arm, hand and leg of each side, if it has them.

    >>> part_columns(["hips.x", "head.rx", "leftUpperArm.rx", "leftHand.rx", "leftGrip.0"])
    [[0], [1], [2], [3, 4]]
    """
    columns: dict[str, list[int]] = {}
    for k, name in enumerate(names):
        side = _SIDE.match(name)
        kinds = ("hand", "leg") if side else ("head",)
        kind = next((kind for kind in kinds if _PARTS[kind].match(name)), "arm" if side else "trunk")
        columns.setdefault(f"{side[0] if side else ''} {kind}", []).append(k)
    return [*columns.values()]


def _gesture_space(skeleton: Skeleton, joints: Sequence[str], hint: str = "") -> list[int]:
    missing = [name for name in joints if name not in skeleton.index]
    if missing:
        more = "" if len(missing) == 1 else f" and {len(missing) - 1} more"
        raise InputError(
            f"a skeleton without the joint {missing[0]!r}{more}", hint or f"it has {', '.join(skeleton.names[:6])}, …"
        )
    return [skeleton.index[name] for name in joints]


def pick(motion: Motion, joints: Sequence[str], kind: str) -> Array:
    """(T, K, 4) rotations of the named joints, in their order, without sign flips, the first with w ≥ 0, in float64.

    Args:
        kind: of the skeleton that has these joints, for the hint.

    Raises:
        InputError: the motion's skeleton lacks a joint.
    """
    columns = _gesture_space(motion.skeleton, joints, f'motion.retarget("{kind}") first')
    rotations = np.asarray(motion.rotations[:, columns], float)
    if len(rotations):
        rotations[:1] *= np.where(rotations[:1, :, 3:] < 0, -1.0, 1.0)
    return quat_continuous(quat_normalize(rotations))


def build_motion(fps: float, skeleton: Skeleton, joints: Sequence[str], rotations: Array, root: Array | None = None) -> Motion:
    """Make a motion in which the named joints have the given rotations, and all others keep the T-pose.

    Args:
        rotations: (T, K, 4) of the named joints.
        root: (T, 3) metres; None: the place of the T-pose.
    """
    all_joints = np.broadcast_to(skeleton.rest, (len(rotations), len(skeleton), 4)).copy()
    all_joints[:, _gesture_space(skeleton, joints)] = rotations
    place = np.broadcast_to(skeleton.offsets[0], (len(rotations), 3)).copy() if root is None else root
    return Motion(fps, quat_continuous(quat_normalize(all_joints)), place, skeleton=skeleton)


def size(vectors: Array, dimensions: int, name: str) -> Array:
    """Check that vectors have the shape (T, dimensions), and return them in float64."""
    vectors = np.asarray(vectors, float)
    if vectors.ndim != 2 or vectors.shape[1] != dimensions:
        raise InputError(f"{name} vectors of shape {vectors.shape}", f"(frames, {dimensions})")
    return vectors


def check_humanoid(motion: Motion) -> None:
    """Raises:
    InputError: a motion of another skeleton than our humanoid.
    """
    if motion.skeleton != humanoid():
        raise InputError(f"a motion on a {motion.skeleton.kind!r} skeleton", 'motion.retarget("humanoid") first')


def humanoid_vectors(vectors: Array, dimensions: int, name: str, skeleton: Skeleton | None) -> Array:
    """Check vectors of a representation that only our humanoid has, and return them in float64.

    Args:
        vectors: (T, dimensions).
        dimensions: D.
        name: of the representation.
        skeleton: the skeleton to decode to; it must be ours, or None.

    Raises:
        InputError: wrong shape or skeleton, or numbers that are not finite or far too large.
    """
    vectors = size(vectors, dimensions, name)
    if not (np.abs(vectors) < _FARTHEST).all():  # false for NaN, too
        raise InputError(f"{name} vectors hold numbers that are not finite or above {_FARTHEST:g}")
    if skeleton is not None and skeleton != humanoid():
        raise InputError(f"{name} vectors for a {skeleton.kind!r} skeleton", "decode, then retarget the motion")
    return vectors
