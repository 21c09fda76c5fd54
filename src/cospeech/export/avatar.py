"""Somebody's character wearing our motion: reading it, and writing a copy of its file with the animation in it."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.rotations import Array
from ..motion.skeleton import Skeleton, humanoid
from ..motion.skeletons.arkit import ARKIT
from . import Writer as BaseWriter
from .bind_skeleton import read_node_names
from .clips import find_clip, note_lost_clips
from .face_rig import FaceRig, looks_turn_eyes, read_face
from .find_head import read_head
from .find_humanoid import read_rig
from .gltf import GltfFile, read_glb, report_damage
from .gltf_build import GltfBuilder
from .rig import Rig, local_matrices, rotation_of
from .tracks import GltfTrack, clock_of, read_animation

__all__ = ["Avatar", "AvatarScene", "check_surface", "load_avatar"]

_EYES = ("leftEye", "rightEye")


def load_avatar(path: str | PathLike[str], bone_map: Mapping[str, str] | None = None) -> Avatar:
    """Read a character: ``.vrm`` (1.0 and 0.x) by its humanoid, ``.glb`` by the names of its bones, or a head alone.

    Args:
        path: the file.
        bone_map: our name → name of a node, which wins over what is found; a map of other nodes changes nothing.

    Raises:
        InputError: not glTF, damaged, or without a humanoid that can be recognised and without a face.

    Warns:
        CospeechWarning: a part of the body is not there, and does not move.
    """
    file = read_glb(path)
    with report_damage(file.name):
        try:
            rig = read_rig(file, bone_map)
        except InputError:
            head = read_head(file, bone_map)
            if head is None:
                raise
            rig = head
        face = read_face(file, eyes_are_bones="leftEye" in rig.bones)
        eyes = {rig.nodes[rig.bones[name]] for name in _EYES if name in rig.bones}
        return Avatar(Path(path), file, rig, face, looks_turn_eyes(file, face, eyes) if eyes else True, dict(bone_map or {}))


@dataclass(frozen=True, eq=False)
class Avatar:
    """A character that can be driven.

    Args:
        path: its file.
        file: what was read from it.
        rig: its body.
        face: what moves its face.
        eyes_by_shapes: whether shapes turn its eyeballs; eye bones then rest, as both would turn them twice.
        bone_map: with which it was read.
    """

    path: Path
    file: GltfFile
    rig: Rig
    face: FaceRig
    eyes_by_shapes: bool
    bone_map: Mapping[str, str] = field(default_factory=dict)

    def __fspath__(self) -> str:
        """Its file, for writers of other packages that take the path of a character."""
        return str(self.path)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names that a map can have: those of the file's nodes."""
        return tuple(read_node_names(self.file))

    @property
    def skeleton(self) -> Skeleton:
        """Its bones from the hips down, metres, facing +Z, with the T-pose as ``rest``; of a head alone, what turns."""
        return self.rig.skeleton

    def describe(self) -> str:
        """One line: how many bones were found, and what the face is driven by."""
        face = {"": "no face that can be driven (body only)"}.get(self.face.alphabet, f"face by {self.face.alphabet} shapes")
        return f"{self.path.name}: {len(self.rig.bones)} of 55 bones, {face}"

    def animate(self, motion: Motion, path: str | PathLike[str]) -> None:
        """Write a copy of the character's file with ``motion`` as its only animation.

        Meshes, textures, materials and extensions are untouched; the motion is retargeted to its bones, the face to the best
        alphabet of shapes it has.

        Raises:
            InputError: the file cannot be written, or the motion's skeleton is not recognised.
        """
        from .glb import Writer

        writer: BaseWriter = Writer(path, skeleton=motion.skeleton, fps=motion.fps, avatar=self)
        with writer:
            writer.write(motion)

    def motion(self, animation: int | str | None = None) -> Motion:
        """One of the file's own animations, on the character's own bones.

        Args:
            animation: its name, or its number from 0; the first where not given.

        Raises:
            InputError: there is no such animation, or it is damaged.

        Warns:
            CospeechWarning: none was chosen, and there are several.
        """
        with report_damage(self.file.name):
            curves = read_animation(self.file, find_clip(self.file, animation))
            fps, times = clock_of(curves, self.file, max(self.rig.joints, len(humanoid())))
            rotations, root = self.rig.motion(curves, times)
            return Motion(fps=fps, rotations=rotations, root=root, face=self.face.face(curves, times), skeleton=self.skeleton)


class AvatarScene:
    """What a GLB writer needs to put motion on an avatar: the document, its tracks, and rows of numbers for them."""

    def __init__(self, avatar: Avatar) -> None:
        self.avatar = avatar
        rig, face = avatar.rig, avatar.face
        check_surface(avatar.file)
        note_lost_clips(avatar.file)
        self.joints = sorted(rig.bones.values())
        self.builder = _copy_without_animations(avatar.file)
        nodes = self.builder.json["nodes"]
        rest = local_matrices(avatar.file)
        for j in self.joints:
            _open_for_animation(nodes[rig.nodes[j]], rest[rig.nodes[j]])
        self._moves = "hips" in rig.bones  # a head alone stays where it is
        self.tracks = [GltfTrack((rig.nodes[0],), "translation", 3)] if self._moves else []
        self.tracks += [GltfTrack((rig.nodes[j],), "rotation", 4) for j in self.joints]
        self.tracks += [GltfTrack((node,), "weights", len(base)) for node, base in face.base.items()]

    def rows(self, motion: Motion) -> Array:
        """(T, sum of the tracks' widths) for a piece of motion of any skeleton that is recognised."""
        rig, face = self.avatar.rig, self.avatar.face
        body = motion if motion.skeleton is rig.skeleton else motion.retarget(rig.skeleton)
        turned = np.array(body.rotations, np.float64)
        if self.avatar.eyes_by_shapes and motion.face is not None:
            eyes = [rig.bones[name] for name in _EYES if name in rig.bones]
            turned[:, eyes] = rig.skeleton.rest[eyes]
        rotations, translation = rig.local(turned, body.root)
        columns = [translation] if self._moves else []
        columns.append(rotations[:, self.joints].reshape(len(motion), -1))
        weights = face.weights(np.zeros((len(motion), len(ARKIT))) if motion.face is None else motion.face)
        return np.concatenate([*columns, *weights.values()], 1)


def check_surface(file: GltfFile) -> None:
    """A character has something to see.

    Raises:
        InputError: it has not.
    """
    if not any("mesh" in node for node in file.list("nodes")):
        raise InputError(f"{file.name} has no surface that can be shown", "it is no character; name a .vrm or .glb with a mesh")


def _copy_without_animations(file: GltfFile) -> GltfBuilder:
    """A document like that of ``file``; its data lies first in the new binary chunk, so that all its views stay valid."""
    document: dict[str, Any] = copy.deepcopy(file.json)
    document.pop("animations", None)
    data = file.buffer(0) if file.list("buffers") else b""
    if document.get("buffers"):
        document["buffers"][0].pop("uri", None)
    return GltfBuilder(document, data)


def _open_for_animation(node: dict[str, Any], rest: Array) -> None:
    """Animated nodes may not have a ``matrix`` (glTF 5.25): say it as translation, rotation and scale."""
    if node.pop("matrix", None) is None:
        return
    scale = np.linalg.norm(rest[:3, :3], axis=0)
    if scale.min() < 1e-9:
        raise InputError(f"node {node.get('name')!r} has no size", "apply all scales before exporting")
    node |= {"translation": rest[:3, 3].tolist(), "rotation": rotation_of(rest).tolist(), "scale": scale.tolist()}
