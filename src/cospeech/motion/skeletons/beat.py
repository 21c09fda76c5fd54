"""BEAT's 75 joints (Liu et al. 2022), as in the BVH files of speaker 2.

Names, order, parents and offsets are read off the published files, rounded to 0.01 mm; the zero pose is a T-pose. Hips have
no offset there; the height below puts the toes' joints on the floor. Fingers have four joints, of which the last is near the
tip, and the index and ring fingers carry a bone inside the palm from which thumb and little finger branch.
"""

__all__ = ["ENDS", "JOINTS", "NAMES"]

JOINTS = [
    ("Hips", None, (0.0, 0.88554, 0.0)),
    ("Spine", "Hips", (0.0, 0.0627, -0.02265)),
    ("Spine1", "Spine", (0.0, 0.12479, -0.022)),
    ("Spine2", "Spine1", (0.0, 0.12623, -0.01104)),
    ("Spine3", "Spine2", (0.0, 0.12671, 0.0)),
    ("Neck", "Spine3", (0.0, 0.16291, 0.01629)),
    ("Neck1", "Neck", (0.0, 0.03457, 0.00302)),
    ("Head", "Neck1", (0.0, 0.03417, 0.00603)),
    ("HeadEnd", "Head", (0.0, 0.09728, 0.0)),
    ("RightShoulder", "Spine3", (0.0, 0.11637, 0.05879)),
    ("RightArm", "RightShoulder", (-0.19553, 0.0, 0.0)),
    ("RightForeArm", "RightArm", (-0.30624, 0.0, 0.0)),
    ("RightHand", "RightForeArm", (-0.25458, 0.0, 0.0)),
    ("RightHandMiddle1", "RightHand", (-0.09328, 0.0, 0.0)),
    ("RightHandMiddle2", "RightHandMiddle1", (-0.04931, 0.0, 0.0)),
    ("RightHandMiddle3", "RightHandMiddle2", (-0.03177, 0.0, 0.0)),
    ("RightHandMiddle4", "RightHandMiddle3", (-0.01928, 0.0, 0.0)),
    ("RightHandRing", "RightHand", (-0.0025, -0.0025, -0.00856)),
    ("RightHandRing1", "RightHandRing", (-0.08229, 0.0, -0.00743)),
    ("RightHandRing2", "RightHandRing1", (-0.04579, 0.0, -0.00413)),
    ("RightHandRing3", "RightHandRing2", (-0.0309, 0.0, -0.00279)),
    ("RightHandRing4", "RightHandRing3", (-0.01909, 0.0, -0.00172)),
    ("RightHandPinky", "RightHandRing", (-0.00172, -0.0025, -0.00875)),
    ("RightHandPinky1", "RightHandPinky", (-0.06813, 0.0, -0.01523)),
    ("RightHandPinky2", "RightHandPinky1", (-0.03617, 0.0, -0.00809)),
    ("RightHandPinky3", "RightHandPinky2", (-0.02312, 0.0, -0.00517)),
    ("RightHandPinky4", "RightHandPinky3", (-0.01726, 0.0, -0.00386)),
    ("RightHandIndex", "RightHand", (-0.0025, -0.0025, 0.00856)),
    ("RightHandIndex1", "RightHandIndex", (-0.09013, 0.0, 0.00813)),
    ("RightHandIndex2", "RightHandIndex1", (-0.04738, 0.0, 0.00428)),
    ("RightHandIndex3", "RightHandIndex2", (-0.02835, 0.0, 0.00256)),
    ("RightHandIndex4", "RightHandIndex3", (-0.01746, 0.0, 0.00158)),
    ("RightHandThumb1", "RightHandIndex", (-0.00172, -0.0075, 0.00875)),
    ("RightHandThumb2", "RightHandThumb1", (-0.05476, 0.00845, 0.02271)),
    ("RightHandThumb3", "RightHandThumb2", (-0.03583, 0.00553, 0.01486)),
    ("RightHandThumb4", "RightHandThumb3", (-0.02195, 0.00339, 0.00911)),
    ("LeftShoulder", "Spine3", (0.0, 0.11637, 0.05879)),
    ("LeftArm", "LeftShoulder", (0.19553, 0.0, 0.0)),
    ("LeftForeArm", "LeftArm", (0.30624, 0.0, 0.0)),
    ("LeftHand", "LeftForeArm", (0.25458, 0.0, 0.0)),
    ("LeftHandMiddle1", "LeftHand", (0.09327, 0.0, 0.0)),
    ("LeftHandMiddle2", "LeftHandMiddle1", (0.04936, 0.0, 0.0)),
    ("LeftHandMiddle3", "LeftHandMiddle2", (0.03187, 0.0, 0.0)),
    ("LeftHandMiddle4", "LeftHandMiddle3", (0.01919, 0.0, 0.0)),
    ("LeftHandRing", "LeftHand", (0.0025, -0.0025, -0.00912)),
    ("LeftHandRing1", "LeftHandRing", (0.08228, 0.0, -0.00743)),
    ("LeftHandRing2", "LeftHandRing1", (0.04571, 0.0, -0.00412)),
    ("LeftHandRing3", "LeftHandRing2", (0.03098, 0.0, -0.0028)),
    ("LeftHandRing4", "LeftHandRing3", (0.019, 0.0, -0.00171)),
    ("LeftHandPinky", "LeftHandRing", (0.00167, -0.0025, -0.00931)),
    ("LeftHandPinky1", "LeftHandPinky", (0.06795, 0.0, -0.01519)),
    ("LeftHandPinky2", "LeftHandPinky1", (0.03623, 0.0, -0.0081)),
    ("LeftHandPinky3", "LeftHandPinky2", (0.02307, 0.0, -0.00516)),
    ("LeftHandPinky4", "LeftHandPinky3", (0.01718, 0.0, -0.00384)),
    ("LeftHandIndex", "LeftHand", (0.0025, -0.0025, 0.00912)),
    ("LeftHandIndex1", "LeftHandIndex", (0.08998, 0.0, 0.00812)),
    ("LeftHandIndex2", "LeftHandIndex1", (0.04745, 0.0, 0.00428)),
    ("LeftHandIndex3", "LeftHandIndex2", (0.02836, 0.0, 0.00256)),
    ("LeftHandIndex4", "LeftHandIndex3", (0.01738, 0.0, 0.00157)),
    ("LeftHandThumb1", "LeftHandIndex", (0.00167, -0.0075, 0.00931)),
    ("LeftHandThumb2", "LeftHandThumb1", (0.05435, 0.00839, 0.02254)),
    ("LeftHandThumb3", "LeftHandThumb2", (0.03593, 0.00555, 0.0149)),
    ("LeftHandThumb4", "LeftHandThumb3", (0.02185, 0.00337, 0.00907)),
    ("RightUpLeg", "Hips", (-0.08247, 0.0, 0.0)),
    ("RightLeg", "RightUpLeg", (0.0, -0.42828, 0.0)),
    ("RightFoot", "RightLeg", (0.0, -0.43166, 0.0)),
    ("RightForeFoot", "RightFoot", (0.0, -0.0256, 0.0)),
    ("RightToeBase", "RightForeFoot", (0.0, 0.0, 0.10025)),
    ("RightToeBaseEnd", "RightToeBase", (0.0, 0.0, 0.1475)),
    ("LeftUpLeg", "Hips", (0.08247, 0.0, 0.0)),
    ("LeftLeg", "LeftUpLeg", (0.0, -0.42828, 0.0)),
    ("LeftFoot", "LeftLeg", (0.0, -0.43166, 0.0)),
    ("LeftForeFoot", "LeftFoot", (0.0, -0.0256, 0.0)),
    ("LeftToeBase", "LeftForeFoot", (0.0, 0.0, 0.10025)),
    ("LeftToeBaseEnd", "LeftToeBase", (0.0, 0.0, 0.14331)),
]  # fmt: skip
"""``(name, parent or None, offset in metres)`` of every joint, parents first."""

