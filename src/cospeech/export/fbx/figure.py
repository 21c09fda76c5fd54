"""The figure in an FBX of ours: the mannequin, or the bones of another skeleton."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...motion.motion import Motion
from ...motion.rotations import Array
from ...motion.skeleton import Skeleton, humanoid
from ...motion.skeletons.arkit import ARKIT
from .curve_writer import PERCENT, AngleRecorder
from .node_writer import NodeWriter
from .scene_writer import CENTIMETRES, FIRST_NUMBER, ORDER, DrivenProperty, SceneWriter, place_bones
from .tree import Node

__all__ = ["FbxFigure"]


class FbxFigure:
    """A skeleton; with the mannequin if the skeleton is ours.

    Args:
        skeleton: of the motion to come.

    Attributes:
        widths: numbers of each channel in a frame.
        kinds: of the objects that `write` makes.
    """

    axes: Mapping[str, int] = {
        "UpAxis": 1, "UpAxisSign": 1, "FrontAxis": 2, "FrontAxisSign": 1, "CoordAxis": 0, "CoordAxisSign": 1
    }  # fmt: skip
    """Which of the file's axes are up, front and left."""
    unit = 1.0
    """Centimetres in the file's unit."""
    last_number = FIRST_NUMBER
    """Numbers of new objects begin after it."""
    templates: Mapping[str, Sequence[Node]] = {}
    """Kind of objects → nodes of the properties that all of them have."""

    def __init__(self, skeleton: Skeleton) -> None:
        self._skeleton, ours = skeleton, humanoid()
        self._has_mannequin = skeleton.names == ours.names and np.allclose(skeleton.offsets, ours.offsets, atol=1e-6)
        self._has_face = self._has_mannequin
        self._angles = AngleRecorder([ORDER] * len(skeleton))
        self.widths = [3] * (1 + len(skeleton)) + [1] * len(ARKIT)
        self.kinds = ("NodeAttribute", "Pose", *(("Geometry", "Material", "Deformer") if self._has_mannequin else ()))

    def rows(self, motion: Motion) -> Array:
        """(T, sum of the widths) for a piece of motion."""
        self._has_face |= motion.face is not None
        face = np.zeros((len(motion), len(ARKIT))) if motion.face is None else motion.face
        angles = self._angles.degrees(motion.rotations).reshape(len(motion), -1)
        return np.concatenate([motion.root * CENTIMETRES, angles, face * (PERCENT if self._has_mannequin else 1)], 1)

    def write(self, nodes: NodeWriter, scene: SceneWriter, name: str) -> list[DrivenProperty]:
        """Write its objects; give the properties that drive it."""
        extra = ARKIT if self._has_face and not self._has_mannequin else ()
        bones, channels = scene.write_bones(self._skeleton, extra)
        worlds = place_bones(self._skeleton)
        poses = list(zip(bones, worlds, strict=True))
        if self._has_mannequin:
            from ..mannequin import build

            for mesh_name, parts in build().meshes():
                mesh, shapes = scene.write_mesh(mesh_name, parts, bones, worlds)
                poses.append((mesh, np.eye(4)))
                channels += shapes
        scene.write_pose(name, poses)
        return channels

    def write_connections(self, nodes: NodeWriter) -> None:
        """Write connections that are not in the scene: there are none."""
