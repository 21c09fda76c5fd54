"""Somebody's character: its body, its face, and its own animations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path

from ..errors import InputError
from ..motion.bone_map_checks import check_fit
from ..motion.motion import Motion
from ..motion.skeleton import Skeleton, humanoid
from . import Writer as BaseWriter
from .bind_skeleton import read_node_names
from .character_files import read_character
from .clips import find_clip
from .face_rig import FaceRig, looks_turn_eyes, read_face
from .find_head import read_head
from .find_humanoid import read_rig
from .gltf import GltfFile, report_damage
from .rig import Rig
from .tracks import clock_of, read_animation

__all__ = ["EYES", "Avatar", "check_surface", "load_avatar", "read_avatar"]

EYES = ("leftEye", "rightEye")


def load_avatar(path: str | PathLike[str], bone_map: Mapping[str, str] | None = None) -> Avatar:
    """Read a character: ``.vrm`` (1.0 and 0.x) by its humanoid, ``.glb`` and ``.fbx`` by the names of its bones, or a head
    alone.

    Args:
        path: the file.
        bone_map: our name → name of a node; it overrides what is found.

    Raises:
        InputError: not a character file, damaged, or without a humanoid that can be recognised and without a face; or the map
            names nodes that the file lacks.

    Warns:
        CospeechWarning: a part of the body is not there, and does not move.
    """
    avatar = read_avatar(path, bone_map)
    if bone_map:
        check_fit(bone_map, {repr(str(path)): avatar.joints})
    return avatar


def read_avatar(path: str | PathLike[str], bone_map: Mapping[str, str] | None = None) -> Avatar:
    """As `load_avatar`; a map of other nodes changes nothing."""
    file = read_character(path)
    with report_damage(file.name):
        try:
            rig = read_rig(file, bone_map)
        except InputError:
            head = read_head(file, bone_map)
            if head is None:
                raise
            rig = head
        face = read_face(file, eyes_are_bones="leftEye" in rig.bones)
        eyes = {rig.nodes[rig.bones[name]] for name in EYES if name in rig.bones}
        return Avatar(Path(path), file, rig, face, looks_turn_eyes(file, face, eyes) if eyes else True, dict(bone_map or {}))


@dataclass(frozen=True, eq=False)
class Avatar:
    """A character that can be driven.

    Args:
        path: its file.
        file: its content.
        rig: its body.
        face: what moves its face.
        eyes_by_shapes: whether shapes turn its eyeballs; then eye bones rest, because both would turn them twice.
        bone_map: the map with which it was read.
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
        """Names that a map may use: those of the file's nodes."""
        return tuple(read_node_names(self.file))

    @property
    def skeleton(self) -> Skeleton:
        """Its bones from the hips down, metres, facing +Z, with the T-pose as ``rest``; of a head alone, what turns."""
        return self.rig.skeleton

    def describe(self) -> str:
        """One line: how many bones were found, and which shapes drive the face."""
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


def check_surface(file: GltfFile) -> None:
    """Check that a character has a surface.

    Raises:
        InputError: it has none.
    """
    if not any("mesh" in node for node in file.list("nodes")):
        raise InputError(
            f"{file.name} has no surface that can be shown", "it is no character; name a .vrm, .glb or .fbx with a mesh"
        )