ENDS = {
    "HeadEnd": (0.0, 0.09728, 0.0),
    "RightHandMiddle4": (-0.01928, 0.0, 0.0),
    "RightHandRing4": (-0.01909, 0.0, -0.00172),
    "RightHandPinky4": (-0.01726, 0.0, -0.00386),
    "RightHandIndex4": (-0.01746, 0.0, 0.00158),
    "RightHandThumb4": (-0.02195, 0.00339, 0.00911),
    "LeftHandMiddle4": (0.01919, 0.0, 0.0),
    "LeftHandRing4": (0.019, 0.0, -0.00171),
    "LeftHandPinky4": (0.01718, 0.0, -0.00384),
    "LeftHandIndex4": (0.01738, 0.0, 0.00157),
    "LeftHandThumb4": (0.02186, 0.00337, 0.00907),
    "RightToeBaseEnd": (0.0, 0.0, 0.1475),
    "LeftToeBaseEnd": (0.0, 0.0, 0.14331),
}
"""Tips of the leaf bones, from their joint."""

_BODY = {
    "hips": "Hips", "spine": "Spine", "chest": "Spine1", "upperChest": "Spine3", "neck": "Neck", "head": "Head",
}  # fmt: skip
_LIMBS = {
    "Shoulder": "Shoulder", "UpperArm": "Arm", "LowerArm": "ForeArm", "Hand": "Hand",
    "UpperLeg": "UpLeg", "LowerLeg": "Leg", "Foot": "Foot", "Toes": "ToeBase",
}  # fmt: skip
_FINGERS = {"Thumb": "Thumb", "Index": "Index", "Middle": "Middle", "Ring": "Ring", "Little": "Pinky"}

NAMES = (
    _BODY
    | {side.lower() + ours: side + theirs for side in ("Left", "Right") for ours, theirs in _LIMBS.items()}
    | {
        f"{side.lower()}{finger}{part}": f"{side}Hand{name}{k}"
        for side in ("Left", "Right")
        for finger, name in _FINGERS.items()
        for k, part in enumerate(
            ("Metacarpal", "Proximal", "Distal") if finger == "Thumb" else ("Proximal", "Intermediate", "Distal"), 1
        )
    }
)
"""Our name → BEAT's; there are neither jaw nor eyes."""
