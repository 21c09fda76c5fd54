"""Retarget a motion: carry it over from one skeleton to another.

Both skeletons start from a T-pose. Each joint's rotation *since the T-pose*, in the world, is carried over. So the axes of the
bones do not matter, nor the number of joints between two that correspond. Bones of arms, legs, hands and fingers then point
exactly as those of the source; hips, spine, head, shoulders and feet turn as much as those of the source. Joints that the
source lacks are interpolated between their neighbours (spine, neck), or keep their rest pose.

The way of the hips scales with the height of the hips. If one of the two skeletons has no legs, it scales with the distance
from hips to head, about the place of the hips at rest. If one has no hips, as a head alone, the root does not move.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from ..errors import InputError
from .bone_mapping import load_map, names_joints, recognise
from .limbs import lacks_limb
from .motion import Motion
from .rotations import (
    Array,
    axis_angle_to_quat,
    quat_between,
    quat_conjugate,
    quat_continuous,
    quat_identity,
    quat_multiply,
    quat_normalize,
    quat_rotate,
    quat_slerp,
)
from .skeleton import Skeleton, find_skeleton
from .soles import Soles, find_soles
from .tpose import directions

__all__ = ["load_map", "recognise", "retarget", "skeleton"]

skeleton = find_skeleton  # by its name, as in `cospeech.motion.skeletons.SKELETONS`

_AIMED = ("UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Thumb", "Index", "Middle", "Ring", "Little")
_SPINE = ("spine", "chest", "upperChest")
_FINGERS = ("Index", "Middle", "Ring", "Little")
_ROOTS = ("ThumbMetacarpal", *(f"{finger}Proximal" for finger in _FINGERS))
_FAN, _WIDE = np.radians((15.0, 40.0))  # angle from index to little finger in the T-pose [ours: of a relaxed, of a spread hand]


def retarget(
    motion: Motion, target: str | Skeleton, *, bone_map: Mapping[str, str] | None = None, scale_root: bool = True
) -> Motion:
    """Carry a motion over to another skeleton.

    Args:
        motion: of any skeleton that `recognise` knows, or whose joints ``bone_map`` names.
        target: a name of `cospeech.motion.skeletons.SKELETONS`, or a skeleton whose ``rest`` is its T-pose.
        bone_map: our name → name of a joint of the source, or of the target if the source has no such joints; see
            `cospeech.motion.bone_mapping.load_map`.
        scale_root: scale the way of the hips by the ratio of hip heights, so that feet do not slide. The lower sole is then as
            high above the floor as that of the source, scaled. Otherwise, the hips move as far as those of the source. If one
            side has no legs, the ratio is that of the distances from hips to head.

    Returns:
        Motion of the target; the face is not changed.

    Raises:
        InputError: a skeleton is not recognised, or ``bone_map`` has unknown names.
    """
    if not isinstance(target, (str, Skeleton)):
        raise InputError(f"cannot retarget to a {type(target).__name__}", "give the name of a skeleton, or a Skeleton")
    goal = find_skeleton(target) if isinstance(target, str) else target
    if goal == motion.skeleton and "" not in goal.bone_map.values():  # with "", a part of the character must stay at rest
        same = goal.layout is motion.skeleton.layout
        return motion if same else replace(motion, skeleton=replace(motion.skeleton, layout=goal.layout))
    source_map, goal_map = bone_map, None
    if bone_map and not names_joints(bone_map, motion.skeleton):
        source_map, goal_map = None, bone_map
    plan = _plan(_Key(motion.skeleton, source_map), _Key(goal, goal_map))
    rotations, root = plan.apply(np.asarray(motion.rotations, float), np.asarray(motion.root, float), scale_root)
    kind = motion.rotations.dtype
    return Motion(
        fps=motion.fps,
        rotations=rotations.astype(kind, copy=False),
        root=root.astype(motion.root.dtype, copy=False),
        face=motion.face,
        skeleton=goal,
        start=motion.start,
    )


class _Key:
    """A skeleton and its bone map as a key of the cache, so that a plan is made once for all pieces of a stream."""

    def __init__(self, skeleton: Skeleton, bone_map: Mapping[str, str] | None) -> None:
        self.skeleton, self.bone_map = skeleton, bone_map
        ends = tuple((name, tuple(end)) for name, end in sorted(skeleton.ends.items()))
        maps = tuple(tuple(sorted(names.items())) for names in (skeleton.bone_map, bone_map or {}))
        self.value = (skeleton.names, skeleton.parents, skeleton.offsets.tobytes(), skeleton.rest.tobytes(), ends, maps)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self.value == other.value

    def __hash__(self) -> int:
        return hash(self.value)


@dataclass(frozen=True)
class _Plan:
    """All that depends on the pair of skeletons, but not on the motion.

    Attributes:
        pairs: (2, P) target joints, and the source joints that turn them.
        before: (P, 4) factor from the right that leads from the source's world rotation to that of the target.
        between: target joint, its two neighbours among the pairs, and its part of the way between them.
        hips: joints of source and target; None if one has no hips.
        trunks: distance from hips to head of both, metres, if one has no legs; None if both have legs, or one has no hips.
        soles: of both; None if one has no feet.
    """

    source: Skeleton
    target: Skeleton
    pairs: Array
    before: Array
    between: tuple[tuple[int, int, int, float], ...]
    hips: tuple[int, int] | None
    trunks: tuple[float, float] | None
    soles: tuple[Soles, Soles] | None

    def apply(self, rotations: Array, root: Array, scale_root: bool) -> tuple[Array, Array]:
        """Local rotations (T, J, 4) and root positions (T, 3) of the target."""
        points, world = self.source.forward(rotations, root)
        rest = self.target.forward(self.target.rest, self.target.offsets[0])[1]
        target_world = np.zeros((len(root), len(self.target), 4))
        target_world[:, self.pairs[0]] = quat_multiply(world[:, self.pairs[1]], self.before)
        since: dict[int, Array] = {}  # rotation since the T-pose of the neighbours of interpolated joints
        for joint, low, high, part in self.between:
            for k in (low, high):
                since.setdefault(k, quat_multiply(target_world[:, k], quat_conjugate(rest[k])))
            target_world[:, joint] = quat_multiply(quat_slerp(since[low], since[high], np.array(part)), rest[joint])
        driven_joints = {*map(int, self.pairs[0]), *(b[0] for b in self.between)}
        local = np.empty_like(target_world)
        for joint, parent in enumerate(self.target.parents):
            if joint in driven_joints:
                above = quat_conjugate(target_world[:, parent]) if parent >= 0 else quat_identity()
                local[:, joint] = quat_multiply(above, target_world[:, joint])
            else:
                local[:, joint] = self.target.rest[joint]
                target_world[:, joint] = (
                    quat_multiply(target_world[:, parent], self.target.rest[joint]) if parent >= 0 else self.target.rest[joint]
                )
        local = quat_continuous(quat_normalize(local))
        return local, self._root(points, world, quat_normalize(target_world), scale_root)

    def _root(self, points: Array, world: Array, target_world: Array, scale_root: bool) -> Array:
        """Root positions that put the target's hips at their place, and its soles at the height of the source's.

        Args:
            points: (T, J, 3) positions of the source's joints, metres.
            world: (T, J, 4) their world rotations.
            target_world: (T, J', 4) world rotations of the target's joints.
            scale_root: as `retarget` takes it.
        """
        if self.hips is None:
            return np.tile(self.target.offsets[0], (len(points), 1))
        ends = (self.source, self.hips[0]), (self.target, self.hips[1])
        rests = tuple(skeleton.tpose[hips] - (0.0, skeleton.floor, 0.0) for skeleton, hips in ends)
        source_height, target_height = self.trunks or tuple(float(rest[1]) for rest in rests)
        scale = target_height / source_height if scale_root and source_height > 1e-3 and target_height > 1e-3 else 1.0
        hips = points[:, self.hips[0]] - (0.0, self.source.floor, 0.0)
        if self.trunks:
            place = (hips - rests[0]) * scale + rests[1] + (0.0, self.target.floor, 0.0)
        else:
            place = hips * scale + (0.0, self.target.floor + (0.0 if scale_root else target_height - source_height), 0.0)
        if self.hips[1] == 0 and not (scale_root and self.soles):
            return place
        target_points = self.target.place(target_world)
        root = place - target_points[:, self.hips[1]]
        if scale_root and self.soles is not None:
            above = (self.soles[0].heights(points, world) - self.source.floor) * scale
            root[:, 1] = above + self.target.floor - self.soles[1].heights(target_points, target_world)
        return root


def _is_stub(skeleton: Skeleton, joint: str, ours: str) -> bool:
    """Whether a whole finger is one joint without length. It has no direction, and files turn it about itself by any angle."""
    tip = skeleton.ends.get(joint)
    return tip is not None and not any(tip) and ours.endswith(_ROOTS)


def _drop_folds(aims: Mapping[str, Array]) -> dict[str, Array]:
    """Directions of bones in the T-pose, without last bones of fingers that point back at the bones before them.

    No hand is like that: the tip in the file lies on the wrong side of its joint.
    """
    above = {name: name.replace("Distal", "Proximal" if "Thumb" in name else "Intermediate") for name in aims}
    return {name: aim for name, aim in aims.items() if not name.endswith("Distal") or aim @ aims.get(above[name], aim) >= 0}


def _close_fans(aims: Mapping[str, Array]) -> dict[str, Array]:
    """Directions of bones in the T-pose, with widely spread fingers moved closer to each other.

    Some characters are modelled with spread fingers, and takes without finger data leave them so. On both skeletons, such
    a hand counts as relaxed; so the way there and back loses nothing.
    """
    result = dict(aims)
    for side in ("left", "right"):
        first = {f: aims[f"{side}{f}Proximal"] for f in _FINGERS if f"{side}{f}Proximal" in aims}
        if not {"Index", "Little"} <= first.keys():
            continue
        sideways = {f: np.arctan2(aim[2], abs(aim[0])) for f, aim in first.items()}
        fan = sideways["Index"] - sideways["Little"]
        if fan <= _WIDE:
            continue
        centre = sideways.get("Middle", (sideways["Index"] + sideways["Little"]) / 2)
        for finger, angle in sideways.items():
            closing = (angle - centre) * (1 - _FAN / fan)
            turn = axis_angle_to_quat(np.array([0.0, 1.0, 0.0]), closing if side == "left" else -closing)
            for name in (name for name in aims if name.startswith(side + finger)):
                result[name] = quat_rotate(turn, aims[name])
    return result


@lru_cache(32)
def _plan(a: _Key, b: _Key) -> _Plan:
    source, target = a.skeleton, b.skeleton
    theirs, goal = recognise(source, a.bone_map), recognise(target, b.bone_map)
    partner = {name: name for name in goal if name in theirs}
    tops = [next((n for n in reversed(_SPINE) if n in names), None) for names in (theirs, goal)]
    if all(tops):  # the joints that carry the shoulders correspond, whatever their names are
        partner = {ours: name for ours, name in partner.items() if ours not in _SPINE or name != tops[0]}
        partner[tops[1]] = tops[0]  # type: ignore[index, assignment]
    source_rest, target_rest = (s.forward(s.rest, s.offsets[0])[1] for s in (source, target))
    aims = tuple(_close_fans(_drop_folds(directions(s, n))) for s, n in ((source, theirs), (target, goal)))
    pairs, before = [], []
    for ours, name in partner.items():
        if any(_is_stub(s, n[key], ours) for s, n, key in ((source, theirs, name), (target, goal, ours))):
            continue
        j, k = target.index[goal[ours]], source.index[theirs[name]]
        change = quat_identity()
        if any(word in ours for word in _AIMED) and ours in aims[0] and ours in aims[1]:
            change = quat_between(aims[1][ours], aims[0][ours])
        pairs.append((j, k))
        before.append(quat_multiply(quat_multiply(quat_conjugate(source_rest[k]), change), target_rest[j]))
    between = _spread(target, goal, {j for j, _ in pairs})
    hips = (source.index[theirs["hips"]], target.index[goal["hips"]]) if "hips" in partner else None
    soles = find_soles(source, theirs), find_soles(target, goal)
    both = None if None in soles else soles
    trunks = _trunks((source, theirs), (target, goal)) if hips and lacks_limb(partner, "legs") else None
    turns = np.array(pairs, int).reshape(-1, 2).T, np.array(before).reshape(-1, 4)
    return _Plan(source, target, *turns, between, hips, trunks, both)  # type: ignore[arg-type]


def _trunks(*bodies: tuple[Skeleton, Mapping[str, str]]) -> tuple[float, ...]:
    """Distance from hips to head of each body, metres; 0 without a head."""
    ends = [[body.tpose[body.index[names.get(name, names["hips"])]] for name in ("hips", "head")] for body, names in bodies]
    return tuple(float(np.linalg.norm(head - hips)) for hips, head in ends)


def _spread(target: Skeleton, goal: Mapping[str, str], pair_joints: set[int]) -> tuple[tuple[int, int, int, float], ...]:
    """Joints from hips to head between those with a partner: ``(joint, neighbour below, neighbour above, part of the way)``."""
    if not {"hips", "head"} <= goal.keys():
        return ()
    chain = [target.index[goal["head"]]]
    while chain[-1] != target.index[goal["hips"]] and target.parents[chain[-1]] >= 0:
        chain.append(target.parents[chain[-1]])
    chain.reverse()
    anchors = [k for k, joint in enumerate(chain) if joint in pair_joints]
    rows = []
    for low, high in pairwise(anchors):
        for k in range(low + 1, high):
            rows.append((chain[k], chain[low], chain[high], (k - low) / (high - low)))
    return tuple(rows)
