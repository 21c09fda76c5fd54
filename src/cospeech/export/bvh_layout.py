"""The layout of a BVH: its HIERARCHY, and how the numbers of its rows are computed from joints in metres.

A file that was read has a layout of its own; `make_layout` makes ours. The rows of a motion in the layout of a rig's file can
be pasted onto the rig.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..motion.rotations import Array, quat_conjugate, quat_identity, quat_multiply, quat_rotate
from ..motion.skeleton import Skeleton
from .bvh_hierarchy import Header, file_names

__all__ = ["BvhLayout", "make_layout"]

_ORDER = "ZXY"  # ours: the poles then lie at ±90° of X, where arms and head seldom are
_CLOSE = 1e-6  # metres; ours: less than `Skeleton` tells apart


@dataclass(frozen=True, eq=False)
class BvhLayout:
    """The layout of a BVH.

    Args:
        header: J joints with names, parents, offsets, channels and end sites, in the file's order, units and axes.
        joints: (J,) which joint of the skeleton each of them is.
        places: (columns,) of a row, in the file's units; the position channels of joints other than the root keep theirs.
        scale: the file's units per metre.
        turn: (4,) from our axes, Y up, to the file's; None where they are the same.
        zero: (J, 4) world rotations of the file's joints in the file's zero pose, on the skeleton's; identities if None.
    """

    header: Header
    joints: Array
    places: Array
    scale: float = 1.0
    turn: Array | None = None
    zero: Array | None = None

    def _around(self) -> tuple[Array, Array]:
        """(J, 4) each: the rotations before and after a joint's local rotation that make it the file's."""
        zero = quat_identity(len(self.joints)) if self.zero is None else self.zero
        before = zero[np.maximum(self.header.parents, 0)]
        before[0] = (0, 0, 0, 1) if self.turn is None else self.turn
        return before, quat_conjugate(zero)

    def fits(self, skeleton: Skeleton) -> bool:
        """Whether a skeleton still has the bones of the file: its names and offsets are the same."""
        if len(skeleton) != len(self.joints) or [skeleton.names[k] for k in self.joints] != file_names(self.header.names):
            return False
        channels = [" ".join(names) for names in self.header.channels]
        still = [joint for joint, names in enumerate(channels) if joint and "position" not in names]
        offsets = quat_rotate(self._around()[0], skeleton.offsets[self.joints])[still]
        return bool(np.allclose(offsets, np.array(self.header.offsets)[still] / self.scale, atol=_CLOSE))

    def convert_frames(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """Frames in the file's order, units and axes.

        Args:
            rotations: (T, J, 4) local rotations of the skeleton.
            root: (T, 3) metres.

        Returns:
            (T, J, 4) local rotations since the file's zero pose, and (T, 3) positions of the root.
        """
        before, after = self._around()
        local = np.asarray(rotations, float)[:, self.joints]
        positions = quat_rotate(before[0], np.asarray(root, float))
        return quat_multiply(quat_multiply(before, local), after), positions * self.scale


def make_layout(skeleton: Skeleton, scale: float, decimals: int, order: str = _ORDER) -> BvhLayout:
    """Our layout: the T-pose is the zero pose, the root has OFFSET 0 and six channels, the other joints have three.

    Args:
        skeleton: of the motion to write.
        scale: units per metre.
        decimals: of lengths in the header.
        order: of the rotation channels.
    """
    joints = _sort_by_depth(skeleton)
    rest = skeleton.forward(skeleton.rest, skeleton.offsets[0])[1]
    above = rest[[max(p, 0) for p in skeleton.parents]]
    offsets = quat_rotate(above, skeleton.offsets) * scale
    offsets[0] = 0
    header, names, place = Header(), file_names(skeleton.names), {joint: k for k, joint in enumerate(joints)}
    turns = tuple(f"{axis}rotation" for axis in order)
    for k, joint in enumerate(joints):
        header.names.append(names[joint])
        header.parents.append(place.get(skeleton.parents[joint], -1))
        header.offsets.append(_round(offsets[joint], decimals))
        header.channels.append(turns if k else ("Xposition", "Yposition", "Zposition", *turns))
        if not skeleton.children[joint]:
            end = np.array(skeleton.ends.get(skeleton.names[joint], (0.0, 0.0, 0.0)), float)
            header.ends[k] = _round(quat_rotate(rest[joint], end) * scale, decimals)
    return BvhLayout(header, np.array(joints), np.zeros(header.columns), scale, zero=rest[joints])


def _round(offset: Array, decimals: int) -> tuple[float, float, float]:
    x, y, z = (round(float(value), decimals) for value in offset)
    return x, y, z


def _sort_by_depth(skeleton: Skeleton) -> list[int]:
    """Joints depth first, as the format wants them."""
    order, stack = [], [0]
    while stack:
        joint = stack.pop()
        order.append(joint)
        stack.extend(reversed(skeleton.children[joint]))
    return order
