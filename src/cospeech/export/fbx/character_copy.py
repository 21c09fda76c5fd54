"""Copy somebody's FBX character with our motion: our clip replaces the clips of the file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...errors import InputError
from ...motion.motion import Motion
from ...motion.rotations import Array, quat_to_euler
from ..avatar import Avatar
from ..avatar_scene import AvatarTracks
from .curve_writer import PERCENT, AngleRecorder
from .document import FbxModel, Transform
from .node_writer import NodeWriter
from .scene_writer import DrivenProperty, SceneWriter, sort_axes
from .to_gltf import FbxFile
from .tree import Node

__all__ = ["CharacterCopy"]

_CLIP_KINDS = ("AnimationStack", "AnimationLayer", "AnimationCurveNode", "AnimationCurve")
_MOST = 1 << 62  # number of an object; new ones come after it; ours
_ALIKE = 1e-6  # difference below which places and turns are the same; ours


class CharacterCopy:
    """Gives a writer what it needs for motion on an FBX character; it has the same names as `FbxFigure`.

    Args:
        avatar: the character.

    Raises:
        InputError: it is no FBX.
    """

    def __init__(self, avatar: Avatar) -> None:
        if not isinstance(avatar.file, FbxFile):
            problem = f"{avatar.file.name} is no FBX, so it cannot be shown in one"
            raise InputError(problem, "name an .fbx character, or write a .glb")
        self._file, self._tracks = avatar.file, AvatarTracks(avatar)
        fbx = self._file.fbx
        self.axes: Mapping[str, int] = {
            name + sign: int(np.clip(fbx.settings.number_of(name + sign, 1 if sign else default), -1, 2))
            for name, default in (("UpAxis", 1), ("FrontAxis", 2), ("CoordAxis", 0)) for sign in ("", "Sign")
        }  # fmt: skip
        self.unit = fbx.settings.number_of("UnitScaleFactor", 1.0)
        self.last_number = max(fbx.objects, default=0)
        if self.last_number > _MOST:
            raise InputError(f"{fbx.name} has an object of number {self.last_number}", "export it again")
        self._entries = [entry for entry in fbx.objects.values() if entry.kind not in _CLIP_KINDS]
        self.kinds: Sequence[str] = tuple(dict.fromkeys(entry.kind for entry in self._entries))
        definitions = fbx.root.find("Definitions")
        self.templates: Mapping[str, Sequence[Node]] = {
            str(node.values[0]): [inner for inner in node.nodes if inner.name != "Count"]
            for node in ([] if definitions is None else definitions.all("ObjectType")) if node.values
        }  # fmt: skip
        self._joints = [self._file.models[node] for node in self._tracks.turning]
        self._angles = AngleRecorder([model.order for model in self._joints])
        self._shapes = {node: self._file.targets[node] for node in self._tracks.mesh_nodes}
        self._still = self._find_offset_bones()
        self._place_joints = self._find_placed_joints()
        self.widths = [3] * (len(self._place_joints) + len(self._joints) + 2 * len(self._still))
        self.widths += [1] * sum(map(len, self._shapes.values()))

    def _find_offset_bones(self) -> list[tuple[FbxModel, Transform]]:
        """Bones that do not move, and whose pose in the file is not the pose to which the skin is bound."""
        turning = {*self._tracks.turning}
        bones = []
        for node, (model, rest) in enumerate(zip(self._file.models, self._file.rest, strict=True)):
            own = model.rest
            far = max(np.abs(rest.translation - own.translation).max(), 1 - abs(float(rest.rotation @ own.rotation)))
            if node not in turning and far > _ALIKE:
                bones.append((model, rest))
        return bones

    def _find_placed_joints(self) -> list[int]:
        """Joints that need a place: the root, and those whose place in the file is not the place to which the skin is bound."""
        rests = [self._file.rest[node] for node in self._tracks.turning]
        return [
            k for k, (node, model, rest) in enumerate(zip(self._tracks.turning, self._joints, rests, strict=True))
            if node == self._tracks.root or np.abs(rest.translation - model.rest.translation).max() > _ALIKE
        ]  # fmt: skip

    def rows(self, motion: Motion) -> Array:
        """(T, sum of the widths) for a piece of motion of any skeleton that is recognised."""
        rotations, translation, weights = self._tracks.sample(motion)
        turns, columns = np.empty_like(rotations), list[Array]()
        for k, model in enumerate(self._joints):
            node = self._tracks.turning[k]
            where = translation if node == self._tracks.root else self._file.rest[node].translation
            place, turns[:, k] = model.properties_at(where, rotations[:, k])
            columns += [place] if k in self._place_joints else []
        columns.append(self._angles.degrees(turns).reshape(len(motion), -1))
        for model, rest in self._still:
            place, turn = model.properties_at(rest.translation, rest.rotation)
            angles = np.degrees(sort_axes(quat_to_euler(turn, model.order), model.order))
            columns.append(np.tile(np.concatenate([place, angles]), (len(motion), 1)))
        columns += [weights[node][:, : len(channels)] * PERCENT for node, channels in self._shapes.items()]
        return np.concatenate(columns, 1)

    def write(self, nodes: NodeWriter, scene: SceneWriter, name: str) -> list[DrivenProperty]:
        """Write its objects; give the properties that drive it."""
        for entry in self._entries:
            nodes.copy(entry.node)
            scene.counts[entry.kind] = scene.counts.get(entry.kind, 0) + 1
        channels = [_place_of(self._joints[k]) for k in self._place_joints]
        channels += [_turn_of(model) for model in self._joints]
        for model, _ in self._still:
            channels += [_place_of(model), _turn_of(model)]
        channels += [DrivenProperty.of_number(number, "DeformPercent") for own in self._shapes.values() for number in own]
        return channels

    def write_connections(self, nodes: NodeWriter) -> None:
        """Write the connections between the objects that are kept."""
        numbers = {0, *(entry.number for entry in self._entries)}
        for node in self._file.fbx.connections:
            if {value for value in node.values if isinstance(value, int)} <= numbers:  # names of properties may lie between
                nodes.copy(node)


def _place_of(model: FbxModel) -> DrivenProperty:
    return DrivenProperty.of_place(model.object.number, model.still[0])


def _turn_of(model: FbxModel) -> DrivenProperty:
    return DrivenProperty.of_turn(model.object.number, model.still[1])
