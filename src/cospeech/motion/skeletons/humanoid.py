"""Our humanoid: the 55 bones of VRM 1.0's humanoid in a T-pose, with the proportions of a 1.72 m adult.

Metres, Y up, facing +Z, so that *left* is +X. All rest rotations are the identity, palms face down, thumbs lie at 45°
(VRM 1.0, "humanoid": T-pose). Segment lengths follow the proportions of Winter, *Biomechanics and Motor Control of
Human Movement* (2009), figure 4.1, rounded; finger lengths are ours, after published adult hand surveys.
"""

__all__ = ["ENDS", "HEIGHT", "JOINTS", "MIRROR", "NAMES"]

HEIGHT = 1.72  # metres, crown to sole; ours

_CENTRE = [
    # name, parent, offset from the parent in metres
    ("hips", None, (0.0, 0.955, 0.0)),
    ("spine", "hips", (0.0, 0.085, -0.005)),
    ("chest", "spine", (0.0, 0.115, -0.010)),
    ("upperChest", "chest", (0.0, 0.125, 0.000)),
    ("neck", "upperChest", (0.0, 0.155, 0.000)),
    ("head", "neck", (0.0, 0.090, 0.012)),
    ("jaw", "head", (0.0, 0.032, 0.018)),
]  # fmt: skip
_LEFT = [
    ("Eye", "head", (0.031, 0.082, 0.072)),
    ("Shoulder", "upperChest", (0.025, 0.105, 0.008)),
    ("UpperArm", "Shoulder", (0.150, -0.002, -0.018)),
    ("LowerArm", "UpperArm", (0.280, 0.0, 0.0)),
    ("Hand", "LowerArm", (0.255, 0.0, 0.0)),
    ("ThumbMetacarpal", "Hand", (0.020, -0.010, 0.024)),
    ("ThumbProximal", "ThumbMetacarpal", (0.031, -0.006, 0.031)),
    ("ThumbDistal", "ThumbProximal", (0.0235, -0.002, 0.0235)),
    ("IndexProximal", "Hand", (0.090, 0.000, 0.026)),
    ("IndexIntermediate", "IndexProximal", (0.042, 0.0, 0.0)),
    ("IndexDistal", "IndexIntermediate", (0.025, 0.0, 0.0)),
    ("MiddleProximal", "Hand", (0.092, 0.002, 0.004)),
    ("MiddleIntermediate", "MiddleProximal", (0.046, 0.0, 0.0)),
    ("MiddleDistal", "MiddleIntermediate", (0.029, 0.0, 0.0)),
    ("RingProximal", "Hand", (0.087, 0.000, -0.017)),
    ("RingIntermediate", "RingProximal", (0.042, 0.0, 0.0)),
    ("RingDistal", "RingIntermediate", (0.027, 0.0, 0.0)),
    ("LittleProximal", "Hand", (0.079, -0.004, -0.036)),
    ("LittleIntermediate", "LittleProximal", (0.033, 0.0, 0.0)),
    ("LittleDistal", "LittleIntermediate", (0.020, 0.0, 0.0)),
    ("UpperLeg", "hips", (0.092, -0.040, 0.0)),
    ("LowerLeg", "UpperLeg", (0.0, -0.420, 0.005)),
    ("Foot", "LowerLeg", (0.0, -0.410, -0.015)),
    ("Toes", "Foot", (0.0, -0.063, 0.125)),
]  # fmt: skip
_LEFT_ENDS = {  # where the last bone of each chain ends, from its joint
    "Eye": (0.0, 0.0, 0.012),
    "ThumbDistal": (0.0195, -0.001, 0.0195),
    "IndexDistal": (0.022, 0.0, 0.0),
    "MiddleDistal": (0.023, 0.0, 0.0),
    "RingDistal": (0.022, 0.0, 0.0),
    "LittleDistal": (0.020, 0.0, 0.0),
    "Toes": (0.0, -0.022, 0.065),
}


def _side(side: str) -> list[tuple[str, str, tuple[float, float, float]]]:
    mirror = 1 if side == "left" else -1
    centre = {"head", "upperChest", "hips"}
    return [
        (side + name, parent if parent in centre else side + parent, (mirror * x, y, z)) for name, parent, (x, y, z) in _LEFT
    ]


JOINTS = _CENTRE + _side("left") + _side("right")
"""``(name, parent or None, offset)`` of every joint, parents first."""

ENDS = {"head": (0.0, 0.195, 0.0), "jaw": (0.0, -0.045, 0.075)} | {
    side + name: (sign * x, y, z) for side, sign in (("left", 1), ("right", -1)) for name, (x, y, z) in _LEFT_ENDS.items()
}
"""Tips of the leaf bones, from their joint."""

MIRROR = {f"left{name}": f"right{name}" for name, _, _ in _LEFT} | {f"right{name}": f"left{name}" for name, _, _ in _LEFT}
"""Left name → right name and back; joints of the middle are absent."""

NAMES = {name: name for name, _, _ in JOINTS}
"""Our names, as the tables of other skeletons have it."""
