"""Make a T-pose from the zero pose of a file: facing +Z, Y up, arms along ±X, legs down, feet on the floor.

A bone whose direction is right within a tolerance stays as it was modelled. So a skeleton in a T-pose is not changed, and keeps
natural bends of knees and shoulders. If the zero pose does not show the turn of a limb about its own axis, the palms (down) and
the feet (forward) decide.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from .rotations import (
    Array,
    axis_angle_to_quat,
    matrix_to_quat,
    quat_angle,
    quat_between,
    quat_conjugate,
    quat_multiply,
    quat_rotate,
    vector_normalize,
)
from .skeleton import Skeleton

__all__ = ["directions", "on_floor", "with_tpose"]

_X, _Y, _Z = np.eye(3)
_UP = ("spine", "chest", "upperChest", "neck", "head")
_CHILD = {  # the joint that a bone points at, the first that exists
    "spine": ("chest", "upperChest", "neck", "head"), "chest": ("upperChest", "neck", "head"),
    "upperChest": ("neck", "head"), "neck": ("head",), "head": (),
    "Shoulder": ("UpperArm",), "UpperArm": ("LowerArm",), "LowerArm": ("Hand",),
    "Hand": ("MiddleProximal", "IndexProximal", "RingProximal"),
    "UpperLeg": ("LowerLeg",), "LowerLeg": ("Foot",), "Foot": ("Toes",), "Toes": (),
    **{f"{f}{a}": (f"{f}{b}",) for f in ("Index", "Middle", "Ring", "Little")
       for a, b in (("Proximal", "Intermediate"), ("Intermediate", "Distal"))},
    "ThumbMetacarpal": ("ThumbProximal",), "ThumbProximal": ("ThumbDistal",),
    **{f"{f}Distal": () for f in ("Thumb", "Index", "Middle", "Ring", "Little")},
}  # fmt: skip
# Error in degrees up to which a bone is not turned. Ours: limbs of modelled T-poses are within 10°; collar bones, hands, feet
# and spines differ by build, and are turned only if the pose is no T-pose at all.
_LIMB, _HAND, _FINGER, _COLLAR, _SPINE, _FOOT = 10.0, 20.0, 45.0, 50.0, 45.0, 50.0
_TWIST = 35.0
_APART = 60.0  # degrees; if the parent had to turn by more, the modelled direction of a bone means nothing
_PHALANGES = ("Metacarpal", "Proximal", "Intermediate", "Distal")
_SNAP = 35.0  # degrees up to which an axis of the file counts as the body's axis
_FOOT_SLOPE = np.array([0.0, -0.45, 0.89])  # ours: ankle to ball of our humanoid


def _part(name: str) -> tuple[str, float]:
    """``leftHand`` → ``("Hand", +1)``; +1 for the left and the middle."""
    if name.startswith("left"):
        return name[4:], 1.0
    return (name[5:], -1.0) if name.startswith("right") else (name, 1.0)


def directions(skeleton: Skeleton, names: Mapping[str, str]) -> dict[str, Array]:
    """Directions of bones in the rest pose, not normalised: from each joint to the next joint of ours below it, or to its tip.

    Args:
        skeleton, names: theirs, and our name → their name.

    Returns:
        Our name → (3,); that of a foot leads to the tip of its toes. Bones without a next joint or a tip, or of length zero,
        are absent.
    """
    points, tips = _points_and_tips(skeleton)
    aims = {}
    for ours, theirs in names.items():
        part, _ = _part(ours)
        side = ours[: len(ours) - len(part)]
        below = next((side + c for c in _CHILD.get(part, ()) if side + c in names), None)
        joint = skeleton.index[theirs]
        children = skeleton.children[joint]
        if part == "Foot":
            aims[ours] = _farthest(skeleton, joint, points, tips)
        elif below is not None:
            aims[ours] = points[skeleton.index[names[below]]] - points[joint]
        elif part in _CHILD and joint in tips:
            aims[ours] = tips[joint] - points[joint]
        elif part in _CHILD and len(children) == 1:
            aims[ours] = points[children[0]] - points[joint]
        if ours in aims and np.linalg.norm(aims[ours]) < 1e-9:
            del aims[ours]
    return aims


def _points_and_tips(skeleton: Skeleton) -> tuple[Array, dict[int, Array]]:
    """(J, 3) positions of the joints, and joint → tip of its last bone, in the rest pose."""
    points, world = skeleton.forward(skeleton.rest, skeleton.offsets[0])
    joints = {skeleton.index[name]: np.array(end, float) for name, end in skeleton.ends.items() if name in skeleton.index}
    return points, {j: points[j] + quat_rotate(world[j], end) for j, end in joints.items()}


def _farthest(skeleton: Skeleton, joint: int, points: Array, tips: Mapping[int, Array]) -> Array:
    """Vector from a foot to its farthest point, the tip of the toes, whatever joints it has."""
    below = [joint]
    for j in range(joint + 1, len(skeleton)):
        if skeleton.parents[j] in below:
            below.append(j)
    ways = [points[j] - points[joint] for j in below] + [tips[j] - points[joint] for j in below if j in tips]
    return max(ways, key=lambda v: float(v @ v))


def with_tpose(skeleton: Skeleton, names: Mapping[str, str]) -> Skeleton:
    """Give a skeleton the T-pose as ``rest``, with its lowest joint or tip on the floor, and its hips over the origin.

    Args:
        skeleton: theirs; its ``rest`` is the pose to start from.
        names: our name → their name (`cospeech.motion.bone_mapping.recognise`).
    """
    if "hips" not in names:
        return skeleton
    maker = _Maker(skeleton, names)
    world = maker.turn()
    above = world[[max(p, 0) for p in skeleton.parents]]
    above[0] = (0, 0, 0, 1)
    rest = quat_multiply(quat_conjugate(above), world)
    same = np.abs(np.sum(rest * skeleton.rest, -1)) > 1 - 1e-12
    rest = np.where(same[:, None], skeleton.rest, rest)
    return on_floor(replace(skeleton, rest=rest), skeleton.index[names["hips"]])


def on_floor(skeleton: Skeleton, hips: int, height: float = 0.0) -> Skeleton:
    """Move the root so that the lowest point of the T-pose is at ``height`` and the joint ``hips`` over the origin."""
    offsets = skeleton.offsets.copy()
    offsets[0] = 0
    points, tips = _points_and_tips(replace(skeleton, offsets=offsets))
    lowest = min(p[1] for p in (*points, *tips.values()))
    offsets[0] = (-points[hips, 0], height - lowest, -points[hips, 2])
    return replace(skeleton, offsets=offsets + 0.0, floor=height)


class _Maker:
    """Turns joints from the root outwards."""

    def __init__(self, skeleton: Skeleton, names: Mapping[str, str]) -> None:
        self.skeleton, self.names = skeleton, names
        self.ours = {skeleton.index[theirs]: ours for ours, theirs in names.items()}
        self.points, self.start = skeleton.forward(skeleton.rest, skeleton.offsets[0])
        self.bones = directions(skeleton, names)
        self.whole = self._facing()
        self.turns: dict[str, Array] = {}  # our name → twist that is still needed
        self.rigid: set[str] = set()  # joints that follow their parent, which was twisted
        self.originals: set[str] = set()

    def at(self, ours: str) -> Array:
        """Position of one of our joints in the start pose."""
        return self.points[self.skeleton.index[self.names[ours]]]

    def _facing(self) -> Array:
        """(4,) rotation of the whole body that turns its left to +X and its top to +Y."""
        pairs = ("UpperLeg", "UpperArm", "Shoulder", "Eye")
        pair = next((p for p in pairs if {f"left{p}", f"right{p}"} <= set(self.names)), None)
        if pair is None:
            return np.array([0.0, 0, 0, 1])
        left = vector_normalize(self.at(f"left{pair}") - self.at(f"right{pair}"))
        hips, up = self.at("hips"), np.zeros(3)
        for name in (next((n for n in _UP if n in self.names), "hips"), "neck", "head"):
            up += vector_normalize(self.at(name) - hips) if name in self.names else 0
        legs = [self.at(n) for n in ("leftFoot", "rightFoot", "leftLowerLeg", "rightLowerLeg") if n in self.names]
        up += vector_normalize(hips - np.mean(legs, 0)) if legs else 0
        up = vector_normalize(up - left * (left @ up))
        if not left.any() or not up.any():
            return np.array([0.0, 0, 0, 1])
        axis = _nearest_axis(left)
        top = _nearest_axis(np.where(axis != 0, 0.0, up))
        if _angle(left, axis) < _SNAP and _angle(up, top) < _SNAP + 10 and abs(axis @ top) < 0.5:
            left, up = axis, top
        return matrix_to_quat(np.stack([left, up, np.cross(left, up)]))

    def turn(self) -> Array:
        """(J, 4) world rotations of the T-pose."""
        world = self._pass()
        self._find_twists(world)
        return self._pass() if self.turns else world

    def _pass(self) -> Array:
        skeleton = self.skeleton
        world = np.empty_like(self.start)
        for joint, parent in enumerate(skeleton.parents):
            original = quat_multiply(self.whole, self.start[joint])
            follow = original if parent < 0 else quat_multiply(world[parent], skeleton.rest[joint])
            ours = self.ours.get(joint)
            if ours is None or ours == "hips" or parent < 0:
                world[joint] = original if ours == "hips" else follow
                continue
            world[joint] = self._settle(ours, joint, original, follow)
            if ours in self.turns:
                world[joint] = quat_multiply(self.turns[ours], world[joint])
        return world

    def _settle(self, ours: str, joint: int, original: Array, follow: Array) -> Array:
        """World rotation of a joint: as modelled if that is right, else with its parent if that is right, else turned."""
        part, sign = _part(ours)
        if ours not in self.bones:
            return follow
        local = quat_rotate(quat_conjugate(self.start[joint]), vector_normalize(self.bones[ours]))
        alone = ours in self.rigid or part.endswith(_PHALANGES) or quat_angle(original, follow) > np.radians(_APART)
        for candidate in (follow,) if alone else (original, follow):
            limb = _LIMB if candidate is original else 0.0  # a bone that is turned anyway can be turned exactly
            if _fits(part, sign, quat_rotate(candidate, local), limb):
                if candidate is original:
                    self.originals.add(ours)
                return candidate
        target = _target(part, sign)
        return follow if target is None else quat_multiply(quat_between(quat_rotate(follow, local), target), follow)

    def _find_twists(self, world: Array) -> None:
        """Find the turns about their own axis that chest, arms and legs still need."""
        points = self.skeleton.forward(_local(self.skeleton, world), np.zeros(3))[0]

        def at(ours: str) -> Array:
            return points[self.skeleton.index[self.names[ours]]]

        top = next((n for n in ("upperChest", "chest", "spine") if n in self.names), None)
        pair = next((p for p in ("Shoulder", "UpperArm") if {f"left{p}", f"right{p}"} <= set(self.names)), None)
        if top and pair:
            self._twist(top, _Y, at(f"left{pair}") - at(f"right{pair}"), _X, [])
        for side, sign in (("left", 1.0), ("right", -1.0)):
            thumbs = [n for n in (f"{side}IndexProximal", f"{side}ThumbMetacarpal") if n in self.names]
            littles = [n for n in (f"{side}LittleProximal", f"{side}RingProximal", f"{side}Hand") if n in self.names]
            if len(thumbs) and len(littles) and {f"{side}LowerArm", f"{side}UpperArm"} <= set(self.names):
                across = at(thumbs[0 if littles[0] != f"{side}Hand" else -1]) - at(littles[0])
                bone = "LowerArm" if f"{side}UpperArm" in self.originals else "UpperArm"
                self._twist(side + bone, sign * _X, across, _Z, [f"{side}LowerArm", f"{side}Hand"])
            foot, leg = f"{side}Foot", f"{side}UpperLeg"
            if foot in self.bones and foot not in self.originals and leg not in self.originals:
                joint = self.skeleton.index[self.names[foot]]
                follow = quat_multiply(world[self.skeleton.parents[joint]], self.skeleton.rest[joint])
                local = quat_rotate(quat_conjugate(self.start[joint]), vector_normalize(self.bones[foot]))
                self._twist(leg, _Y, quat_rotate(follow, local), _Z, [f"{side}LowerLeg", foot])

    def _twist(self, ours: str, axis: Array, have: Array, want: Array, rigid: list[str]) -> None:
        """Note a turn of ``ours`` about ``axis`` that takes the direction ``have`` to ``want``, if it is large."""
        across = have - axis * (axis @ have)
        if np.linalg.norm(across) < max(
            1e-9, 0.3 * float(np.linalg.norm(have))
        ):  # 0.3, ours: a direction almost along the axis shows no turn
            return
        angle = float(np.arctan2(np.cross(across, want) @ axis, across @ want))
        if abs(angle) > np.radians(_TWIST):
            self.turns[ours] = axis_angle_to_quat(axis, angle)
            self.rigid |= set(rigid) - {ours}


def _local(skeleton: Skeleton, world: Array) -> Array:
    above = world[[max(p, 0) for p in skeleton.parents]]
    above[0] = (0, 0, 0, 1)
    return quat_multiply(quat_conjugate(above), world)


def _fits(part: str, sign: float, d: Array, limb: float) -> bool:
    """Whether the direction ``d`` of a bone is that of a T-pose. Bones of arms and legs may be off by ``limb`` degrees."""
    if part in _UP:
        return _angle(d, _Y) < _SPINE
    if part in ("UpperLeg", "LowerLeg"):
        return _angle(d, -_Y) <= limb
    if part == "Foot":
        return d[2] > 0 and abs(d[0]) < abs(d[2]) and -0.97 < d[1] < 0.5  # forward, level to 76° down
    if part == "Toes":
        return _angle(d, _Z) < _FOOT
    limit = {"UpperArm": limb, "LowerArm": limb, "Hand": _HAND, "Shoulder": _COLLAR}.get(part, _FINGER)
    return part.startswith("Thumb") or _angle(d, sign * _X) <= limit


def _target(part: str, sign: float) -> Array | None:
    """Direction of a bone in the T-pose."""
    if part in _UP:
        return _Y
    if part in ("UpperLeg", "LowerLeg"):
        return -_Y
    if part in ("Foot", "Toes"):
        return _FOOT_SLOPE / np.linalg.norm(_FOOT_SLOPE) if part == "Foot" else _Z
    return sign * _X


def _angle(a: Array, b: Array) -> float:
    """Degrees between unit vectors."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def _nearest_axis(v: Array) -> Array:
    axis = np.zeros(3)
    k = int(np.argmax(np.abs(v)))
    axis[k] = 1.0 if v[k] >= 0 else -1.0
    return axis
