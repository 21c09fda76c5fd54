"""Make a `Character`, which can be drawn, from the body, the surfaces and the face of an `Avatar`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike

import numpy as np

from ..errors import InputError
from ..limits import AVATAR_METRES
from ..motion.rotations import Array
from ..motion.skeleton import Skeleton
from ..motion.skeletons.humanoid import HEIGHT
from .avatar import Avatar, read_avatar
from .avatar_mesh import MeshBaker
from .avatar_skeleton import pose_nodes, shape_humanoid
from .face_rig import FaceRig
from .gltf import report_damage
from .mannequin.character import Character, Part

__all__ = ["load_character"]

_STATURES = (1.2, 2.3)  # metres; ours: smaller and taller characters are drawn at our humanoid's height, others as they are
_SOLE = 5e-3  # metres; ours: soles that are nearer to the floor than that stay


def load_character(path: str | PathLike[str] | Avatar, bone_map: Mapping[str, str] | None = None) -> Character:
    """Read a character to draw: a ``.vrm`` or ``.glb`` with a humanoid, or a part of one.

    Args:
        path: the file, or what `load_avatar` has read from it.
        bone_map: of `read_avatar`.

    Returns:
        its skeleton has our 55 names and its own proportions; its soles are at height 0, and so would be the soles of a half
        body or of a head alone.

    Raises:
        InputError: it cannot be read, has no humanoid, or nothing that can be drawn.
    """
    avatar = path if isinstance(path, Avatar) else read_avatar(path, bone_map)
    with report_damage(avatar.file.name), np.errstate(all="ignore"):  # values that are not finite are refused later
        return _build(avatar)


def _build(avatar: Avatar) -> Character:
    drive = _Drive.of(avatar.face)
    names = {(node, target): name for name, (node, target) in zip(drive.names, drive.targets, strict=True)}
    by_node: dict[int, dict[int, str]] = {}
    for (node, target), name in names.items():
        by_node.setdefault(node, {})[target] = name
    tpose = pose_nodes(avatar)
    parts = MeshBaker(avatar.file, tpose, by_node, avatar.face.base).parts()
    if not parts:
        raise InputError(f"{avatar.file.name} has no surface that can be drawn", "a skinned character is needed")
    surface = np.concatenate([part.vertices for part in parts]).astype(np.float64)
    scale, lift = _place(parts, shape_humanoid(avatar.rig, surface))
    skeleton = shape_humanoid(avatar.rig, surface, scale, lift)
    final_parts = tuple(_move(part, scale, lift) for part in parts)
    _check(avatar.file.name, skeleton, final_parts)
    return Character(skeleton, final_parts, drive.names, drive.weights)


def _check(name: str, skeleton: Skeleton, parts: tuple[Part, ...]) -> None:
    """Check that all of the character stays near its middle, however it moves: the memory for shadows grows with its size."""
    middle = np.array([0.0, HEIGHT / 2, 0.0])
    far = [skeleton.tpose - middle, *(part.vertices - middle for part in parts)]
    far += [delta for part in parts for delta in part.morphs.values()]
    reach = float(np.max([np.abs(points).max() for points in far]))
    if not reach < AVATAR_METRES:  # also true of values that are not finite
        raise InputError(f"{name} reaches {reach:.3g} m beside its middle", "is it one character, its scales applied?")
    if not all(np.isfinite(part.normals).all() for part in parts):
        raise InputError(f"{name} is damaged: a surface has no direction", "export it again")


def _place(parts: list[Part], skeleton: Skeleton) -> tuple[float, float]:
    """The factor by which the character is drawn larger, and metres by which it is then lifted."""
    feet = [skeleton.index[side + part] for side in ("left", "right") for part in ("Foot", "Toes")]
    head = [skeleton.index["head"]]
    soles = min(_heights(parts, feet), default=float(skeleton.tpose[:, 1].min()))
    crown = max(_heights(parts, head), default=float(skeleton.tpose[:, 1].max()))
    stature = crown - soles
    if not stature > 1e-3:
        raise InputError("a character without height between soles and crown cannot be drawn", "is it a humanoid?")
    scale = 1.0 if _STATURES[0] < stature < _STATURES[1] else HEIGHT / stature
    return scale, -soles * scale if abs(soles * scale) > _SOLE else 0.0


def _heights(parts: list[Part], joints: list[int]) -> list[float]:
    """Heights, in metres, of all points that mostly follow one of the joints."""
    heights = []
    for part in parts:
        most = part.joints[np.arange(len(part.joints)), part.weights.argmax(1)]
        heights += part.vertices[np.isin(most, joints), 1].tolist()
    return heights


def _move(part: Part, scale: float, lift: float) -> Part:
    if scale == 1.0 and lift == 0.0:
        return part
    vertices = part.vertices * np.float32(scale) + np.array([0, lift, 0], np.float32)
    return replace(part, vertices=vertices, morphs={name: delta * np.float32(scale) for name, delta in part.morphs.items()})


@dataclass(frozen=True, eq=False)
class _Drive:
    """Turns ARKit's weights into weights of the character's own shapes.

    Args:
        face: what moves its face.
        targets: (mesh node, morph target) of each shape.
    """

    face: FaceRig
    targets: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, face: FaceRig) -> _Drive:
        return cls(face, tuple(sorted({(bind.node, bind.target) for bind in face.binds})))

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"node {node} target {target}" for node, target in self.targets)

    def weights(self, arkit: Array) -> Array:
        """(S,) weights beyond those at rest, for ARKit's (52,)."""
        by_node = self.face.weights(np.asarray(arkit, float)[None])
        return np.array([by_node[node][0, target] - self.face.base[node][target] for node, target in self.targets])
