"""Checks of a bone map: its names exist, no joint is two of ours, and the joints of a limb lie below each other."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import get_close_matches

from ..errors import InputError
from .skeleton import Skeleton, humanoid

__all__ = ["check_fit", "check_names", "check_order", "names_joints"]

_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")
_BELOW = ("LowerArm", "Hand", "LowerLeg", "Foot", "Toes", *_FINGERS)  # ours: parts that lie below another joint of a limb


def names_joints(bone_map: Mapping[str, str], joints: Skeleton | Collection[str]) -> bool:
    """Whether a map names these joints: the joints of a skeleton, or a collection of names."""
    names = joints.names if isinstance(joints, Skeleton) else joints
    return all(theirs in ("", *names) for theirs in bone_map.values())


def check_names(bone_map: Mapping[str, str], joints: Collection[str]) -> dict[str, str]:
    """Check that a map has our names on the left and theirs on the right, each once, and return it.

    Raises:
        InputError: a name is unknown, or stands there twice.
    """
    for ours, theirs in bone_map.items():
        for what, name, names in (("our", ours, humanoid().names), ("their", theirs, ("", *joints))):
            if name not in names:
                near = get_close_matches(str(name), names, 1)
                hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(list(filter(None, names))[:5])}, …"
                raise InputError(f"bone map: {name!r} is none of {what} joints", hint)
    first: dict[str, str] = {}
    for ours, theirs in bone_map.items():
        if theirs and first.setdefault(theirs, ours) != ours:
            problem = f"bone map: {first[theirs]} and {ours} are both {theirs!r}"
            raise InputError(problem, 'one joint is one of ours; "" says that there is none')
    return dict(bone_map)


def check_fit(bone_map: Mapping[str, str], files: Mapping[str, Collection[str]]) -> None:
    """Check that a map names joints of at least one file.

    Args:
        bone_map: our name → their name.
        files: name of a file → names of its joints.

    Raises:
        InputError: it fits no file; the message is about the file of which it names the most joints.
    """
    if files and not any(names_joints(bone_map, joints) for joints in files.values()):
        nearest = max(files, key=lambda file: len({*bone_map.values()} & {*files[file]}))
        try:
            check_names(bone_map, files[nearest])
        except InputError as error:
            raise InputError(f"{nearest}: {error.problem}", error.hint) from None


def check_order(matches: Mapping[str, str], choices: Mapping[str, str], skeleton: Skeleton) -> None:
    """Check that joints of a limb or finger that a map names lie below each other.

    Args:
        matches: our name → their name, of all joints.
        choices: our name → their name, of the joints that a map names.
        skeleton: theirs.

    Raises:
        InputError: a joint is not below the one before it.
    """
    ours = humanoid()
    for name in matches:
        if not any(part in name for part in _BELOW):
            continue
        above = _above(name, matches)
        if above not in matches or not {name, above} & {*choices}:
            continue
        joint, upper = skeleton.index[matches[name]], skeleton.index[matches[above]]
        while joint >= 0 and joint != upper:
            joint = skeleton.parents[joint]
        if joint < 0 or matches[name] == matches[above]:
            problem = f"bone map: {name} = {matches[name]!r} is not below {above} = {matches[above]!r}"
            raise InputError(problem, f"{ours.names[ours.parents[ours.index[name]]]} → {name} goes down the tree of the rig")


def _above(name: str, matches: Mapping[str, str]) -> str:
    """The next joint of ours above ``name`` with a match. For fingers, hands do not count: some rigs have both side by side."""
    ours = humanoid()
    is_finger = any(part in name for part in _FINGERS)
    joint = ours.parents[ours.index[name]]
    while joint > 0 and (ours.names[joint] not in matches or (is_finger and ours.names[joint].endswith("Hand"))):
        joint = ours.parents[joint]
    return ours.names[joint]
