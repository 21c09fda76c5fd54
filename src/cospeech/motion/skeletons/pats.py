"""The key points of PATS (Ahuja et al. 2020): 52 joints in 2-D, as OpenPose finds them; names and order are the authors'."""

from .humanoid import ENDS

__all__ = ["JOINTS", "LEFT", "PARENTS", "RIGHT", "SOURCES", "SPEAKERS"]

_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")


def _hand(side: str) -> tuple[str, ...]:
    return (f"{side}HandRoot", *(f"{side}Hand{finger}{k}" for finger in _FINGERS for k in range(1, 5)))


def _chains(root: int) -> tuple[int, ...]:
    """Five fingers of four joints behind the root of a hand."""
    return tuple(root if k == 0 else root + 4 * finger + k for finger in range(5) for k in range(4))


JOINTS = (
    "Neck", "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow", "LWrist", "Nose", "REye", "LEye", *_hand("L"), *_hand("R"),
)  # fmt: skip

PARENTS = (-1, 0, 1, 2, 0, 4, 5, 0, 7, 7, 6, *_chains(10), 3, *_chains(31))

LEFT = (4, 5, 6, 9, *range(10, 31))
"""Joints that the authors' left-arm transform holds still."""

RIGHT = (1, 2, 3, 8, *range(31, 52))
"""Joints that the authors' right-arm transform holds still."""

SPEAKERS = (
    "oliver", "jon", "conan", "rock", "chemistry", "ellen", "almaram", "angelica", "seth", "shelly", "colbert", "corden",
    "fallon", "huckabee", "maher", "lec_cosmic", "lec_evol", "lec_hist", "lec_law", "minhaj", "ytch_charisma", "ytch_dating",
    "ytch_prof", "bee", "noah",
)  # fmt: skip
"""In the order of the authors' loader."""


def _fingers(side: str) -> list[tuple[str, tuple[float, float, float]]]:
    """Root of a hand and its fingers: three joints and the tip."""
    rows: list[tuple[str, tuple[float, float, float]]] = [(f"{side}Hand", (0.0, 0.0, 0.0))]
    for finger in _FINGERS:
        parts = ("Metacarpal", "Proximal", "Distal") if finger == "Thumb" else ("Proximal", "Intermediate", "Distal")
        rows += [(f"{side}{finger}{part}", (0.0, 0.0, 0.0)) for part in parts]
        rows.append((f"{side}{finger}Distal", ENDS[f"{side}{finger}Distal"]))
    return rows


SOURCES: tuple[tuple[str, tuple[float, float, float]], ...] = (
    ("upperChest", (0.0, 0.103, -0.010)),
    *((f"{side}{part}", (0.0, 0.0, 0.0)) for side in ("right", "left") for part in ("UpperArm", "LowerArm", "Hand")),
    ("head", (0.0, 0.05, 0.10)),
    ("rightEye", (0.0, 0.0, 0.0)),
    ("leftEye", (0.0, 0.0, 0.0)),
    *_fingers("left"),
    *_fingers("right"),
)
"""Where each point lies on our humanoid: joint and offset in its axes, metres.

OpenPose's neck is the middle of the shoulders."""
