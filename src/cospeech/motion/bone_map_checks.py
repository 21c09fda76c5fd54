"""Whether a bone map makes sense: its names are there, no joint stands for two of ours, limbs go down from joint to joint."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import get_close_matches

from ..errors import InputError
from .skeleton import Skeleton, humanoid

__all__ = ["check_fit", "check_names", "check_order", "names_joints"]

_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")
_BELOW = ("LowerArm", "Hand", "LowerLeg", "Foot", "Toes", *_FINGERS)  # ours: what hangs below another joint of its limb


def names_joints(bone_map: Mapping[str, str], joints: Skeleton | Collection[str]) -> bool:
    """Whether a map is of these joints: those of a skeleton, or names."""
    names = joints.names if isinstance(joints, Skeleton) else joints
    return all(theirs in ("", *names) for theirs in bone_map.values())


def check_names(bone_map: Mapping[str, str], joints: Collection[str]) -> dict[str, str]:
    """The map, whose names are ours on the left and theirs on the right, each once.

    Raises:
        InputError: they are not.
    """
    for ours, theirs in bone_map.items():
        for what, name, known in (("our", ours, humanoid().names), ("their", theirs, ("", *joints))):
            if name not in known:
                near = get_close_matches(str(name), known, 1)
                hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(list(filter(None, known))[:5])}, …"
                raise InputError(f"bone map: {name!r} is none of {what} joints", hint)
    first: dict[str, str] = {}
    for ours, theirs in bone_map.items():
        if theirs and first.setdefault(theirs, ours) != ours:
            problem = f"bone map: {first[theirs]} and {ours} are both {theirs!r}"
            raise InputError(problem, 'one joint is one of ours; "" says that there is none')
    return dict(bone_map)


def check_fit(bone_map: Mapping[str, str], files: Mapping[str, Collection[str]]) -> None:
    """A map is of the joints of at least one file.

    Args:
        bone_map: our name → their name.
        files: name of a file → names of its joints.

    Raises:
        InputError: it is of none; the message is about the file of which it names the most joints.
    """
    if files and not any(names_joints(bone_map, joints) for joints in files.values()):
        nearest = max(files, key=lambda file: len({*bone_map.values()} & {*files[file]}))
        try:
            check_names(bone_map, files[nearest])
        except InputError as error:
            raise InputError(f"{nearest}: {error.problem}", error.hint) from None


def check_order(found: Mapping[str, str], chosen: Mapping[str, str], skeleton: Skeleton) -> None:
    """Where a map has chosen joints of a limb or finger, each is below the one before it.

    Args:
        found: our name → their name, of all joints.
        chosen: those that a map has chosen.
        skeleton: theirs.

    Raises:
        InputError: one is not.
    """
    ours = humanoid()
    for name in found:
        if not any(part in name for part in _BELOW):
            continue
        above = _above(name, found)
        if above not in found or not {name, above} & {*chosen}:
            continue
        joint, upper = skeleton.index[found[name]], skeleton.index[found[above]]
        while joint >= 0 and joint != upper:
            joint = skeleton.parents[joint]
        if joint < 0 or found[name] == found[above]:
            problem = f"bone map: {name} = {found[name]!r} is not below {above} = {found[above]!r}"
            raise InputError(problem, f"{ours.names[ours.parents[ours.index[name]]]} → {name} goes down the tree of the rig")


def _above(name: str, found: Mapping[str, str]) -> str:
    """The next joint of ours above ``name`` that is found; for fingers this is no hand: some rigs have them beside it."""
    ours = humanoid()
    finger = any(part in name for part in _FINGERS)
    joint = ours.parents[ours.index[name]]
    while joint > 0 and (ours.names[joint] not in found or (finger and ours.names[joint].endswith("Hand"))):
        joint = ours.parents[joint]
    return ours.names[joint]
