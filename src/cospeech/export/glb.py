"""Write our mannequin, moving, as a binary glTF file; read animated characters, ours and others.

A skin is always there (Blender makes Empties of bare nodes), morph targets carry ARKit's names in ``mesh.extras.targetNames``,
joints have identity rest rotations, rotations are keyed on every frame and translation on the hips only. Morph offsets are
sparse: most of a figure does not move when it blinks.
"""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..motion.motion import Motion
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT
from . import Writer as BaseWriter
from .avatar import Avatar, load_avatar, read_avatar
from .avatar_scene import AvatarScene
from .clips import MANNEQUIN_SKIN
from .gltf_build import GltfBuilder
from .surface import normalise_normals
from .to_humanoid import as_humanoid
from .tracks import GltfTrack, Recorder

if TYPE_CHECKING:
    from .mannequin import Character, Part

__all__ = ["Writer", "load"]

_ARRAY, _INDEX = 34962, 34963  # buffer targets of vertex attributes and of triangles


class Writer(BaseWriter):
    """Streams motion onto a character; tracks wait in a temporary file, so that hours of motion fit in memory.

    Args:
        character: a skinned figure on our humanoid, `cospeech.export.mannequin.build` where not given.
        avatar: somebody's character in place of ours: a ``.vrm`` or ``.glb`` file, or one that `load_avatar` has read.
    """

    _recorder: Recorder | None = None

    def __init__(
        self, path: str | PathLike[str], *, character: Character | None = None,
        avatar: Avatar | str | PathLike[str] | None = None, **common: Any,
    ) -> None:  # fmt: skip
        super().__init__(path, **common)
        self._character, self._avatar = character, avatar

    def _begin(self, temporary: Path) -> None:
        self._temporary = temporary
        self._scene = self._open_scene()
        self._recorder = Recorder(self._scene.tracks, self.fps, temporary.parent)

    def _open_scene(self) -> CharacterScene | AvatarScene:
        if self._avatar is not None:
            return AvatarScene(self._avatar if isinstance(self._avatar, Avatar) else load_avatar(self._avatar))
        if self._character is None:
            from .mannequin import build

            self._character = build()
        return CharacterScene(self._character)

    def _write(self, motion: Motion) -> None:
        assert self._recorder is not None
        self._recorder.add(self._scene.rows(motion))

    def _finish(self) -> None:
        assert self._recorder is not None
        self._recorder.append(self._scene.builder, "speech")
        with self._temporary.open("wb") as file:
            self._scene.builder.write(file)

    def _discard(self) -> None:
        if self._recorder is not None:
            self._recorder.close()


class CharacterScene:
    """Gives the writer what it needs for motion on a figure of ours: the document, its tracks, and rows of numbers for them."""

    def __init__(self, character: Character) -> None:
        self.builder, joints, self._faces = character_document(character)
        self.tracks = [GltfTrack((joints[0],), "translation", 3), *(GltfTrack((j,), "rotation", 4) for j in joints)]
        self.tracks += [GltfTrack(tuple(self._faces), "weights", len(ARKIT))] if self._faces else []

    def rows(self, motion: Motion) -> Array:
        """(T, sum of the tracks' widths) for a piece of motion of any skeleton that is recognised."""
        motion = as_humanoid(motion)
        columns = [motion.root, motion.rotations.reshape(len(motion), -1)]
        if self._faces:
            columns.append(np.zeros((len(motion), len(ARKIT))) if motion.face is None else motion.face)
        return np.concatenate(columns, 1)


