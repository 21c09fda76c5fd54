"""Finding our joints in a skeleton by its shape alone, when the names say nothing.

A person's tree has two pairs of equal long limbs: legs where they meet low, arms where they meet high. Along a limb the two
longest neighbouring bones are its upper and lower part. Left and right follow from where the feet point. Fingers and the
face are not looked for.
"""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np

from .rotations import Array
from .skeleton import Skeleton

__all__ = ["TreeShape", "by_shape"]

_ALIKE = 0.1  # ours: the two limbs of a pair differ by less in every bone
_WIDE = 0.25  # ours: shoulders are at least this part of an arm apart, the inner ends of collar bones are not
_MOST = 32  # ours: so many limbs of one joint are compared, the longest; persons have three where the legs meet
_LONG = 0.3  # ours: a limb is at least this part of the longest chain in the tree


def by_shape(skeleton: Skeleton) -> dict[str, str]:
    """Our name → their name; empty where the tree is not a person's.

    Args:
        skeleton: theirs; its ``rest`` pose should be a standing one.
    """
    body = TreeShape(skeleton)
    pairs = body.pairs()
    if len(pairs) != 2:
        return {}
    legs, arms = sorted(pairs, key=lambda pair: len(body.path(pair[0])))
    if (
        body.hanging(arms, legs[0]) > body.hanging(legs, arms[0]) + 0.3
    ):  # 0.3, ours: clearly, else the root is nearer to the legs
        legs, arms = arms, legs
    if body.hanging(legs, arms[0]) < 0.5:  # ours: legs that do not hang: not a standing pose, anything said would be a guess
        return {}
    chest = arms[0]
    hips = next(j for j in reversed(body.path(legs[0])) if j in body.path(chest))
    up = body.points[chest] - body.points[hips]
    found = {"hips": hips}
    limbs = {}
    for pair, names in ((legs, ("UpperLeg", "LowerLeg", "Foot", "Toes")), (arms, ("UpperArm", "LowerArm", "Hand"))):
        for joint, other in (pair[1:], pair[:0:-1]):
            limbs[joint] = body.limb(joint, other, names, collar=pair is arms)
    forward = sum((body.toe_direction(limbs[joint]) for joint in legs[1:]), np.zeros(3))
    forward = forward - up * (forward @ up) / max(float(up @ up), 1e-12)
    left = np.cross(up, forward) if np.linalg.norm(forward) > 1e-6 else np.array([1.0, 0, 0])
    for _, a, b in (legs, arms):
        tips = {joint: body.points[list(limbs[joint].values())].mean(0) for joint in (a, b)}
        first = (a, b) if (tips[a] - tips[b]) @ left > 0 else (b, a)
        for side, joint in zip(("left", "right"), first, strict=True):
            found |= {side + name: j for name, j in limbs[joint].items()}
    spine = [j for j in body.path(chest) if hips in body.path(j) and j != hips]
    found |= dict(zip(("spine", "chest", "upperChest"), spine, strict=False))
    if len(spine) > 3:
        found |= {"chest": spine[(len(spine) - 1) // 2], "upperChest": spine[-1]}
    found |= body.head(chest, arms[1:], up)
    return {ours: skeleton.names[j] for ours, j in found.items()}


class TreeShape:
    """A skeleton's rest pose, with the longest way down from every joint."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        self.points = skeleton.forward(skeleton.rest, np.zeros(3))[0]
        self.bone = np.linalg.norm(skeleton.offsets, axis=-1)
        self.reach = np.array([float(np.linalg.norm(skeleton.ends.get(name, (0.0, 0, 0)))) for name in skeleton.names])
        self.next = [-1] * len(skeleton)
        for j in range(len(skeleton) - 1, 0, -1):
            parent, reach = skeleton.parents[j], self.bone[j] + self.reach[j]
            if self.next[parent] < 0 or reach > self.reach[parent]:
                self.reach[parent], self.next[parent] = reach, j

    def path(self, joint: int) -> list[int]:
        """From the root down to ``joint``."""
        found = [joint]
        while (joint := self.skeleton.parents[joint]) >= 0:
            found.append(joint)
        return found[::-1]

    def chain(self, joint: int) -> list[int]:
        """The longest way down from ``joint``, joints without length left out."""
        found = [joint]
        while (joint := self.next[joint]) >= 0:
            if self.bone[joint] > 1e-3 * self.reach[0]:
                found.append(joint)
            else:
                found[-1] = joint
        return found

    def pairs(self) -> list[tuple[int, int, int]]:
        """``(joint, limb, other limb)``: the longest alike limbs that meet, one pair per joint, at most two pairs."""
        found = []
        for joint, below in enumerate(self.skeleton.children):
            long = sorted(sorted(below, key=lambda limb: -self.reach[limb])[:_MOST])
            alike = [(a, b) for a, b in combinations(long, 2) if self._alike(a, b)]
            if alike:
                a, b = max(alike, key=lambda pair: self.reach[pair[0]])
                found.append((joint, a, b))
        found.sort(key=lambda pair: -self.reach[pair[1]])
        return found[:2]

    def _alike(self, a: int, b: int) -> bool:
        lengths = [np.array([self.bone[k] for k in self.chain(j)[1:4]]) for j in (a, b)]
        if len(lengths[0]) != len(lengths[1]) or len(lengths[0]) < 1 or self.reach[a] < _LONG * self.reach.max():
            return False
        return bool((np.abs(lengths[0] - lengths[1]) <= _ALIKE * np.maximum(*lengths)).all())

    def hanging(self, pair: tuple[int, int, int], other: int) -> float:
        """How far the limbs of ``pair`` point away from the joint ``other``, in parts of their length: 1 for legs."""
        to = self.points[other] - self.points[pair[0]]
        tips = np.mean([self.points[self.chain(j)[-1]] for j in pair[1:]], 0) - self.points[pair[0]]
        return -float(to @ tips) / max(float(np.linalg.norm(to)) * float(self.reach[pair[1]]), 1e-12)

    def limb(self, joint: int, other: int, names: tuple[str, ...], *, collar: bool) -> dict[str, int]:
        """Name the joints of a limb, its two longest neighbouring bones being the upper and the lower one.

        Collar bones are left aside by being near the middle of the body, that is near the ``other`` limb's.
        """
        chain = self.chain(joint)
        lengths = [float(np.linalg.norm(self.points[b] - self.points[a])) for a, b in pairwise(chain)]
        lengths.append(float(self.reach[chain[-1]]))
        apart = [float(np.linalg.norm(self.points[a] - self.points[b])) for a, b in zip(chain, self.chain(other), strict=False)]
        wide = [k for k in range(len(lengths) - 1) if not collar or apart[k] > _WIDE * self.reach[joint]]
        at = max(wide, key=lambda k: min(lengths[k], lengths[k + 1]), default=0)
        found = dict(zip(names, chain[at:], strict=False))
        return found | ({"Shoulder": chain[at - 1]} if collar and at > 0 else {})

    def toe_direction(self, limb: dict[str, int]) -> Array:
        """From the ankle to where the foot ends."""
        foot = limb.get("Foot")
        if foot is None:
            return np.zeros(3)
        chain = self.chain(foot)
        end = self.skeleton.ends.get(self.skeleton.names[chain[-1]], (0.0, 0.0, 0.0))
        return self.points[chain[-1]] + np.array(end, float) - self.points[foot]

    def _branches(self, joint: int) -> bool:
        """Whether a face hangs on a joint: three joints or more, or two eyes, which lie as far away as each other."""
        below = self.skeleton.children[joint]
        far = self.bone[list(below)]
        return len(below) > 2 or (len(below) == 2 and bool(abs(far[0] - far[1]) <= _ALIKE * far.max()))

    def head(self, chest: int, arms: tuple[int, ...], up: Array) -> dict[str, int]:
        """Neck and head: the chain above the chest that rises highest."""
        above = [j for j in self.skeleton.children[chest] if j not in arms]
        if not above:
            return {}
        chain = self.chain(max(above, key=lambda j: float((self.points[self.chain(j)[-1]] - self.points[chest]) @ up)))
        rising = [chain[0], *(b for a, b in pairwise(chain) if (self.points[b] - self.points[a]) @ up > 0)]
        face = next((k for k, j in enumerate(rising) if self._branches(j)), None)
        if face is not None:
            rising = rising[: face + 1]
        tip_is_joint = not self.skeleton.ends.get(self.skeleton.names[rising[-1]]) and self.next[rising[-1]] < 0
        if len(rising) > 2 and tip_is_joint:
            rising.pop()
        return {"neck": rising[0], "head": rising[-1]} if len(rising) > 1 else {"head": rising[0]}
