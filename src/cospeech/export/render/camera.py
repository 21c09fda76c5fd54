"""The camera: where it stands, what it sees, and where it must stand so that given points are in the picture."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...errors import InputError
from ...motion.rotations import Array
from ...motion.skeleton import Skeleton

__all__ = ["CAMERAS", "Camera", "View", "find_view"]

_NEAR = np.float32(0.05)  # metres; ours: no part of a framed character comes nearer to the lens


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera.

    Args:
        position: (3,) metres.
        forward: (3,) unit, the direction it looks in; never straight up or down.
        tangent: half the picture's *height* at a distance of 1 m.
        width: of the picture, pixels.
        height: of the picture, pixels.
    """

    position: Array
    forward: Array
    tangent: float
    width: int
    height: int

    @cached_property
    def axes(self) -> Array:
        """(3, 3) rows: right, up and forward of the picture, in the world."""
        return _axes(self.forward)

    @property
    def focal(self) -> float:
        """Pixels per metre at a distance of 1 m."""
        return self.height / 2 / self.tangent

    def project(self, points: Array) -> Array:
        """World points (N, 3) → (N, 3) float32: x and y in pixels (y down), and the inverse depth in 1 / metres.

        Points behind the camera or nearer than 5 cm get the inverse depth −1. Each coordinate is contiguous in memory.
        """
        matrix = self.axes.astype(np.float32)
        right, up, depth = matrix @ (points - self.position).T.astype(np.float32)
        inverse = np.where(depth > _NEAR, 1 / np.maximum(depth, _NEAR), np.float32(-1))
        focal = np.float32(self.focal)
        out = np.empty((3, len(points)), np.float32)
        out[0] = self.width / 2 + right * inverse * focal
        out[1] = self.height / 2 - up * inverse * focal
        out[2] = inverse
        return out.T


@dataclass(frozen=True)
class View:
    """A way of looking at the character, who stands at the origin and faces +Z.

    Args:
        joints: beginnings of the names of the joints that must stay in the picture, or all of them where empty.
        low: (3,) corner of a box in metres that is always in the picture (humanoid of 1.72 m).
        high: (3,) its other corner.
        reach: metres of free room around each joint: for flesh, and for the fingers beyond their last joint.
        yaw: degrees by which the camera stands to the character's left.
        pitch: degrees by which it looks down.
        angle: degrees from the bottom to the top of the picture.
        follows: name of a joint that the box follows, smoothly; the box is then that of the T-pose.
    """

    joints: tuple[str, ...]
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    reach: float
    yaw: float
    pitch: float
    angle: float
    follows: str = ""

    def joints_of(self, skeleton: Skeleton) -> list[int]:
        """Indices of the joints that must stay in the picture, without those that the character lacks."""
        there = [k for k, name in enumerate(skeleton.names) if skeleton.bone_map.get(name) != ""]
        return [k for k in there if not self.joints or skeleton.names[k].startswith(self.joints)]

    def camera(self, low: Array, high: Array, width: int, height: int) -> Camera:
        """The nearest camera from which the box ``low … high`` (each (3,), metres) is in the picture, and centred."""
        yaw, pitch = np.radians(self.yaw), np.radians(self.pitch)
        forward = -np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
        tangent = float(np.tan(np.radians(self.angle) / 2))
        axes = _axes(forward)
        corners = np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)])
        right, up, ahead = axes @ corners.T
        # |across − r| ≤ t (ahead + d) for all corners bounds the distance d of the camera, whatever the shift r
        least = [0.3 - ahead.min()]
        for across, t in ((right, tangent * width / height), (up, tangent)):
            least.append((np.max(across - t * ahead) + np.max(-across - t * ahead)) / 2 / t)
        depth = ahead + max(least)
        position = _middle(right, depth) * axes[0] + _middle(up, depth) * axes[1] - max(least) * forward
        return Camera(position, forward, tangent, width, height)


def _middle(across: Array, depth: Array) -> float:
    """The shift of a camera from which points (N,) reach equally far to both sides of the picture; by bisection."""
    low, high = float(across.min()), float(across.max())
    for _ in range(50):
        middle = (low + high) / 2
        slope = (across - middle) / depth
        low, high = (middle, high) if slope.max() > -slope.min() else (low, middle)
    return (low + high) / 2


_HANDS = tuple(f"{side}{part}" for side in ("left", "right") for part in ("Hand", "Thumb", "Index", "Middle", "Little"))
_ARMS = (*_HANDS, "leftUpperArm", "rightUpperArm", "leftLowerArm", "rightLowerArm")
CAMERAS: dict[str, View] = {
    "body": View(("head", *_ARMS), (-0.50, 0.66, -0.15), (0.50, 1.82, 0.30), 0.06, 14, 3, 24),
    "full": View((), (-0.42, -0.05, -0.20), (0.42, 1.80, 0.30), 0.06, 14, 5, 22),
    "face": View(("head",), (-0.13, 1.42, -0.10), (0.13, 1.77, 0.14), 0.02, 12, 0, 18, "head"),
    "hands": View(_HANDS, (-0.32, 0.88, 0.00), (0.32, 1.34, 0.35), 0.06, 14, 8, 24),
}
"""Name → way of looking. Boxes are ours: what a standing speaker of 1.72 m uses while gesturing."""


def find_view(name: str | View) -> View:
    """Look up a view by its name; a `View` is returned as it is.

    Raises:
        InputError: there is none of that name.
    """
    if isinstance(name, View):
        return name
    if name not in CAMERAS:
        raise InputError(f"no camera called {name!r}", f"known: {', '.join(CAMERAS)}")
    return CAMERAS[name]


def _axes(forward: Array) -> Array:
    right = np.cross(forward, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])
