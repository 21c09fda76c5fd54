"""The frames of a BVH as quaternions, still in the file's units and axes.

**Positions** of joints other than the root: most exporters write the offset itself, some what is to be added to it. The one
that fits the whole file better is taken; the mean over the frames becomes the offset, bones that stretch do not.
"""

from __future__ import annotations

import io

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array, euler_to_quat, quat_identity
from .bvh_text import Header, read_rows
from .reading import check_frames

__all__ = ["decode_frames"]


def decode_frames(file: io.TextIOWrapper, header: Header, size: int) -> tuple[Array, Array, Array]:
    """Local rotations (T, J, 4), root positions (T, 3) and offsets (J, 3), in the file's units and axes."""
    first = np.concatenate([[0], np.cumsum([len(c) for c in header.channels])[:-1]])
    groups: dict[str, list[int]] = {}  # order of rotation → joints
    for joint, channels in enumerate(header.channels):
        groups.setdefault("".join(c[0] for c in channels if c.endswith("rotation")), []).append(joint)
    turning = {
        order: (joints, [[first[j] + header.channels[j].index(f"{a}rotation") for a in order] for j in joints])
        for order, joints in groups.items()
        if order
    }
    moving = [
        (joint, "XYZ".index(channel[0]), first[joint] + k)
        for joint, channels in enumerate(header.channels)
        for k, channel in enumerate(channels)
        if channel.endswith("position")
    ]
    offsets = np.array(header.offsets)
    pieces, roots, sums, frames = [], [], np.zeros(len(moving)), 0
    for rows in read_rows(file, header):
        frames += len(rows)
        check_frames("it", frames, len(header.names), size)
        rotations = quat_identity(len(rows), len(header.names))
        for order, (joints, columns) in turning.items():
            rotations[:, joints] = euler_to_quat(np.radians(rows[:, columns]), order)
        root = np.tile(offsets[0], (len(rows), 1))
        for k, (joint, axis, column) in enumerate(moving):
            sums[k] += rows[:, column].sum()
            if joint == 0:
                root[:, axis] = rows[:, column]
        pieces.append(rotations)
        roots.append(root)
    if not frames:
        raise InputError("no frame of motion", "is it cut short?")
    return np.concatenate(pieces), np.concatenate(roots), _move_offsets(offsets, moving, sums / frames)


def _move_offsets(offsets: Array, moving: list[tuple[int, int, int]], means: Array) -> Array:
    """Offsets after the mean positions of joints that have position channels (see the module's text)."""
    joints, axes = np.array([m[0] for m in moving], int), np.array([m[1] for m in moving], int)
    joints, axes, means = joints[joints > 0], axes[joints > 0], means[joints > 0]
    modelled = offsets[joints, axes]
    instead = np.abs(means - modelled).sum() <= np.abs(means).sum()
    offsets[joints, axes] = means if instead else modelled + means
    return offsets
