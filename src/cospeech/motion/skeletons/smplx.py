"""SMPL-X's 55 joints in its own order (Pavlakos et al. 2019; ``joint_names`` of the ``smplx`` package).

Names, order and parents are the model's. Its mean joint positions belong to the model file, which may not be passed on,
so the offsets are those of our humanoid: directions carry over, lengths differ by some centimetres from the neutral body.
"""

from .derived import rows
from .humanoid import ENDS as OUR_ENDS

__all__ = ["ENDS", "JOINTS", "NAMES"]

_BODY: list[tuple[str, str | None, str]] = [
    # SMPL-X, parent, ours
    ("pelvis", None, "hips"),
    ("left_hip", "pelvis", "leftUpperLeg"), ("right_hip", "pelvis", "rightUpperLeg"), ("spine1", "pelvis", "spine"),
    ("left_knee", "left_hip", "leftLowerLeg"), ("right_knee", "right_hip", "rightLowerLeg"), ("spine2", "spine1", "chest"),
    ("left_ankle", "left_knee", "leftFoot"), ("right_ankle", "right_knee", "rightFoot"), ("spine3", "spine2", "upperChest"),
    ("left_foot", "left_ankle", "leftToes"), ("right_foot", "right_ankle", "rightToes"), ("neck", "spine3", "neck"),
    ("left_collar", "spine3", "leftShoulder"), ("right_collar", "spine3", "rightShoulder"), ("head", "neck", "head"),
    ("left_shoulder", "left_collar", "leftUpperArm"), ("right_shoulder", "right_collar", "rightUpperArm"),
    ("left_elbow", "left_shoulder", "leftLowerArm"), ("right_elbow", "right_shoulder", "rightLowerArm"),
    ("left_wrist", "left_elbow", "leftHand"), ("right_wrist", "right_elbow", "rightHand"),
    ("jaw", "head", "jaw"), ("left_eye_smplhf", "head", "leftEye"), ("right_eye_smplhf", "head", "rightEye"),
]  # fmt: skip
_PARTS = ("Proximal", "Intermediate", "Distal")
_THUMB = ("Metacarpal", "Proximal", "Distal")
_FINGERS = {"index": "Index", "middle": "Middle", "pinky": "Little", "ring": "Ring", "thumb": "Thumb"}
_HANDS: list[tuple[str, str | None, str]] = [
    (f"{side}_{finger}{k}", f"{side}_{finger}{k - 1}" if k > 1 else f"{side}_wrist", f"{side}{ours}{part}")
    for side in ("left", "right")
    for finger, ours in _FINGERS.items()
    for k, part in enumerate(_THUMB if finger == "thumb" else _PARTS, 1)
]

JOINTS = rows(_BODY + _HANDS)
"""``(name, parent or None, offset in metres)`` of every joint, in SMPL-X's order."""

NAMES = {ours: name for name, _, ours in _BODY + _HANDS}
"""Our name → SMPL-X's: all 55, one to one."""

ENDS = {NAMES[ours]: tip for ours, tip in OUR_ENDS.items()}
"""Tips of the leaf bones, from their joint."""
