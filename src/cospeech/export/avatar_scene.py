"""Our motion on somebody's character: what moves, and a copy of its glTF document with the animation."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from ..errors import InputError
from ..motion.motion import Motion
from ..motion.rotations import Array
from ..motion.skeletons.arkit import ARKIT
from .avatar import EYES, Avatar, check_surface
from .clips import note_lost_clips
from .gltf import GltfFile
from .gltf_build import GltfBuilder
from .rig import local_matrices, rotation_of
from .tracks import GltfTrack

__all__ = ["AvatarScene", "AvatarTracks"]


class AvatarTracks:
    """The moving parts of an avatar, and their values for a motion.

    Args:
        avatar: the character.

    Attributes:
        turning: nodes that turn.
        root: the node that also moves; None for a head alone, which stays where it is.
        mesh_nodes: nodes of meshes with shapes.

    Raises:
        InputError: the character has no surface.

    Warns:
        CospeechWarning: its own clips are left out.
    """

    def __init__(self, avatar: Avatar) -> None:
        self._avatar, rig = avatar, avatar.rig
        check_surface(avatar.file)
        note_lost_clips(avatar.file)
        self._joints = sorted(rig.bones.values())
        self.turning = [rig.nodes[j] for j in self._joints]
        self.root = rig.nodes[0] if "hips" in rig.bones else None
        self.mesh_nodes = list(avatar.face.base)

    def sample(self, motion: Motion) -> tuple[Array, Array, dict[int, Array]]:
        """Put a piece of motion on the avatar; its skeleton may be any that is recognised.

        Returns:
            (T, J, 4) rotations of ``turning``, (T, 3) place of ``root``, and node → (T, n) weights of ``mesh_nodes``.
        """
        rig, face = self._avatar.rig, self._avatar.face
        body = motion if motion.skeleton is rig.skeleton else motion.retarget(rig.skeleton)
        turns = np.array(body.rotations, np.float64)
        if self._avatar.eyes_by_shapes and motion.face is not None:
            eyes = [rig.bones[name] for name in EYES if name in rig.bones]
            turns[:, eyes] = rig.skeleton.rest[eyes]
        rotations, translation = rig.local(turns, body.root)
        weights = face.weights(np.zeros((len(motion), len(ARKIT))) if motion.face is None else motion.face)
        return rotations[:, self._joints], translation, weights


class AvatarScene:
    """Gives a GLB writer what it needs for motion on an avatar: the document, its tracks, and rows of numbers for them."""

    def __init__(self, avatar: Avatar) -> None:
        self._moves = AvatarTracks(avatar)
        self.builder = _copy_without_animations(avatar.file)
        nodes = self.builder.json["nodes"]
        rest = local_matrices(avatar.file)
        for node in self._moves.turning:
            _open_for_animation(nodes[node], rest[node])
        self.tracks = [] if self._moves.root is None else [GltfTrack((self._moves.root,), "translation", 3)]
        self.tracks += [GltfTrack((node,), "rotation", 4) for node in self._moves.turning]
        self.tracks += [GltfTrack((node,), "weights", len(avatar.face.base[node])) for node in self._moves.mesh_nodes]

    def rows(self, motion: Motion) -> Array:
        """(T, sum of the tracks' widths) for a piece of motion of any skeleton that is recognised."""
        rotations, translation, weights = self._moves.sample(motion)
        columns = [] if self._moves.root is None else [translation]
        return np.concatenate([*columns, rotations.reshape(len(motion), -1), *weights.values()], 1)


def _copy_without_animations(file: GltfFile) -> GltfBuilder:
    """A document like that of ``file``; its data lies first in the new binary chunk, so that all its views stay valid."""
    document: dict[str, Any] = copy.deepcopy(file.json)
    document.pop("animations", None)
    data = bytes(file.buffer(0)) if file.list("buffers") else b""
    if document.get("buffers"):
        document["buffers"][0].pop("uri", None)
    return GltfBuilder(document, data)


def _open_for_animation(node: dict[str, Any], rest: Array) -> None:
    """Split the ``matrix`` of a node into translation, rotation and scale: animated nodes may not have one (glTF 5.25)."""
    if node.pop("matrix", None) is None:
        return
    scale = np.linalg.norm(rest[:3, :3], axis=0)
    if scale.min() < 1e-9:
        raise InputError(f"node {node.get('name')!r} has no size", "apply all scales before exporting")
    node |= {"translation": rest[:3, 3].tolist(), "rotation": rotation_of(rest).tolist(), "scale": scale.tolist()}
