"""The frames of a BVH as quaternions, in the file's units and axes, and back.

**Positions** of joints other than the root: most exporters write the offset itself, some write what is added to it. The reading
that fits the whole file better is taken. The mean over the frames becomes the offset: bones do not stretch.

**Joints with fewer than three rotation channels** get the nearest rotation that they can have. The rest is passed to their
children, so that only the joint itself is off.
"""

from __future__ import annotations

import io
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..motion.rotations import (
    Array,
    continuous_euler,
    euler_to_quat,
    quat_angle,
    quat_conjugate,
    quat_identity,
    quat_multiply,
    quat_to_euler,
)
from .bvh_hierarchy import Header
from .bvh_text import read_rows
from .reading import check_frames

__all__ = ["Frames", "RowEncoder", "decode_frames"]


class Frames(NamedTuple):
    """The content of the rows of a BVH.

    Attributes:
        rotations: (T, J, 4) local.
        root: (T, 3) positions.
        offsets: (J, 3) with those of joints that have position channels.
        places: (columns,) mean of each position channel of joints other than the root; 0 elsewhere.
    """

    rotations: Array
    root: Array
    offsets: Array
    places: Array


class _Columns:
    """The meaning of each column of a row.

    Attributes:
        orders: of each joint, the axes of its rotation channels, as ``"ZXY"``.
        turning: order of rotation → joints, and (n, 1 to 3) columns of each.
        moving: joint, axis and column of each position channel.
    """

    def __init__(self, header: Header) -> None:
        first = np.concatenate([[0], np.cumsum([len(c) for c in header.channels])[:-1]])
        self.orders = ["".join(c[0] for c in channels if c.endswith("rotation")) for channels in header.channels]
        groups: dict[str, list[int]] = {}
        for joint, order in enumerate(self.orders):
            groups.setdefault(order, []).append(joint)
        self.turning = {
            order: (joints, [[first[j] + header.channels[j].index(f"{a}rotation") for a in order] for j in joints])
            for order, joints in groups.items()
            if order
        }
        self.moving = [
            (joint, "XYZ".index(channel[0]), int(first[joint]) + k)
            for joint, channels in enumerate(header.channels)
            for k, channel in enumerate(channels)
            if channel.endswith("position")
        ]


def decode_frames(file: io.TextIOWrapper, header: Header, size: int) -> Frames:
    """Read all frames of a file of ``size`` bytes, after its header.

    Raises:
        InputError: no frame, too many, or a row that cannot be read.
    """
    columns = _Columns(header)
    offsets, sums, frames = np.array(header.offsets), np.zeros(header.columns), 0
    pieces, roots = [], []
    for rows in read_rows(file, header):
        frames += len(rows)
        check_frames("it", frames, len(header.names), size)
        rotations = quat_identity(len(rows), len(header.names))
        for order, (joints, places) in columns.turning.items():
            rotations[:, joints] = euler_to_quat(np.radians(rows[:, places]), order)
        root = np.tile(offsets[0], (len(rows), 1))
        for joint, axis, column in columns.moving:
            if joint == 0:
                root[:, axis] = rows[:, column]
            else:
                sums[column] += rows[:, column].sum()
        pieces.append(rotations)
        roots.append(root)
    if not frames:
        raise InputError("no frame of motion", "is it cut short?")
    means = sums / frames
    return Frames(_join(pieces), np.concatenate(roots), _move_offsets(offsets, columns.moving, means), means)


def _join(pieces: list[Array]) -> Array:
    """The pieces in one array; the list is empty then, so that they are not all in memory twice."""
    result, first = np.empty((sum(map(len, pieces)), *pieces[0].shape[1:])), 0
    pieces.reverse()
    while pieces:
        piece = pieces.pop()
        result[first : first + len(piece)] = piece
        first += len(piece)
    return result


def _move_offsets(offsets: Array, moving: list[tuple[int, int, int]], means: Array) -> Array:
    """Set the offsets of joints that have position channels to their mean positions (see the module's text)."""
    joints, axes, columns = np.array([m for m in moving if m[0]], int).reshape(-1, 3).T
    rest, positions = offsets[joints, axes], means[columns]
    instead = np.abs(positions - rest).sum() <= np.abs(positions).sum()
    offsets[joints, axes] = positions if instead else rest + positions
    return offsets


class RowEncoder:
    """Makes rows from frames, the reverse of `decode_frames`. Angles do not jump between calls.

    Args:
        header: of the file.
        places: (columns,) a row, from which the position channels of joints other than the root are taken.

    Attributes:
        losses: name of a joint with too few rotation channels → radians by which it is off, at most.
        root_loss: distance by which the root is off along axes that have no position channel, at most, in the file's units.
        moving: columns of the position channels.
    """

    def __init__(self, header: Header, places: Array) -> None:
        self._header, self._places, self._columns = header, places, _Columns(header)
        self._last: dict[str, Array] = {}  # order → last row of angles
        self.losses: dict[str, float] = {}
        self.root_loss = 0.0
        self.moving = [column for _, _, column in self._columns.moving]

    def encode(self, rotations: Array, root: Array) -> Array:
        """(T, columns) rows of a file, angles in degrees.

        Args:
            rotations: (T, J, 4) local rotations in the file's order and axes.
            root: (T, 3) positions in its units and axes.
        """
        rotations, rows = self._project(rotations), np.tile(self._places, (len(root), 1))
        for order, (joints, columns) in self._columns.turning.items():
            angles = continuous_euler(quat_to_euler(rotations[:, joints], order), self._last.get(order))
            self._last[order] = angles[-1]
            rows[:, columns] = np.degrees(angles)
        off = root - np.array(self._header.offsets[0])
        for joint, axis, column in self._columns.moving:
            if joint == 0:
                rows[:, column], off[:, axis] = root[:, axis], 0.0
        self.root_loss = max(self.root_loss, float(np.linalg.norm(off, axis=-1).max()))
        return rows

    def _project(self, rotations: Array) -> Array:
        """The nearest rotations that the channels can hold; children get the rest of their parent's rotation."""
        header = self._header
        for joint, (name, order) in enumerate(zip(header.names, self._columns.orders, strict=True)):  # parents first
            if len(order) == 3:
                continue
            rotation = rotations[:, joint].copy()
            near = euler_to_quat(quat_to_euler(rotation, order), order) if order else quat_identity(len(rotation))
            over = quat_multiply(quat_conjugate(near), rotation)
            self.losses[name] = max(self.losses.get(name, 0.0), float(quat_angle(near, rotation).max()))
            rotations[:, joint] = near
            children = [child for child, parent in enumerate(header.parents) if parent == joint]
            rotations[:, children] = quat_multiply(over[:, None], rotations[:, children])
        return rotations
