"""Find our joints in any skeleton: by tables, by names, or by the shape of the tree.

Sides and parts are read from names of many makes (Mixamo, Rokoko, CMU, Biped, VRoid, Rigify, MakeHuman, Unreal, SMPL …).
The middle of the body follows from the tree, not from names: the hips are where legs and spine meet, the chest is where the
arms meet, and all joints between them are spine.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping
from importlib import import_module
from os import PathLike

from ..errors import CospeechWarning, InputError
from ..files import parse_toml, read_regular
from ..limits import BONE_MAP_BYTES
from .bone_map_checks import check_names, check_order, names_joints
from .bone_mapping_by_shape import by_shape
from .joint_names import PARTS, JointTree
from .limbs import LIMBS, drop_loose_ends, find_absent_limbs, note_absent_limbs
from .skeleton import Skeleton, humanoid
from .skeletons import SKELETONS

__all__ = ["REQUIRED", "by_names", "load_map", "names_joints", "recognise", "recognise_file"]

REQUIRED = ("hips", "head", *LIMBS["arms"], *LIMBS["legs"])
"""Joints without which retargeting makes no sense; limbs that the rig lacks do not count. [ours]"""
_TIPS = 1  # ours: number of joints below a hand or head that may be its tip, and neither a finger nor a part of a face

_FINGERS = {
    "Thumb": ("thumb",),
    "Index": ("index", "pointer", "point"),
    "Middle": ("middle", "mid"),
    "Little": ("little", "pinky", "pinkie", "small"),
    "Ring": ("ring",),
}
_PHALANGES = {"Thumb": ("Metacarpal", "Proximal", "Distal")}
_FINGER_ORDER = ("Thumb", "Index", "Middle", "Ring", "Little")  # of "finger1" … "finger5"


def recognise(skeleton: Skeleton, bone_map: Mapping[str, str] | None = None) -> dict[str, str]:
    """Find our joints in any skeleton.

    Args:
        skeleton: theirs, in its zero pose or better with its T-pose as ``rest``.
        bone_map: our name → their name. It overrides what is found; ``""`` means that there is no such joint.

    Returns:
        Our name → their name, for every joint that was found, in our order. A half body has no legs
        (`cospeech.motion.limbs` says when legs are absent).

    Raises:
        InputError: required joints were not found, or ``bone_map`` makes no sense.
    """
    return _find_joints(skeleton, bone_map, ("legs",))[0]


def recognise_file(
    skeleton: Skeleton,
    bone_map: Mapping[str, str] | None,
    file: str,
    unfit: Mapping[str, str] | None = None,
    *,
    may_lack: Collection[str] = ("legs",),
) -> dict[str, str]:
    """Find our joints in the skeleton of a file that has just been read; see `recognise`.

    Args:
        skeleton, bone_map: see `recognise`.
        file: name of the file in messages.
        unfit: a map that does not fit these joints; the error mentions it, because it may be the reason.
        may_lack: limbs that a body of this kind may lack, of `cospeech.motion.limbs.LIMBS`.

    Raises:
        InputError: see `recognise`; the message names the file.

    Warns:
        CospeechWarning: the joints were found by the shape of the tree alone, and some others may be fingers or parts of a
            face; or there are no arms or no legs. There is no note about limbs if the skeleton has a map from its file already.
    """
    try:
        matches, is_by_shape = _find_joints(skeleton, bone_map, may_lack)
    except InputError as error:
        raise InputError(f"{file}: {error.problem}", _explain_unfit(unfit, skeleton) or error.hint) from None
    if not skeleton.bone_map:
        note_absent_limbs(matches, file)
    parts = _find_unnamed_parts(skeleton, matches) if is_by_shape else []
    if parts:
        problem = f"{file}: the names of the joints say nothing, so the shape of the tree was used;"
        hint = "a map names them: --map of generate, convert and render; bone_map in Python"
        warnings.warn(f"{problem} {', '.join(parts)} were not found and will not move ({hint})", CospeechWarning, stacklevel=2)
    return matches


def _explain_unfit(bone_map: Mapping[str, str] | None, skeleton: Skeleton) -> str:
    """Why a map does not fit this skeleton; empty if there is no map."""
    try:
        check_names(bone_map or {}, skeleton.names)
    except InputError as error:
        return f"the map does not fit: {error.problem.removeprefix('bone map: ')}, {error.hint}"
    return ""


def _find_joints(
    skeleton: Skeleton, bone_map: Mapping[str, str] | None, may_lack: Collection[str]
) -> tuple[dict[str, str], bool]:
    """The result of `recognise`, and whether it comes from the shape of the tree."""
    choices = check_names(bone_map or {}, skeleton.names)
    file_map = skeleton.bone_map if names_joints(skeleton.bone_map, skeleton) else {}
    if file_map and not choices:
        return _in_our_order(file_map), False
    name_matches = dict(file_map) or by_names(skeleton, choices)
    matches, shape_matches, is_by_shape = _override(name_matches, choices), dict[str, str](), False
    absent = [name for kind in {*find_absent_limbs(skeleton, matches)} & {*may_lack} for name in LIMBS[kind]]
    missing = [name for name in _missing(matches) if name not in absent]
    if missing:
        shape_matches = by_shape(skeleton)
        is_by_shape = not _missing(alternative := _override(shape_matches, choices))
        matches, missing = (alternative, []) if is_by_shape else (matches, missing)
    for name, ours in ((name, ours) for name in missing if name not in choices for ours in choices):
        if choices[ours] and choices[ours] in (name_matches.get(name), shape_matches.get(name)):
            problem = f"bone map: {ours} = {choices[ours]!r} is the joint of {name}"
            raise InputError(problem, f"name the joint of {name} too, or another one for {ours}")
    if missing:
        none = ', or "" if there is none' if missing[0] not in REQUIRED[:2] else ""
        raise InputError(
            f"cannot find {', '.join(missing)} among the {len(skeleton)} joints ({', '.join(skeleton.names[:4])}, …)",
            f'name them in a file: --map file.toml with [bones] {missing[0]} = "their name"{none}',
        )
    matches = drop_loose_ends(_in_our_order(matches))
    check_order(matches, choices, skeleton)
    return matches, is_by_shape


def _in_our_order(matches: Mapping[str, str]) -> dict[str, str]:
    """The matches in the order of our joints, without those that are ``""``."""
    return {name: matches[name] for name in humanoid().names if matches.get(name)}


def _override(matches: Mapping[str, str], choices: Mapping[str, str]) -> dict[str, str]:
    """The choices of a map, and all matches for which the map names neither our joint nor theirs."""
    targets = {*choices.values()}
    return {ours: theirs for ours, theirs in matches.items() if theirs not in targets} | dict(choices)


def _missing(matches: Mapping[str, str]) -> list[str]:
    """Required joints that are not found. A map may say by ``""`` that a joint of a limb does not exist."""
    absent = {name for name in REQUIRED[2:] if matches.get(name) == ""}
    return [name for name in REQUIRED if not matches.get(name) and name not in absent]


def _find_unnamed_parts(skeleton: Skeleton, matches: Mapping[str, str]) -> list[str]:
    """Fingers, eyes and jaw that are not found, although there are joints that may be theirs."""
    our_names = {theirs: ours for ours, theirs in matches.items()}
    owners: list[str] = []  # of each joint, the joint of ours at or above it
    below = {"hand": 0, "head": 0}
    for name, parent in zip(skeleton.names, skeleton.parents, strict=True):
        owners.append(our_names.get(name) or (owners[parent] if parent >= 0 else ""))
        if name not in our_names:
            below["hand"] += owners[-1].endswith(("Hand", "LowerArm"))
            below["head"] += owners[-1] == "head"
    fingers = not any("Proximal" in name for name in matches) and below["hand"] > 2 * _TIPS
    face = not {"leftEye", "rightEye", "jaw"} & {*matches} and below["head"] > _TIPS
    return ["fingers"] * fingers + ["eyes", "jaw"] * face


def load_map(path: str | PathLike[str]) -> dict[str, str]:
    """Read a bone map: TOML with a table ``[bones]`` of ``ourName = "their name"``; ``""`` if they have no such joint.

    Raises:
        InputError: the file cannot be read, is not TOML, or does not hold this table.
    """
    name = repr(str(path))
    table = parse_toml(read_regular(path, "a bone map", BONE_MAP_BYTES), name, "see `--map` in the docs").get("bones")
    if not isinstance(table, dict) or not all(isinstance(value, str) for value in table.values()):
        raise InputError(f"{name} holds no table of names", '[bones] leftUpperArm = "their name"')
    return table


def by_names(skeleton: Skeleton, choices: Mapping[str, str] | None = None) -> dict[str, str]:
    """Our name → their name, from names, from the ``choices`` of a map, and from the tree between them; may be empty."""
    for module in SKELETONS.values():
        table: dict[str, str] = import_module(module).NAMES
        if all(name in skeleton.index for name in table.values()):
            return dict(table)
    tree = JointTree(skeleton)
    matches: dict[str, int] = {}
    indices = {ours: skeleton.index[theirs] for ours, theirs in (choices or {}).items() if theirs}
    for side in ("left", "right"):
        matches |= _limb(tree, side, "UpperArm", "LowerArm", "Hand", indices)
        matches |= _limb(tree, side, "UpperLeg", "LowerLeg", "Foot", indices)
        matches |= indices
        if f"{side}UpperArm" in matches:
            collar = [j for j in tree.find(side, "Shoulder") if tree.above(j, matches[f"{side}UpperArm"])]
            matches |= {f"{side}Shoulder": collar[0]} if collar else {}
        if f"{side}Foot" in matches:
            matches |= _toes(tree, side, matches[f"{side}Foot"])
        if f"{side}Hand" in matches:
            matches |= _fingers(tree, side, matches[f"{side}Hand"])
    matches |= _middle(tree, matches)
    eyes = {side: tree.find(side, "Eye") for side in ("left", "right")}
    matches |= {f"{side}Eye": joints[0] for side, joints in eyes.items() if joints}
    jaws = [j for j in tree.joints if j.side is None and not j.extra and j.stem in ("jaw", "lowerjaw", "facejaw")]
    matches |= {"jaw": min(jaws, key=lambda j: j.rank).index} if jaws else {}
    return {ours: skeleton.names[joint] for ours, joint in matches.items()}


def _limb(tree: JointTree, side: str, upper: str, lower: str, tail: str, indices: Mapping[str, int]) -> dict[str, int]:
    """Upper and lower bone, one below the other, and hand or foot below them."""
    uppers, lowers = ([indices[side + p]] if side + p in indices else tree.find(side, p) for p in (upper, lower))
    pairs = [(a, b) for b in lowers for a in uppers if tree.above(a, b)]
    if not pairs:  # return one of them alone, so that an error does not call it missing
        alone = [j for j in uppers if j not in lowers and tree.joints[j].stem not in PARTS["Shoulder"]]
        return {side + upper: alone[0]} if alone else {side + lower: lowers[0]} if lowers else {}
    a, b = pairs[0]
    below = sorted(
        (j for j in tree.find(side, tail) if tree.above(b, j)), key=lambda j: (len(tree.path(j)), tree.joints[j].rank)
    )
    return {side + upper: a, side + lower: b} | ({side + tail: below[0]} if below else {})


def _toes(tree: JointTree, side: str, foot: int) -> dict[str, int]:
    below = sorted((j for j in tree.find(side, "Toes") if tree.above(foot, j)), key=lambda j: len(tree.path(j)))
    toes = [j for j in below if tree.joints[j].stem != "forefoot"] or below
    if not toes or any(not tree.above(toes[0], j) for j in toes[1:]):  # five single toes are not ours
        return {}
    return {f"{side}Toes": toes[0]}


def _middle(tree: JointTree, matches: Mapping[str, int]) -> dict[str, int]:
    """Hips, spine, neck and head, from where the limbs meet. Without legs, the hips are found by name, or are the root."""
    arms, legs = (
        [matches[side + part] for side in ("left", "right") if side + part in matches] for part in ("UpperArm", "UpperLeg")
    )
    heads = [j for j in tree.joints if j.side is None and not j.extra and j.stem in ("head", "skull", "cranium")]
    heads = sorted(heads, key=lambda j: j.rank)
    chest = _chest(tree, arms, [j.index for j in heads])
    hips = None if chest is None else tree.meeting(chest, *legs) if legs else _hips_by_name(tree, chest, 0 if arms else None)
    if chest is None or hips is None:  # no body
        if not heads:
            return {}
        necks = [j for j in tree.path(heads[0].index)[:-1] if "neck" in tree.joints[j].stem]
        return dict(zip(("neck",), necks, strict=False)) | {"head": heads[0].index}
    heads = [j for j in heads if tree.above(hips, j.index)]
    head = heads[0].index if heads else _topmost(tree, chest)
    spine = [j for j in tree.path(chest) if tree.above(hips, j)]
    neck: list[int] = []
    while spine and "neck" in tree.joints[spine[-1]].stem:  # shoulders that hang on the neck
        neck.insert(0, spine.pop())
    if head is not None:
        neck += [j for j in tree.path(head) if tree.above(chest, j) and j != head]
    result = {"hips": hips} | dict(zip(("spine", "chest", "upperChest"), spine, strict=False))
    if len(spine) > 3:
        result |= {"chest": spine[(len(spine) - 1) // 2], "upperChest": spine[-1]}
    candidates = [j for j in neck if "neck" in tree.joints[j].stem] or neck
    return result | ({"neck": candidates[0]} if candidates else {}) | ({} if head is None else {"head": head})


def _chest(tree: JointTree, arms: list[int], heads: list[int]) -> int | None:
    """The joint where the arms meet; without arms, the joint that carries the neck."""
    if len(arms) == 2:
        return tree.meeting(*arms)
    if not heads:
        return None
    if arms:
        return tree.meeting(*arms, heads[0])
    return next((j for j in reversed(tree.path(heads[0])[:-1]) if "neck" not in tree.joints[j].stem), None)


def _hips_by_name(tree: JointTree, chest: int, otherwise: int | None) -> int | None:
    """The joint at or above the chest with the name of hips."""
    on_the_way = [tree.joints[j] for j in tree.path(chest)]
    return next((j.index for j in on_the_way if j.side is None and j.stem in ("hips", "hip", "pelvis")), otherwise)


def _topmost(tree: JointTree, chest: int) -> int | None:
    """The head if no joint has its name: the last joint of spine or neck above the chest (Rigify)."""
    stems = {"spine", "neck", tree.joints[chest].stem}
    above = [j.index for j in tree.joints if j.side is None and not j.extra and j.stem in stems and tree.above(chest, j.index)]
    return max(above, key=lambda j: len(tree.path(j)), default=None)


def _fingers(tree: JointTree, side: str, hand: int) -> dict[str, int]:
    """Three joints of each finger, without bones inside the palm and tips."""
    below = [j for j in tree.joints if tree.above(hand, j.index) and not j.extra]
    numbers = sorted({j.digits[0][0] for j in below if j.stem == "finger" and j.digits})
    matches: dict[str, int] = {}
    for finger, words in _FINGERS.items():
        chain = [j for j in below if any(w in j.stem.replace("finger", "") for w in words)]
        order = _FINGER_ORDER.index(finger)
        if not chain and order < len(numbers):
            chain = [j for j in below if j.stem == "finger" and j.digits and j.digits[0][0] == numbers[order]]
        chain = [j for j in chain if not j.helper] or chain
        chain = sorted(chain, key=lambda j: len(tree.path(j.index)))
        chain = [j for k, j in enumerate(chain) if all(tree.above(i.index, j.index) for i in chain[:k])]
        phalanges = [j for j in chain if j.digits and j.digits[-1].lstrip("0") in ("1", "2", "3")]
        if len(phalanges) == 3:
            chain = phalanges
        elif finger != "Thumb":
            chain = [j for j in chain if "meta" not in j.stem]
            chain = chain[1:] if len(chain) > 3 else chain
        parts = _PHALANGES.get(finger, ("Proximal", "Intermediate", "Distal"))
        matches |= {f"{side}{finger}{part}": j.index for part, j in zip(parts, chain, strict=False)}
    return matches
