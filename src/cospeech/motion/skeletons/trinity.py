"""Trinity Speech-Gesture's 57 joints (Ferstl & McDonnell 2018; also GENEA 2020), with the offsets of its BVH files.

Names, tree and offsets are facts of the published files, rounded to 0.01 mm; the zero pose is a T-pose. Hips stand where the
lowest joint is on the floor. ``pCube4`` is a helper of the rig that the exporter left in; nothing hangs on it.
"""

__all__ = ["ENDS", "FULL_BODY", "JOINTS", "NAMES", "UPPER_BODY"]

Point = tuple[float, float, float]

_TRUNK: list[tuple[str, str | None, Point]] = [
    ("Hips", None, (0.0, 0.90867, 0.0)),
    ("Spine", "Hips", (0.0, 0.13209, -0.01604)),
    ("Spine1", "Spine", (0.0, 0.08617, 0.0)),
    ("Spine2", "Spine1", (0.0, 0.08617, 0.0)),
    ("Spine3", "Spine2", (0.0, 0.08617, 0.0)),
    ("Neck", "Spine3", (0.0, 0.11079, 0.01108)),
    ("Neck1", "Neck", (0.0, 0.0708, 0.0)),
    ("Head", "Neck1", (0.0, 0.0708, 0.0)),
]
_ARM: list[tuple[str, str, Point]] = [  # of the left side; the right one has −x
    ("Shoulder", "Spine3", (0.0001, 0.07914, 0.05197)),
    ("Arm", "Shoulder", (0.18416, 0.0, 0.0)),
    ("ForeArm", "Arm", (0.29111, 0.0, 0.0)),
    ("Hand", "ForeArm", (0.2465, 0.0, 0.0)),
]
_FINGERS: list[tuple[str, Point, float, float]] = [  # first joint in the hand, then lengths of two bones
    ("Thumb", (0.05351, -0.00856, 0.03979), 0.04528, 0.0247),
    ("Index", (0.1427, 0.0, 0.02881), 0.05488, 0.03019),
    ("Middle", (0.1427, 0.0, -0.00091), 0.06174, 0.03567),
    ("Ring", (0.12692, 0.0, -0.03064), 0.05626, 0.03567),
    ("Pinky", (0.11114, 0.0, -0.06037), 0.04528, 0.0247),
]
_LEG: list[tuple[str, str, Point]] = [
    ("UpLeg", "Hips", (0.09984, 0.0, 0.0)),
    ("Leg", "UpLeg", (0.0, -0.42118, 0.0)),
    ("Foot", "Leg", (0.0, -0.45001, 0.0)),
    ("ForeFoot", "Foot", (0.0, -0.03748, 0.0)),
    ("ToeBase", "ForeFoot", (0.0, 0.00063, 0.14431)),
]


def _limb(side: str, rows: list[tuple[str, str, Point]]) -> list[tuple[str, str | None, Point]]:
    sign = 1.0 if side == "Left" else -1.0
    own = {name for name, _, _ in rows}
    return [(side + n, side + p if p in own else p, (sign * x, y, z)) for n, p, (x, y, z) in rows]


def _joints() -> list[tuple[str, str | None, Point]]:
    fingers = [
        (f"Hand{name}{k}", "Hand" if k == 1 else f"Hand{name}{k - 1}", (first, (second, 0.0, 0.0), (third, 0.0, 0.0))[k - 1])
        for name, first, second, third in _FINGERS
        for k in (1, 2, 3)
    ]
    arms = [row for side in ("Right", "Left") for row in _limb(side, [*_ARM, *fingers])]
    legs = [row for side in ("Right", "Left") for row in _limb(side, _LEG)]
    return [*_TRUNK, *arms, ("pCube4", "Spine3", (0.0, 0.10911, 0.01108)), *legs]


JOINTS = _joints()
"""``(name, parent or None, offset in metres)`` of every joint, parents first and depth first as in the files."""

ENDS: dict[str, Point] = {}
"""None: the files' End Sites are all zero."""

_CENTRE = {"hips": "Hips", "spine": "Spine", "chest": "Spine1", "upperChest": "Spine3", "neck": "Neck", "head": "Head"}
_LIMBS = {
    "Shoulder": "Shoulder", "UpperArm": "Arm", "LowerArm": "ForeArm", "Hand": "Hand",
    "UpperLeg": "UpLeg", "LowerLeg": "Leg", "Foot": "Foot", "Toes": "ToeBase",
}  # fmt: skip
_OURS = {"Thumb": "Thumb", "Index": "Index", "Middle": "Middle", "Ring": "Ring", "Pinky": "Little"}

NAMES = (
    _CENTRE
    | {side.lower() + ours: side + theirs for side in ("Left", "Right") for ours, theirs in _LIMBS.items()}
    | {
        f"{side.lower()}{_OURS[name]}{part}": f"{side}Hand{name}{k}"
        for side in ("Left", "Right")
        for name, _, _, _ in _FINGERS
        for k, part in enumerate(
            ("Metacarpal", "Proximal", "Distal") if name == "Thumb" else ("Proximal", "Intermediate", "Distal"), 1
        )
    }
)
"""Our name → Trinity's; there are neither jaw nor eyes."""

_ARMS = tuple(side + part for side in ("Right", "Left") for part in ("Shoulder", "Arm", "ForeArm", "Hand"))

UPPER_BODY = ("Spine", "Spine1", "Spine2", "Spine3", "Neck", "Neck1", "Head", *_ARMS)
"""The 15 joints of the 45 numbers of MoGlow's and Gesticulator's upper body, in their order (hips fixed)."""

FULL_BODY = (
    "Spine", "Spine1", "Neck", "Head", *_ARMS,
    *(side + part for side in ("Right", "Left") for part in ("UpLeg", "Leg", "Foot", "ToeBase")),
)  # fmt: skip
"""The 20 joints of the 69 numbers of the full body, in their order; the other 9 are the hips' place, turn and their changes."""
