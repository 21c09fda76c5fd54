"""The key points of PATS (Ahuja et al. 2020): 52 joints in 2-D, as OpenPose finds them; names and order are the authors'."""

__all__ = ["JOINTS", "LEFT", "PARENTS", "RIGHT", "SPEAKERS"]

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
"""What the authors' left-arm transform holds still."""

RIGHT = (1, 2, 3, 8, *range(31, 52))
"""What the authors' right-arm transform holds still."""

SPEAKERS = (
    "oliver", "jon", "conan", "rock", "chemistry", "ellen", "almaram", "angelica", "seth", "shelly", "colbert", "corden",
    "fallon", "huckabee", "maher", "lec_cosmic", "lec_evol", "lec_hist", "lec_law", "minhaj", "ytch_charisma", "ytch_dating",
    "ytch_prof", "bee", "noah",
)  # fmt: skip
"""In the order of the authors' loader."""
