"""Keep arms out of torso and head.

Wrists, palms, fingers and forearms are pushed out (`body_volume`), and the arm follows. Its elbow stays on the same side of the
line from shoulder to wrist, and its hand turns with the forearm. Each frame depends on itself alone. Arms that touch nothing do
not change.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..curves import clip, smoothstep
from ..rotations import Array, quat_between, quat_conjugate, quat_multiply, quat_rotate, vector_normalize
from ..skeleton import humanoid
from .arms import MIRROR_Q, MIRROR_V, MOST_REACH, arm_lengths, mirror_arm, to_parent
from .body_volume import HEAD_CENTRE, push_from_head, push_from_torso
from .two_bones import place_middle_joint

__all__ = ["TrunkFrames", "find_pushes", "keep_arms_out", "move_wrists", "push_from_body", "trunk_frames"]

_LOW, _OVER = 1.02, 0.20
"""Height of the T-pose in metres from which on the torso turns with the chest, and metres over which this changes [ours]."""
_BALLS = ((0.0, 0.036), (0.080, 0.050), (0.140, 0.030))
"""Metres along the hand from the wrist, and radius, of wrist, palm and fingers [ours: those of the hands of the rules]."""
_ALONG, _FOREARM = 0.62, 0.036  # share of the forearm from the elbow, and the radius of the arm there, metres [ours]
_TIMES = 3  # rounds of pushes [ours: a hand that leaves the torso may meet the head]
_AIR = 0.004  # metres between body and arm [ours]
_TOUCHES = 1e-4  # sum of pushes in metres from which on an arm is moved [ours: pushes begin softly]
_LEAST_BEND = 0.03  # upper arms from the elbow to the line to the wrist; below it, the hinge gives the elbow's side [ours]


class TrunkFrames(NamedTuple):
    """The trunk in the frames of both arms: (N, 2, …), the right side mirrored; positions relative to the upper chest."""

    to_hips: Array
    from_hips: Array
    hips_at: Array
    head_at: Array


def push_from_body(point: Array, radius: Array | float, trunk: TrunkFrames) -> Array:
    """Displacement that moves balls at ``point (..., N, 2, 3)`` out of torso and head, in the frame of the upper chest."""
    in_chest, in_hips = _tpose()
    upper = point + in_chest
    lower = quat_rotate(trunk.to_hips, point) + trunk.hips_at + in_hips
    mix = smoothstep((upper[..., 1] - _LOW) / _OVER)[..., None]
    push = push_from_torso(upper * mix + lower * (1 - mix), radius)
    out = push * mix + quat_rotate(trunk.from_hips, push) * (1 - mix)
    return out + push_from_head(point + out, trunk.head_at, radius)  # type: ignore[no-any-return]


def trunk_frames(q: Array) -> TrunkFrames:
    """The trunk in the frames of both arms, from local rotations (N, J, 4)."""
    s = humanoid()
    spine, chest, upper, neck, head = (q[:, s.index[name]] for name in ("spine", "chest", "upperChest", "neck", "head"))
    o = {name: s.offsets[s.index[name]] for name in ("spine", "chest", "upperChest", "neck", "head")}
    two = quat_multiply(spine, chest)
    to_hips = quat_multiply(two, upper)
    hips_at = o["spine"] + quat_rotate(spine, o["chest"]) + quat_rotate(two, o["upperChest"])
    head_at = o["neck"] + quat_rotate(neck, o["head"] + quat_rotate(head, HEAD_CENTRE))
    both = mirror_arm(to_hips, MIRROR_Q)
    return TrunkFrames(both, quat_conjugate(both), mirror_arm(hips_at, MIRROR_V), mirror_arm(head_at, MIRROR_V))


def keep_arms_out(q: Array, amount: float = 1.0) -> None:
    """Move arms and hands out of torso and head.

    Args:
        q: (N, J, 4) local rotations of our humanoid; changed in place.
        amount: share of the way that they move, 0 … 1.
    """
    if amount:
        arm = _read_arms(q)
        _place_wrists(q, arm, amount * _find_pushes(arm, trunk_frames(q)))


def find_pushes(q: Array) -> Array:
    """(N, 2, 3) metres by which the wrists of local rotations (N, J, 4) must move to leave torso and head.

    In the frame of the upper chest, the right side mirrored; zero if an arm touches nothing.
    """
    return _find_pushes(_read_arms(q), trunk_frames(q))


def move_wrists(q: Array, ways: Array) -> None:
    """Move the wrists of local rotations (N, J, 4), in place, by ``ways`` (N, 2, 3) as of `find_pushes`."""
    if ways.any():
        _place_wrists(q, _read_arms(q), ways)


def _find_pushes(arm: _Arms, trunk: TrunkFrames) -> Array:
    """See `find_pushes`."""
    rows = np.flatnonzero(_find_touches(arm, trunk))
    pushes = np.zeros_like(arm.wrist)
    if len(rows):
        trunk, arm = TrunkFrames(*(part[rows] for part in trunk)), _Arms(*(part[rows] for part in arm))
        pushes[rows] = _find_push(arm, trunk)
    return pushes


def _place_wrists(q: Array, arm: _Arms, ways: Array) -> None:
    """See `move_wrists`; ``arm``: the arms of ``q``."""
    rows = np.flatnonzero(ways.any((1, 2)))
    if not len(rows):
        return
    arm = _Arms(*(part[rows] for part in arm))
    upper, fore = _follow(arm, arm.wrist - arm.shoulder + ways[rows])
    joint = humanoid().index
    for name, turn in (("UpperArm", to_parent(arm.clavicle, upper)), ("LowerArm", to_parent(upper, fore))):
        q[rows, joint["left" + name]] = turn[:, 0]
        q[rows, joint["right" + name]] = turn[:, 1] * MIRROR_Q


class _Arms(NamedTuple):
    """(N, 2, …) in the frame of the upper chest, the right side mirrored."""

    clavicle: Array
    upper: Array
    fore: Array
    hand: Array
    shoulder: Array
    elbow: Array
    wrist: Array


def _read_arms(q: Array) -> _Arms:
    s = humanoid()
    turns, at = list[Array](), [s.offsets[s.index["leftShoulder"]]]
    for name, child in (("Shoulder", "UpperArm"), ("UpperArm", "LowerArm"), ("LowerArm", "Hand"), ("Hand", "")):
        local = np.stack([q[:, s.index["left" + name]], q[:, s.index["right" + name]] * MIRROR_Q], 1)
        turns.append(quat_multiply(turns[-1], local) if turns else local)
        if child:
            at.append(at[-1] + quat_rotate(turns[-1], s.offsets[s.index["left" + child]]))
    return _Arms(*turns, *at[1:])


def _find_touches(arm: _Arms, trunk: TrunkFrames) -> Array:
    """(N,) whether an arm is so near to the body that it must move. Most are not, and then need no further work."""
    far, radius = (np.array(column)[:, None, None] for column in zip(*_BALLS, (0.0, _FOREARM), strict=True))
    points = arm.wrist + far[..., None] * quat_rotate(arm.hand, np.array([1.0, 0.0, 0.0]))
    points[-1] = arm.elbow + _ALONG * (arm.wrist - arm.elbow)
    push = push_from_body(points, radius + _AIR, trunk)
    return (_length(push).sum(0) > _TOUCHES).any(1)  # type: ignore[no-any-return]


def _find_push(arm: _Arms, trunk: TrunkFrames) -> Array:
    """(N, 2, 3) metres by which the wrists must move."""
    along = quat_rotate(arm.hand, np.array([1.0, 0.0, 0.0]))
    shift = np.zeros_like(arm.wrist)
    for _ in range(_TIMES):
        for far, radius in _BALLS:
            shift = shift + push_from_body(arm.wrist + far * along + shift, radius + _AIR, trunk)
        middle = arm.elbow + _ALONG * (arm.wrist + shift - arm.elbow)
        shift = shift + push_from_body(middle, _FOREARM + _AIR, trunk) / _ALONG
    return shift


def _follow(arm: _Arms, to: Array) -> tuple[Array, Array]:
    """(N, 2, 4) rotations of upper arm and forearm with which the wrists are at ``to (N, 2, 3)`` from the shoulders."""
    lengths, before = arm_lengths(), arm.wrist - arm.shoulder
    far = _length(to)[..., None]
    distance = clip(
        far, abs(lengths.upper - lengths.fore) + _AIR, np.maximum(_length(before)[..., None], MOST_REACH * lengths.total)
    )
    line = to / np.maximum(far, 1e-6)
    turn = quat_between(before, line)
    off = _square_to(quat_rotate(turn, arm.elbow - arm.shoulder), line)
    straight = smoothstep(1.0 - _length(off) / (_LEAST_BEND * lengths.upper))[..., None]
    back = quat_rotate(turn, quat_rotate(arm.upper, np.array([0.0, 0.0, -1.0])))
    pole = vector_normalize(off + straight * lengths.upper * _square_to(back, line))
    bone = place_middle_joint(line, distance[..., 0], pole, lengths)
    upper = _turn_bone(arm.elbow - arm.shoulder, bone, arm.upper)
    return upper, _turn_bone(arm.wrist - arm.elbow, distance * line - bone, arm.fore)


def _length(vectors: Array) -> Array:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))  # type: ignore[no-any-return]


def _square_to(vectors: Array, line: Array) -> Array:
    """The part of vectors that is at right angles to unit vectors."""
    return vectors - np.einsum("...i,...i->...", vectors, line)[..., None] * line  # type: ignore[no-any-return]


def _turn_bone(before: Array, after: Array, rotation: Array) -> Array:
    return quat_multiply(quat_between(before, after), rotation)


@lru_cache(1)
def _tpose() -> tuple[Array, Array]:
    """(3,) positions of upper chest and hips in the T-pose, metres."""
    s = humanoid()
    return s.tpose[s.index["upperChest"]], s.tpose[s.index["hips"]]
