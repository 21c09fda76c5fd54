"""Crop the pictures of a strip to the width of the figure in its pose, so that all have one scale, as large as fits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...motion.rotations import Array
from ..mannequin.character import Character, pose_surface
from .camera import Camera, View
from .framing import FramedPose, box_of

__all__ = ["Crops", "crop_poses"]

_WIDE = 4  # width over height of a picture before it is cropped; ours: more than spread arms
_BORDER = 0.05  # metres beside a figure; ours
_ROUNDS = 6  # ours: the perspective changes a little with the camera's distance
_NEAR_ENOUGH = 1.01  # least factor by which the camera goes back in a round; ours


class Crops(NamedTuple):
    """The camera's box and the crops of the pictures of a strip.

    Attributes:
        box: (6,) low and high corner of what the camera shows.
        width: of a picture before it is cropped, pixels.
        columns: of each picture that are kept: the first, and the one after the last.
        far: factor by which the camera shows more height, so that all fit: 1 where the view fills the height.
    """

    box: Array
    width: int
    columns: list[tuple[int, int]]
    far: float


def crop_poses(view: View, character: Character, poses: Sequence[FramedPose], room: int, height: int) -> Crops:
    """Find crops for pictures of poses, side by side in ``room`` pixels, each ``height`` pixels high.

    Args:
        view: one that does not follow a joint.
        character: who is shown.
        poses: of the character's skeleton.
        room: width of all pictures together.
        height: of each.
    """
    box = box_of(view, character.skeleton, np.stack([pose.positions for pose in poses]))
    skins = [pose_surface(character, *pose)[0].T for pose in poses]
    width, far = _WIDE * height, 1.0
    for _ in range(_ROUNDS):
        low, high = np.split(_stand_back(box, far), 2)
        camera = view.camera(low, high, width, height)
        columns = [_columns_of(camera, skin) for skin in skins]
        total = sum(right - left for left, right in columns)
        if total <= room:
            break
        far *= max(total / room, _NEAR_ENOUGH)
    return Crops(_stand_back(box, far), width, _fill(columns, room, width), far)


def _stand_back(box: Array, far: float) -> Array:
    """A box that is ``far`` times as high. It grows down to the floor first; a box that begins at the floor grows both ways."""
    low, high = box[1], box[4]
    more = (high - low) * (far - 1)
    below = min(more, low) if low > 0 else more / 2  # legs rather than air
    return box + np.array([0, -below, 0, 0, more - below, 0])


def _columns_of(camera: Camera, skin: Array) -> tuple[int, int]:
    """Columns of the picture that show a figure (V, 3), with a border."""
    x, y, inverse = camera.project(skin).T
    x = x[(inverse > 0) & (y >= 0) & (y <= camera.height)]
    if not len(x):
        return camera.width // 2 - 1, camera.width // 2 + 1
    border = _BORDER * camera.focal * float(np.median(inverse))
    left, right = np.clip([x.min() - border, x.max() + border], 0, camera.width)
    return int(left), int(np.ceil(right))


def _fill(columns: list[tuple[int, int]], room: int, width: int) -> list[tuple[int, int]]:
    """Share the spare room between the columns, or take away what is too much."""
    spare = room - sum(right - left for left, right in columns)
    shares = np.diff(np.linspace(0, spare, len(columns) + 1).round().astype(int)).tolist()
    result = []
    for (left, right), share in zip(columns, shares, strict=True):
        size = min(max(right - left + share, 2), width)
        start = min(max((left + right - size) // 2, 0), width - size)
        result.append((start, start + size))
    return result
