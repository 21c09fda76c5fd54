"""VRM 1.0's humanoid (``VRMC_vrm-1.0``, "humanoid"), whose names we use. VRM 0.x has other names for the thumb's bones."""

from .humanoid import ENDS, JOINTS

__all__ = ["ENDS", "FROM_VRM0", "JOINTS", "NAMES", "REQUIRED"]

NAMES = {name: name for name, _, _ in JOINTS}
"""Our name → VRM 1.0's: the same."""

REQUIRED = (
    "hips", "spine", "head",
    "leftUpperLeg", "leftLowerLeg", "leftFoot", "rightUpperLeg", "rightLowerLeg", "rightFoot",
    "leftUpperArm", "leftLowerArm", "leftHand", "rightUpperArm", "rightLowerArm", "rightHand",
)  # fmt: skip
"""The bones that every VRM has (VRM 1.0, "List of Humanoid Bones")."""

FROM_VRM0 = {
    f"{side}Thumb{old}": f"{side}Thumb{new}"
    for side in ("left", "right")
    for old, new in (("Proximal", "Metacarpal"), ("Intermediate", "Proximal"), ("Distal", "Distal"))
}
"""VRM 0.x's (Unity's) thumb bones → VRM 1.0's; every other bone has one name in both."""
