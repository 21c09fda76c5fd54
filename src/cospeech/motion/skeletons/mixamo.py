"""Mixamo's 65 joints (``mixamorig:Hips`` …), with the proportions of our humanoid.

Names and tree as in the files that mixamo.com exports for its standard 65-bone skeleton. The fourth joint of each finger,
``HeadTop_End`` and ``Toe_End`` are tips. There is no jaw and there are no eyes.
"""

from .derived import Point, rows, tip

__all__ = ["ENDS", "JOINTS", "NAMES", "PREFIX"]

PREFIX = "mixamorig:"
_CENTRE = {"hips": "Hips", "spine": "Spine", "chest": "Spine1", "upperChest": "Spine2", "neck": "Neck", "head": "Head"}
_LIMBS = {
    "Shoulder": "Shoulder", "UpperArm": "Arm", "LowerArm": "ForeArm", "Hand": "Hand",
    "UpperLeg": "UpLeg", "LowerLeg": "Leg", "Foot": "Foot", "Toes": "ToeBase",
}  # fmt: skip
_FINGERS = {"Thumb": "Thumb", "Index": "Index", "Middle": "Middle", "Ring": "Ring", "Little": "Pinky"}
_THUMB = ("Metacarpal", "Proximal", "Distal")
_OTHERS = ("Proximal", "Intermediate", "Distal")


def _joints() -> list[tuple[str, str | None, str | Point]]:
    table: list[tuple[str, str | None, str | Point]] = []
    parent: str | None = None
    for ours, name in _CENTRE.items():
        table.append((PREFIX + name, parent, ours))
        parent = PREFIX + name
    table.append((PREFIX + "HeadTop_End", parent, tip("head")))
    for side in ("Left", "Right"):
        parent = PREFIX + "Spine2"
        for ours in ("Shoulder", "UpperArm", "LowerArm", "Hand"):
            table.append((PREFIX + side + _LIMBS[ours], parent, side.lower() + ours))
            parent = table[-1][0]
        for finger, name in _FINGERS.items():
            above = parent
            for k, part in enumerate(_THUMB if finger == "Thumb" else _OTHERS, 1):
                table.append((f"{PREFIX}{side}Hand{name}{k}", above, side.lower() + finger + part))
                above = table[-1][0]
            table.append((f"{PREFIX}{side}Hand{name}4", above, tip(f"{side.lower()}{finger}Distal")))
    for side in ("Left", "Right"):
        parent = PREFIX + "Hips"
        for ours in ("UpperLeg", "LowerLeg", "Foot", "Toes"):
            table.append((PREFIX + side + _LIMBS[ours], parent, side.lower() + ours))
            parent = table[-1][0]
        table.append((f"{PREFIX}{side}Toe_End", parent, tip(f"{side.lower()}Toes")))
    return table


_TABLE = _joints()
JOINTS = rows(_TABLE)
"""``(name, parent or None, offset in metres)`` of every joint, parents first."""

ENDS: dict[str, Point] = {}
"""None: the tips are joints here."""

NAMES = {where: name for name, _, where in _TABLE if isinstance(where, str)}
"""Our name → Mixamo's."""