def character_document(character: Character) -> tuple[GltfBuilder, list[int], list[int]]:
    """The still figure as a glTF document.

    Returns:
        the builder, the node of every joint of the skeleton, and the nodes of the meshes that have morph targets.
    """
    skeleton = character.skeleton
    builder = GltfBuilder({"asset": {"version": "2.0", "generator": "cospeech"}, "scene": 0})
    joints = list(range(len(skeleton)))
    for k, name in enumerate(skeleton.names):
        node: dict[str, Any] = {"name": name, "translation": skeleton.offsets[k].tolist()}
        if skeleton.children[k]:
            node["children"] = list(skeleton.children[k])
        builder.append("nodes", node)
    armature = builder.append("nodes", {"name": "cospeech", "children": [0]})
    bind = np.tile(np.eye(4, dtype=np.float32), (len(skeleton), 1, 1))
    bind[:, 3, :3] = -skeleton.tpose  # columns of the matrix lie one after another (glTF 3.6.2.2)
    inverse = builder.add(bind.reshape(-1, 16), "MAT4")
    builder.append("skins", {"name": MANNEQUIN_SKIN, "joints": joints, "inverseBindMatrices": inverse, "skeleton": 0})
    roots, faces = [armature], []
    for name, parts in character.meshes():
        mesh = _mesh(builder, name, parts)
        roots.append(builder.append("nodes", {"name": name, "mesh": mesh, "skin": 0}))
        if parts[0].morphs:
            faces.append(roots[-1])
    builder.json["scenes"] = [{"name": "cospeech", "nodes": roots}]
    return builder, joints, faces


def _mesh(builder: GltfBuilder, name: str, parts: list[Part]) -> int:
    mesh: dict[str, Any] = {"name": name, "primitives": [_primitive(builder, part) for part in parts]}
    if parts[0].morphs:
        mesh |= {"weights": [0.0] * len(ARKIT), "extras": {"targetNames": list(ARKIT)}}
    return builder.append("meshes", mesh)


def _primitive(builder: GltfBuilder, part: Part) -> dict[str, Any]:
    small = np.uint16 if len(part.vertices) < 65535 else np.uint32
    attributes = {
        "POSITION": builder.add(part.vertices.astype(np.float32), "VEC3", target=_ARRAY, bounds=True),
        "NORMAL": builder.add(normalise_normals(part.normals), "VEC3", target=_ARRAY),
        "JOINTS_0": builder.add(np.where(part.weights > 0, part.joints, 0).astype(np.uint8), "VEC4", target=_ARRAY),
        "WEIGHTS_0": builder.add(part.weights.astype(np.float32), "VEC4", target=_ARRAY),
    }
    colour = np.clip(np.asarray(part.colour, float), 0, 1)
    base = np.ones(3) if colour.ndim == 2 else colour
    if colour.ndim == 2:  # 16 bits: the values are linear, and 8 would band in the shadows
        rgba = np.concatenate([colour, np.ones((len(colour), 1))], 1)
        levels = np.round(rgba * 65535).astype(np.uint16)
        attributes["COLOR_0"] = builder.add(levels, "VEC4", target=_ARRAY, normalized=True)
    surface = {"baseColorFactor": [*base.tolist(), 1.0], "metallicFactor": 0.0, "roughnessFactor": float(part.roughness)}
    primitive: dict[str, Any] = {
        "attributes": attributes,
        "indices": builder.add(part.triangles.astype(small).reshape(-1, 1), "SCALAR", target=_INDEX),
        "material": builder.append("materials", {"name": part.name, "pbrMetallicRoughness": surface}),
    }
    if part.morphs:
        primitive["targets"] = _targets(builder, part.morphs, len(part.vertices))
    return primitive


def _targets(builder: GltfBuilder, morphs: Mapping[str, Array], vertices: int) -> list[dict[str, int]]:
    """All 52 targets in ARKit's order; those that do not move this part share one accessor."""
    none: int | None = None
    targets = []
    for name in ARKIT:
        if name in morphs:
            targets.append({"POSITION": builder.add_sparse(morphs[name])})
            continue
        none = builder.add_sparse(np.zeros((vertices, 3), np.float32)) if none is None else none
        targets.append({"POSITION": none})
    return targets


def load(path: str | PathLike[str], *, animation: int | str | None = None, bone_map: Mapping[str, str] | None = None) -> Motion:
    """Read the motion of an animated character: ours exactly, others' by the names of their bones.

    Args:
        path: a ``.glb`` with a skinned or named humanoid, or an ``.fbx``.
        animation: which of its animations, by name or number; the first where not given.
        bone_map: of `read_avatar`.

    Returns:
        motion on our humanoid for our own files, else on the character's own bones (from the hips down); the face where it
        can be read (`cospeech.export.face_reading`).

    Raises:
        InputError: damaged, without animation, or without a humanoid.
    """
    return read_avatar(path, bone_map).motion(animation)
