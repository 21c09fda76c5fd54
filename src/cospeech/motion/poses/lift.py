"""Convert key points to motion of our humanoid, so that networks trained on TED's or PATS's points can write BVH, GLB or VRMA.

The result keeps what the points show: the directions between neck, shoulders, elbows and wrists (TED: with depth; PATS: in the
picture), and the turn of the head (TED). The rest is filled in: hips and legs rest; the torso bends as a whole; upper arms are
twisted so that elbows bend about their hinge; forearms and hands are not twisted; fingers are relaxed.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ...errors import InputError
from ..kinematics import arms
from ..kinematics.arms import MIRROR_Q, MIRROR_V
from ..kinematics.body import NECK_SHARE, SPINE
from ..kinematics.hands import CHANNELS, HAND_SHAPES, Channel
from ..motion import Motion
from ..points import Points
from ..rotations import (
    Array,
    matrix_to_quat,
    quat_between,
    quat_conjugate,
    quat_identity,
    quat_multiply,
    quat_rotate,
    quat_to_rotvec,
    rotvec_to_quat,
    vector_normalize,
)
from ..skeleton import humanoid
from ..skeletons.pats import JOINTS as PATS_JOINTS
from ..skeletons.pats import SOURCES as PATS_SOURCES
from ..skeletons.ted import JOINTS as TED_JOINTS
from ..skeletons.ted import SOURCES as TED_SOURCES
from . import keypoints2d
from .joints import build_motion

__all__ = ["lift"]

_ROUNDS = 4  # rounds of the fit of torso and head [ours: each leaves about a tenth of the error]
_STRAIGHT = 0.1  # sine of the elbow's bend (6°) below which its hinge follows the natural direction of elbows [ours]
_X = np.array([1.0, 0.0, 0.0])


class _Aims(NamedTuple):
    """Unit vectors in the world that the points show; left and right along the second axis.

    Attributes:
        up: (T, 3) from the chest's point to the neck, or None.
        shoulders, upper, fore: (T, 2, 3) from the neck's point to the shoulder, then to the elbow, then to the wrist.
        head: (T, 2, 3) from the neck to the nose, from the nose to the top of the head, or None.
        neck: (3,) the neck's point in the upper chest's axes.
    """

    up: Array | None
    shoulders: Array
    upper: Array
    fore: Array
    head: Array | None
    neck: Array


def lift(points: Points) -> Motion:
    """Convert key points to motion of our humanoid at the same rate, with the hips at their place in the T-pose.

    Args:
        points: of the layout ``"ted"`` (only directions count: bones may be of any length) or ``"pats"`` (a picture: a bone of
            an arm that seems too short points to the front; torso and head do not turn out of the picture).

    Raises:
        InputError: another layout or shape, values that are not finite, or shoulders that lie on the neck.
    """
    makers = {"ted": (_aims_of_ted, (len(TED_JOINTS), 3)), "pats": (_aims_of_pats, (len(PATS_JOINTS), 2))}
    if points.layout not in makers:
        raise InputError(f"key points of the layout {points.layout!r}", f"one of {', '.join(makers)}")
    make, shape = makers[points.layout]
    if points.values.shape[1:] != shape:
        raise InputError(f"{points.layout} key points of shape {points.values.shape}", f"(frames, {shape[0]}, {shape[1]})")
    if not np.isfinite(points.values).all():
        raise InputError("key points hold values that are not finite", "fill gaps first")
    aims = make(np.asarray(points.values, float))
    torso = _torso(aims)
    locals_ = {name: _share(torso, share) for name, share in SPINE} | _head(aims, torso) | _arms(aims, torso)
    names = [*locals_, *(humanoid().names[k] for hand in arms.finger_joints() for k in hand)]
    rotations = np.concatenate([np.stack(list(locals_.values()), 1), _fingers(len(torso))], 1)
    return build_motion(points.fps, humanoid(), names, rotations)


# ------------------------------------------------------------------------------------------------- from points to directions


@lru_cache(2)
def _rest(layout: str) -> dict[str, Array]:
    """Places of the points of a layout in the T-pose."""
    s = humanoid()
    joints, sources = (TED_JOINTS, TED_SOURCES) if layout == "ted" else (PATS_JOINTS, PATS_SOURCES)
    return {point: s.tpose[s.index[name]] + np.array(offset) for point, (name, offset) in zip(joints, sources, strict=True)}


def _aims_of_ted(values: Array) -> _Aims:
    rest = _rest("ted")

    def way(start: str, end: str) -> Array:
        """Direction of a bone; that of the T-pose if its length is 0, which marks missing data."""
        bone = values[:, TED_JOINTS.index(end)] - values[:, TED_JOINTS.index(start)]
        is_missing = np.linalg.norm(bone, axis=-1, keepdims=True) < 1e-6
        return vector_normalize(np.where(is_missing, rest[end] - rest[start], bone))

    def both(start: str, end: str) -> Array:
        return np.stack([way((side + start) if start != "neck" else start, side + end) for side in ("left", "right")], 1)

    s = humanoid()
    return _Aims(
        way("spine", "neck"),
        both("neck", "Shoulder"),
        both("Shoulder", "Elbow"),
        both("Elbow", "Wrist"),
        np.stack([way("neck", "nose"), way("nose", "head")], 1),
        s.offsets[s.index["neck"]],
    )


def _aims_of_pats(values: Array) -> _Aims:
    rest = _rest("pats")
    across = float(np.linalg.norm(rest["RShoulder"] - rest["Neck"]))
    flat = keypoints2d.to_points(keypoints2d.to_vectors(values)) * (across / keypoints2d.SHOULDER)  # metres

    def deep(start: str, end: str, length: float) -> Array:
        """Direction of a bone with depth: it points to the front by as much as it is too short in the picture."""
        bones = []
        for side in "LR":
            bone = flat[:, PATS_JOINTS.index(side + end)] - flat[:, PATS_JOINTS.index(side + start)]
            depth = np.sqrt(np.maximum(length**2 - np.square(bone).sum(-1, keepdims=True), 0))
            bones.append(np.concatenate([bone, depth], -1))
        return vector_normalize(np.stack(bones, 1))

    sides = flat[:, [PATS_JOINTS.index("LShoulder"), PATS_JOINTS.index("RShoulder")]]
    is_missing = np.linalg.norm(sides, axis=-1, keepdims=True) < 1e-6
    sides = np.where(is_missing, np.array([[1.0, 0.0], [-1.0, 0.0]]), sides)
    shoulders = vector_normalize(np.concatenate([sides, np.zeros_like(sides[..., :1])], -1))
    lengths = arms.arm_lengths()
    neck = np.array(PATS_SOURCES[0][1])
    return _Aims(None, shoulders, deep("Shoulder", "Elbow", lengths.upper), deep("Elbow", "Wrist", lengths.fore), None, neck)


# ------------------------------------------------------------------------------------------------- from directions to rotations


def _basis(first: Array, second: Array) -> Array:
    """(…, 4) rotation whose x-axis lies along ``first`` and whose y-axis leans to ``second``."""
    x = vector_normalize(first)
    y = second - np.einsum("...i,...i->...", x, second)[..., None] * x
    small = np.eye(3)[np.abs(x).argmin(-1)]  # the two are parallel: any normal does
    small = small - np.einsum("...i,...i->...", x, small)[..., None] * x
    y = vector_normalize(np.where(np.linalg.norm(y, axis=-1, keepdims=True) < 1e-6, small, y))
    return matrix_to_quat(np.stack([x, y, np.cross(x, y)], -1))


def _share(rotation: Array, share: float) -> Array:
    return rotvec_to_quat(quat_to_rotvec(rotation) * share)


def _torso(aims: _Aims) -> Array:
    """(T, 4) rotation of the upper chest that puts the neck above the chest, and turns the line of the shoulders, as the points
    show. The joints of the spine share it, so that the chest turns less: the fit needs some rounds."""
    s, rest = humanoid(), _rest("ted")
    line = aims.shoulders[:, 0] - aims.shoulders[:, 1]
    up = aims.up
    if up is None:  # upright but for the tilt of the shoulders
        return quat_between(np.broadcast_to(_X, line.shape), line)
    below = rest["spine"] - s.tpose[s.index["chest"]]
    low, high = s.offsets[s.index["upperChest"]] - below, s.offsets[s.index["neck"]]
    goal = _basis(up, line)
    torso = quat_multiply(goal, quat_conjugate(_basis(low + high, _X)))
    chest_share = sum(share for name, share in SPINE if name != "upperChest")
    for _ in range(_ROUNDS):
        direction = quat_rotate(_share(torso, chest_share), low) + quat_rotate(torso, high)
        is_now = _basis(direction, quat_rotate(torso, _X))
        torso = quat_multiply(quat_multiply(goal, quat_conjugate(is_now)), torso)
    return torso


def _head(aims: _Aims, torso: Array) -> dict[str, Array]:
    """Rotations of neck and head. They follow the mean of both directions, because the length of noses differs."""
    if aims.head is None:
        return {name: quat_identity(len(torso)) for name in ("neck", "head")}
    s, rest = humanoid(), _rest("ted")
    joint, nose = s.offsets[s.index["head"]], rest["nose"] - s.tpose[s.index["head"]]
    goal = _basis(aims.head.sum(1), aims.head[:, 0])
    head, crown = torso, rest["head"] - rest["nose"]
    for _ in range(_ROUNDS):
        bend = quat_multiply(quat_conjugate(torso), head)
        neck = quat_multiply(torso, _share(bend, NECK_SHARE))
        lower, upper = (
            vector_normalize(quat_rotate(neck, joint) + quat_rotate(head, nose)),
            vector_normalize(quat_rotate(head, crown)),
        )
        head = quat_multiply(quat_multiply(goal, quat_conjugate(_basis(lower + upper, lower))), head)
    bend = quat_multiply(quat_conjugate(torso), head)
    return {"neck": _share(bend, NECK_SHARE), "head": _share(bend, 1 - NECK_SHARE)}


def _arms(aims: _Aims, torso: Array) -> dict[str, Array]:
    """Rotations of clavicles and arms, computed in the upper chest's axes for left arms; the right one is mirrored."""
    s = humanoid()
    back = quat_conjugate(torso)[:, None]

    def mirror_directions(directions: Array) -> Array:
        own = quat_rotate(back, directions)
        return own * np.stack([np.ones(3), MIRROR_V])

    along, upper, fore = (mirror_directions(d) for d in (aims.shoulders, aims.upper, aims.fore))
    clavicle = s.offsets[s.index["leftUpperArm"]]
    start = s.offsets[s.index["leftShoulder"]] - aims.neck
    # the shoulder lies on the ray from the neck's point, one length of the clavicle away from the clavicle's joint
    middle = along @ start
    far = middle + np.sqrt(np.maximum(middle**2 - start @ start + clavicle @ clavicle, 0))
    shoulder = quat_between(np.broadcast_to(clavicle, along.shape), far[..., None] * along - start)
    natural = vector_normalize(np.cross(upper, np.broadcast_to(arms.POLE, upper.shape)))
    hinge = -np.cross(upper, fore) + _STRAIGHT * natural
    frames = [
        arms.bone_frame(d, vector_normalize(hinge - np.einsum("...i,...i->...", hinge, d)[..., None] * d))
        for d in (upper, fore)
    ]
    locals_ = {
        "Shoulder": shoulder,
        "UpperArm": arms.to_parent(shoulder, frames[0]),
        "LowerArm": arms.to_parent(frames[0], frames[1]),
    }
    return {"left" + name: q[:, 0] for name, q in locals_.items()} | {
        "right" + name: q[:, 1] * MIRROR_Q for name, q in locals_.items()
    }


def _fingers(frames: int) -> Array:
    """(T, 30, 4) rotations of both hands, relaxed."""
    channels = np.zeros(CHANNELS)
    channels[Channel.KNUCKLES.start : Channel.THUMB.stop] = HAND_SHAPES["relaxed"].values()
    left = arms.finger_rotations(channels)
    return np.broadcast_to(np.concatenate([left, left * MIRROR_Q]), (frames, 2 * len(left), 4))
