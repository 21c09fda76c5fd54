"""Find our joints in a skeleton by its shape alone, when the names say nothing.

The tree of a person has two pairs of long limbs of equal length: legs, which meet low, and arms, which meet high. The two
longest neighbouring bones of a limb are its upper and lower part. Left and right follow from the direction of the feet.
Fingers and the face are not searched.
"""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np

from .rotations import Array
from .skeleton import Skeleton

__all__ = ["TreeShape", "by_shape"]

_ALIKE = 0.1  # ours: the two limbs of a pair differ by less in every bone
_WIDE = 0.25  # ours: shoulders are at least this part of an arm apart; the inner ends of collar bones are nearer
_MOST = 32  # ours: the number of limbs of one joint that are compared, the longest; persons have three where the legs meet
_LONG = 0.3  # ours: a limb is at least this part of the longest chain in the tree


def by_shape(skeleton: Skeleton) -> dict[str, str]:
    """Our name → their name; empty if the tree is not that of a person.

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
    ):  # 0.3, ours: a clear difference is needed, as the root is usually nearer to the legs
        legs, arms = arms, legs
    if body.hanging(legs, arms[0]) < 0.5:  # ours: legs that do not hang: no standing pose, so that all would be a guess
        return {}
    chest = arms[0]
    hips = next(j for j in reversed(body.path(legs[0])) if j in body.path(chest))
    up = body.points[chest] - body.points[hips]
    matches = {"hips": hips}
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
            matches |= {side + name: j for name, j in limbs[joint].items()}
    spine = [j for j in body.path(chest) if hips in body.path(j) and j != hips]
    matches |= dict(zip(("spine", "chest", "upperChest"), spine, strict=False))
    if len(spine) > 3:
        matches |= {"chest": spine[(len(spine) - 1) // 2], "upperChest": spine[-1]}
    matches |= body.head(chest, arms[1:], up)
    return {ours: skeleton.names[j] for ours, j in matches.items()}


class TreeShape:
    """The rest pose of a skeleton, with the longest chain below each joint."""

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
        """Joints from the root down to ``joint``."""
        joints = [joint]
        while (joint := self.skeleton.parents[joint]) >= 0:
            joints.append(joint)
        return joints[::-1]

    def chain(self, joint: int) -> list[int]:
        """The longest chain from ``joint`` down, without bones of no length."""
        joints = [joint]
        while (joint := self.next[joint]) >= 0:
            if self.bone[joint] > 1e-3 * self.reach[0]:
                joints.append(joint)
            else:
                joints[-1] = joint
        return joints

    def pairs(self) -> list[tuple[int, int, int]]:
        """``(joint, limb, other limb)``: the two longest pairs of equal limbs that meet, at most one pair for each joint."""
        triples = []
        for joint, below in enumerate(self.skeleton.children):
            long = sorted(sorted(below, key=lambda limb: -self.reach[limb])[:_MOST])
            alike = [(a, b) for a, b in combinations(long, 2) if self._alike(a, b)]
            if alike:
                a, b = max(alike, key=lambda pair: self.reach[pair[0]])
                triples.append((joint, a, b))
        triples.sort(key=lambda pair: -self.reach[pair[1]])
        return triples[:2]

    def _alike(self, a: int, b: int) -> bool:
        lengths = [np.array([self.bone[k] for k in self.chain(j)[1:4]]) for j in (a, b)]
        if len(lengths[0]) != len(lengths[1]) or len(lengths[0]) < 1 or self.reach[a] < _LONG * self.reach.max():
            return False
        return bool((np.abs(lengths[0] - lengths[1]) <= _ALIKE * np.maximum(*lengths)).all())

    def hanging(self, pair: tuple[int, int, int], other: int) -> float:
        """How far the limbs of ``pair`` point away from the joint ``other``, as a part of their length: 1 for legs."""
        to = self.points[other] - self.points[pair[0]]
        tips = np.mean([self.points[self.chain(j)[-1]] for j in pair[1:]], 0) - self.points[pair[0]]
        return -float(to @ tips) / max(float(np.linalg.norm(to)) * float(self.reach[pair[1]]), 1e-12)

    def limb(self, joint: int, other: int, names: tuple[str, ...], *, collar: bool) -> dict[str, int]:
        """Name the joints of a limb. Its two longest neighbouring bones are the upper and the lower one.

        Collar bones are skipped: they lie near the middle of the body, that is near those of the ``other`` limb.
        """
        chain = self.chain(joint)
        lengths = [float(np.linalg.norm(self.points[b] - self.points[a])) for a, b in pairwise(chain)]
        lengths.append(float(self.reach[chain[-1]]))
        apart = [float(np.linalg.norm(self.points[a] - self.points[b])) for a, b in zip(chain, self.chain(other), strict=False)]
        wide = [k for k in range(len(lengths) - 1) if not collar or apart[k] > _WIDE * self.reach[joint]]
        at = max(wide, key=lambda k: min(lengths[k], lengths[k + 1]), default=0)
        joints = dict(zip(names, chain[at:], strict=False))
        return joints | ({"Shoulder": chain[at - 1]} if collar and at > 0 else {})

    def toe_direction(self, limb: dict[str, int]) -> Array:
        """Vector from the ankle to the end of the foot."""
        foot = limb.get("Foot")
        if foot is None:
            return np.zeros(3)
        chain = self.chain(foot)
        end = self.skeleton.ends.get(self.skeleton.names[chain[-1]], (0.0, 0.0, 0.0))
        return self.points[chain[-1]] + np.array(end, float) - self.points[foot]

    def _branches(self, joint: int) -> bool:
        """Whether a joint carries a face: three joints or more, or two eyes, which are equally far away."""
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
