"""Unreal Engine 5's Manny and Quinn, without twist, IK and correction bones, with the proportions of our humanoid.

Names and tree as in ``SK_Mannequin`` of UE 5 (five spine bones, two neck bones, metacarpals). Its ``root`` on the floor is
left out: a `cospeech.Motion` moves its first joint, and Unreal's retargeter expects that of the pelvis.
"""

from .derived import Point, between, rows
from .humanoid import ENDS as OUR_ENDS

__all__ = ["ENDS", "JOINTS", "NAMES"]

_METACARPAL = 0.3  # ours: how far from wrist to knuckle the metacarpal bone starts
_CENTRE: list[tuple[str, str | None, str | Point]] = [
    ("pelvis", None, "hips"),
    ("spine_01", "pelvis", "spine"),
    ("spine_02", "spine_01", between("spine", "chest", 0.5)),
    ("spine_03", "spine_02", "chest"),
    ("spine_04", "spine_03", between("chest", "upperChest", 0.5)),
    ("spine_05", "spine_04", "upperChest"),
    ("neck_01", "spine_05", "neck"),
    ("neck_02", "neck_01", between("neck", "head", 0.5)),
    ("head", "neck_02", "head"),
]
_LIMBS = [
    ("clavicle", "spine_05", "Shoulder"), ("upperarm", "clavicle", "UpperArm"), ("lowerarm", "upperarm", "LowerArm"),
    ("hand", "lowerarm", "Hand"),
    ("thigh", "pelvis", "UpperLeg"), ("calf", "thigh", "LowerLeg"), ("foot", "calf", "Foot"), ("ball", "foot", "Toes"),
]  # fmt: skip
_FINGERS = {"thumb": "Thumb", "index": "Index", "middle": "Middle", "ring": "Ring", "pinky": "Little"}


def _side(side: str, mark: str) -> list[tuple[str, str | None, str | Point]]:
    centre = {"spine_05", "pelvis"}
    table: list[tuple[str, str | None, str | Point]] = [
        (name + mark, parent if parent in centre else parent + mark, side + ours) for name, parent, ours in _LIMBS
    ]
    for finger, ours in _FINGERS.items():
        parent = "hand" + mark
        if finger != "thumb":
            table.append((f"{finger}_metacarpal{mark}", parent, between(f"{side}Hand", f"{side}{ours}Proximal", _METACARPAL)))
            parent = table[-1][0]
        parts = ("Metacarpal", "Proximal", "Distal") if finger == "thumb" else ("Proximal", "Intermediate", "Distal")
        for k, part in enumerate(parts, 1):
            table.append((f"{finger}_0{k}{mark}", parent, side + ours + part))
            parent = table[-1][0]
    return table


_TABLE = _CENTRE + _side("left", "_l") + _side("right", "_r")
JOINTS = rows(_TABLE)
"""``(name, parent or None, offset in metres)`` of every joint, parents first."""

NAMES = {where: name for name, _, where in _TABLE if isinstance(where, str)}
"""Our name → Unreal's; Manny has neither jaw nor eyes among these bones."""

ENDS = {NAMES[ours]: tip for ours, tip in OUR_ENDS.items() if ours in NAMES}
"""Tips of the leaf bones, from their joint."""
