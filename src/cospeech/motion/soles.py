"""Soles of feet: the points on which a skeleton stands, and their heights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .rotations import Array, quat_conjugate, quat_rotate
from .skeleton import Skeleton

__all__ = ["Soles", "find_soles"]

_HEEL = 0.25  # heel behind the ankle, as a part of ankle to toes [ours: a foot is 15 % of the stature, a quarter of it behind]
_TIP = 0.5  # tip before the joint of the toes, as a part of the same length, if the file has no tip [ours: of our humanoid]


@dataclass(frozen=True)
class Soles:
    """Points under the feet. In the T-pose they are on the floor; each is fixed to a joint.

    Attributes:
        joints: (P,) the joint that carries each point.
        points: (P, 3) in that joint's frame, metres.
    """

    joints: Array
    points: Array

    def heights(self, positions: Array, world: Array) -> Array:
        """(T,) height of the lowest point in each frame, metres, from positions (T, J, 3) and world rotations (T, J, 4)."""
        lowest: Array = (positions[:, self.joints] + quat_rotate(world[:, self.joints], self.points))[..., 1].min(-1)
        return lowest


def find_soles(skeleton: Skeleton, names: Mapping[str, str]) -> Soles | None:
    """Heel, ball and tip of both feet.

    Args:
        skeleton: with its T-pose as ``rest``.
        names: our name → their name.

    Returns:
        None if a foot is missing.
    """
    if not {"leftFoot", "rightFoot"} <= set(names):
        return None
    points, world = skeleton.forward(skeleton.rest, skeleton.offsets[0])
    joints, local = [], []
    for side in ("left", "right"):
        foot = skeleton.index[names[side + "Foot"]]
        toes = skeleton.index[names[side + "Toes"]] if side + "Toes" in names else None
        for joint, point in _of_foot(skeleton, points, world, foot, toes):
            at = np.array((point[0], skeleton.floor, point[2]))
            joints.append(joint)
            local.append(quat_rotate(quat_conjugate(world[joint]), at - points[joint]))
    return Soles(np.array(joints), np.array(local))


def _of_foot(skeleton: Skeleton, points: Array, world: Array, foot: int, toes: int | None) -> list[tuple[int, Array]]:
    """``(joint, place)`` of heel, ball and tip in the T-pose; their heights are not used."""
    last = foot if toes is None else toes
    end = np.array(skeleton.ends.get(skeleton.names[last], (0.0, 0, 0)))
    tip = points[last] + quat_rotate(world[last], end)
    if toes is not None and np.linalg.norm(tip - points[toes]) < 1e-6:
        tip = points[toes] + _TIP * (points[toes] - points[foot])
    along = points[foot] - (tip if toes is None else points[toes])
    places = [(foot, points[foot] + _HEEL * along), (last, tip)]
    return places if toes is None else [*places, (foot, points[toes])]
