"""Read the names of joints: side, part, and whether a joint is a helper of another one.

The names of many makes are read (Mixamo, Rokoko, CMU, Biped, VRoid, Rigify, MakeHuman, Unreal, SMPL …).
"""

from __future__ import annotations

import re

from .skeleton import Skeleton

__all__ = ["PARTS", "JointName", "JointTree"]

_SIDES = {
    "left": "left",
    "l": "left",
    "lf": "left",
    "lft": "left",
    "right": "right",
    "r": "right",
    "rt": "right",
    "rgt": "right",
}
_NOISE = {
    "mixamorig", "bip", "biped", "valvebiped", "adj", "sec", "def", "org", "cc", "base", "armature", "bone", "bn", "jnt", "jt",
    "skel", "character", "rig", "b", "c", "m", "j", "sk", "bnd", "bind", "smplhf",
}  # fmt: skip
_EXTRA = {
    "twist", "roll", "ik", "pole", "target", "ctrl", "control", "helper", "slot", "nub", "end", "tip", "site", "volume",
    "corrective", "correct", "dummy", "socket", "mch", "share", "top",
}  # fmt: skip
PARTS = {
    "Shoulder": ("clavicle", "collar", "collarbone", "clav", "scapula", "shoulder"),
    "UpperArm": ("upperarm", "uparm", "armupper", "arm", "humerus", "shoulder", "shldr"),
    "LowerArm": ("lowerarm", "loarm", "forearm", "lowarm", "armlower", "radius", "elbow", "ulna"),
    "Hand": ("wrist", "hand", "palm"),
    "UpperLeg": ("upperleg", "upleg", "thigh", "legupper", "femur", "hip", "leg"),
    "LowerLeg": ("lowerleg", "loleg", "lowleg", "calf", "shin", "leglower", "crus", "tibia", "knee", "leg"),
    "Foot": ("ankle", "foot", "feet"),
    "Toes": ("toebase", "toes", "toe", "ball", "forefoot", "foot"),
    "Eye": ("eye", "eyeball", "faceeye"),
}
"""Our part → its names in other skeletons, best first."""
_WORDS = {word for words in PARTS.values() for word in words} | {"fingers", "thumb", "toebase"}


class JointName:
    """The parts of a name: side, stem (words without side and noise), digits, and whether it is a helper of another joint."""

    def __init__(self, index: int, name: str) -> None:
        self.index = index
        base = re.split(r"[:|]", name)[-1]
        base = re.sub(r"(?i)^(valvebiped|mixamorig|character|bip(ed)?)\d*(?=[^a-z])", "", base)
        self.helper = base.startswith("__")
        words = [w.lower() for w in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", base)]
        self.digits = [w for w in words if w.isdigit()]
        words = [w for w in words if not w.isdigit()]
        side = next((w for w in words if w in _SIDES), None)
        self.side = _SIDES[side] if side else None
        if side:
            words.remove(side)
        self.extra = any(w in _EXTRA for w in words)
        self.stem = "".join(w for w in words if w not in _NOISE)
        if not side:
            self._side_within()

    def _side_within(self) -> None:
        """Find a side that is not separated from the stem: ``leftarm``, ``lfemur``, ``thighr``."""
        for side in ("left", "right"):
            if self.stem.startswith(side) or self.stem.endswith(side):
                self.side, self.stem = side, self.stem.replace(side, "", 1)
                return
        if len(self.stem) > 2 and self.stem[0] in "lr" and self.stem[1:] in _WORDS and self.stem not in _WORDS:
            self.side, self.stem = _SIDES[self.stem[0]], self.stem[1:]

    @property
    def rank(self) -> tuple[bool, tuple[int, ...], int]:
        """Order of joints with the same stem: helpers last, then by number."""
        return self.helper, tuple(int(d[:9]) for d in self.digits), self.index


class JointTree:
    """The tree of a skeleton, with its names read."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        self.joints = [JointName(k, name) for k, name in enumerate(skeleton.names)]

    def path(self, joint: int) -> list[int]:
        """Joints from the root down to ``joint``."""
        joints = [joint]
        while (joint := self.skeleton.parents[joint]) >= 0:
            joints.append(joint)
        return joints[::-1]

    def above(self, a: int, b: int) -> bool:
        """Whether ``a`` is a true ancestor of ``b``."""
        return a != b and a in self.path(b)

    def meeting(self, *joints: int) -> int:
        """The lowest common ancestor of ``joints``; it may be one of them."""
        ancestors = set.intersection(*(set(self.path(j)) for j in joints))
        return max(ancestors, key=lambda j: len(self.path(j)))

    def find(self, side: str | None, part: str) -> list[int]:
        """Joints that may be ``part``, best first."""
        words = PARTS[part]
        fit = [j for j in self.joints if j.side == side and not j.extra and j.stem in words]
        return [j.index for j in sorted(fit, key=lambda j: (words.index(j.stem), j.rank))]
