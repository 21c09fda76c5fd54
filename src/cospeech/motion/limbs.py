"""Arms and legs that a rig may lack: half bodies, busts, heads alone.

A rig lacks its legs if neither names nor shape suggest them: no joint has the name of a leg's joint, and the unexplained joints
form fewer than two long chains. Joints below the head, a hand or a limb with matches are explained, and so are helpers. The
same holds for arms. Legs whose names say nothing form two long chains. Then a map has to name them, or to say by ``""`` that
the chains, for example of a skirt, are no legs.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TypeVar

import numpy as np

from ..errors import CospeechWarning
from .bone_mapping_by_shape import TreeShape
from .joint_names import PARTS, JointName, JointTree
from .skeleton import Skeleton

__all__ = ["LIMBS", "drop_loose_ends", "find_absent_limbs", "lacks_limb", "may_have_limbs", "note_absent_limbs"]

T = TypeVar("T")

LIMBS = {
    "arms": ("leftUpperArm", "leftLowerArm", "rightUpperArm", "rightLowerArm"),
    "legs": ("leftUpperLeg", "leftLowerLeg", "rightUpperLeg", "rightLowerLeg"),
}
"""Joints without which arms, or legs, cannot be moved."""

_PARTS = {"arms": ("UpperArm", "LowerArm"), "legs": ("UpperLeg", "LowerLeg", "Foot", "Toes")}
_WITHIN = {
    "arms": ("upperarm", "uparm", "lowerarm", "lowarm", "forearm", "elbow"),
    "legs": ("leg", "thigh", "shin", "calf", "knee", "foot", "ankle", "toe"),
}  # ours: within a longer name these still mean the limb; "arm" does not, because of armour and armatures
_ENDS = {"Arm": ("Shoulder", "Hand", "Thumb", "Index", "Middle", "Ring", "Little"), "Leg": ("Foot", "Toes")}
_TRUNK = {"hips", "spine", "chest", "upperChest", "neck"}
_END_WORDS = {word for part in ("Hand", "Eye") for word in PARTS[part]} | {"jaw"}
_LONG = 0.2  # ours: part of the way from hips to head, or else of the longest chain; the thigh of a dwarf has it
_NOTES = {
    ("arms",): "has no arms: head, trunk and legs move",
    ("legs",): "has no legs: the lower body does not move",
    ("arms", "legs"): "has no arms and no legs: head and trunk move",
}


def lacks_limb(matches: Mapping[str, object], kind: str) -> bool:
    """Whether no joint of a kind of `LIMBS` has a match.

    Args:
        matches: our name → its match; ``""`` says that there is none.
        kind: arms or legs.
    """
    return all(matches.get(name, "") == "" for name in LIMBS[kind])


def find_absent_limbs(skeleton: Skeleton, matches: Mapping[str, str]) -> list[str]:
    """The kinds of `LIMBS` that a body lacks: no joint of them has a match, and neither names nor shape suggest them.

    Args:
        skeleton: theirs.
        matches: our name → their name; without hips and head, the result is empty.
    """
    absent = [kind for kind in LIMBS if lacks_limb(matches, kind)]
    if not absent or not (matches.get("hips") and matches.get("head")):
        return []
    tree = JointTree(skeleton)
    return [] if _has_unexplained_pair(tree, matches) else [kind for kind in absent if not _is_named(tree, kind)]


def may_have_limbs(skeleton: Skeleton, matches: Mapping[str, str]) -> bool:
    """Whether names or shape suggest arms or legs, with or without matches; ``matches``: our name → their name."""
    tree = JointTree(skeleton)
    return any(_is_named(tree, kind) for kind in LIMBS) or _has_unexplained_pair(tree, matches)


def drop_loose_ends(matches: Mapping[str, T]) -> dict[str, T]:
    """The matches without shoulders, hands, fingers and feet of limbs that are absent."""
    loose = tuple(
        side + end
        for side in ("left", "right")
        for limb, ends in _ENDS.items()
        for end in (*ends, f"Upper{limb}", f"Lower{limb}")
        if not {f"{side}Upper{limb}", f"{side}Lower{limb}"} <= {*matches}
    )
    return {ours: theirs for ours, theirs in matches.items() if not ours.startswith(loose)} if loose else dict(matches)


def note_absent_limbs(matches: Mapping[str, object], file: str) -> None:
    """Warn that arms or legs are absent and do not move.

    Args:
        matches: our name → its match in the file.
        file: name of the file in the message.
    """
    absent = tuple(kind for kind in LIMBS if lacks_limb(matches, kind))
    if absent:
        warnings.warn(f"{file} {_NOTES[absent]}", CospeechWarning, stacklevel=2)


def _is_named(tree: JointTree, kind: str) -> bool:
    """Whether a joint has a name of the limb. "Shoulder" does not count: it may be a collar bone."""
    words = {word for part in _PARTS[kind] for word in PARTS[part]} - {*PARTS["Shoulder"]}
    return any(
        (joint.side and joint.stem in words) or any(word in joint.stem for word in _WITHIN[kind])
        for joint in tree.joints
        if not joint.extra
    )


def _has_unexplained_pair(tree: JointTree, matches: Mapping[str, str]) -> bool:
    """Whether unexplained joints form two long chains, each of two joints or more, which might be limbs."""
    skeleton, body = tree.skeleton, TreeShape(tree.skeleton)
    joints = {ours: skeleton.index[theirs] for ours, theirs in matches.items() if theirs}
    on_the_way = {j for joint in joints.values() for j in tree.path(joint)}
    limb_joints = {joint for ours, joint in joints.items() if ours not in _TRUNK}
    both = {"hips", "head"} <= {*joints}
    size = float(np.linalg.norm(body.points[joints["head"]] - body.points[joints["hips"]])) if both else float(body.reach.max())
    spare: list[bool] = []
    chains = 0
    for joint, parent in enumerate(skeleton.parents):
        above = parent < 0 or spare[parent] or (parent in on_the_way and parent not in limb_joints)
        spare.append(above and joint not in on_the_way and not _is_explained(tree.joints[joint]))
        goes_on = parent >= 0 and spare[parent] and body.next[parent] == joint
        chains += spare[joint] and not goes_on and len(body.chain(joint)) > 1 and body.reach[joint] > _LONG * size
    return chains > 1


def _is_explained(joint: JointName) -> bool:
    return joint.extra or joint.stem in _END_WORDS
