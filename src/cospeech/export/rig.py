"""The humanoid in a glTF file: the node of each bone, its rest pose, and its animation as motion.

Node trees come with scales (centimetres under a node of 0.01), rotated ancestors (Blender's −90° about X), matrices in place
of TRS, and bones below other nodes. A `Rig` resolves all that: its skeleton is the tree from the hips down, in metres and
world axes, the character facing +Z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InputError
from ..limits import GLTF_NODES
from ..motion.rotations import (  # fmt: skip
    Array,
    make_continuous,
    matrix_to_quat,
    quat_conjugate,
    quat_multiply,
    quat_normalize,
    quat_rotate,
    quat_to_matrix,
)
from ..motion.skeleton import Skeleton
from .gltf import GltfFile, report_damage
from .tracks import Curve

__all__ = ["Rig", "local_matrices", "rotation_of", "world_matrices"]


def local_matrices(file: GltfFile) -> Array:
    """(N, 4, 4) local matrices of all nodes, from ``matrix`` or TRS (5.25)."""
    nodes = file.list("nodes")
    if len(nodes) > GLTF_NODES:
        raise InputError(f"{file.name} has {len(nodes)} nodes", "is this a character?")
    matrices = np.tile(np.eye(4), (len(nodes), 1, 1))
    with report_damage(file.name):
        for k, node in enumerate(nodes):
            if "matrix" in node:
                matrices[k] = np.array(node["matrix"], float).reshape(4, 4).T
                continue
            q = np.array(node.get("rotation", (0, 0, 0, 1)), float).reshape(4)
            scale = np.array(node.get("scale", (1, 1, 1)), float).reshape(3)
            matrices[k, :3, :3] = quat_to_matrix(quat_normalize(q)) * scale
            matrices[k, :3, 3] = np.array(node.get("translation", (0, 0, 0)), float).reshape(3)
        if not (np.isfinite(matrices).all() and np.abs(matrices).max(initial=0) < 1e6):
            raise InputError(f"{file.name} is damaged: a node's transform is not finite", "export it again")
    return matrices


def world_matrices(file: GltfFile) -> Array:
    """(N, 4, 4) world matrices of all nodes in the file's rest pose."""
    world, is_done = local_matrices(file), [parent < 0 for parent in file.parents]
    for k in range(len(world)):
        path = []
        while not is_done[k]:
            path.append(k)
            k = file.parents[k]
        for child in reversed(path):
            world[child] = world[file.parents[child]] @ world[child]
            is_done[child] = True
    return world


@dataclass(frozen=True, eq=False)
class Rig:
    """The nodes of a character's body.

    Args:
        file: the glTF file.
        nodes: J nodes of the skeleton's joints, the hips first, parents before children; of a head alone, the node that turns
            comes first.
        skeleton: in world axes and metres, turned to face +Z, ``rest`` is its T-pose; rotations are the nodes' own local
            rotations, except that the root's are world rotations.
        bones: humanoid name → joint of the skeleton.
        facing: (4,) turns the file's own world to face +Z; half a turn for VRM 0.x.
        shift: (3,) metres from the hips of the file, facing +Z, to those of the skeleton, whose feet are on the floor.
    """

    file: GltfFile
    nodes: tuple[int, ...]
    skeleton: Skeleton
    bones: dict[str, int]
    facing: Array
    shift: Array

    @cached_property
    def _above(self) -> Array:
        """(4, 4) world matrix of the parent of the hips."""
        parent = self.file.parents[self.nodes[0]]
        return world_matrices(self.file)[parent] if parent >= 0 else np.eye(4)

    def local(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """Values for keys: (T, J, 4) local rotations and (T, 3) translations of the hips node, for motion of our `skeleton`."""
        undo = quat_conjugate(self.facing)
        above = rotation_of(self._above)
        hips = quat_multiply(quat_conjugate(above), quat_multiply(undo, rotations[:, 0]))
        local = np.concatenate([hips[:, None], rotations[:, 1:]], 1)
        back = np.linalg.inv(self._above)
        return local, quat_rotate(undo, root - self.shift) @ back[:3, :3].T + back[:3, 3]

    @cached_property
    def joints(self) -> int:
        """How many transforms a frame of motion takes: of the joints, and of the ancestors of the hips."""
        above, node = 0, self.file.parents[self.nodes[0]]
        while node >= 0:
            above, node = above + 1, self.file.parents[node]
        return len(self.nodes) + above

    def motion(self, curves: dict[tuple[int, str], Curve], times: Array) -> tuple[Array, Array]:
        """Rotations (T, J, 4) and root (T, 3) of our `skeleton` at ``times (T,)`` seconds of an animation."""
        frames = len(times)
        rotations = np.empty((frames, len(self.nodes), 4))
        rest = local_matrices(self.file)
        for j, node in enumerate(self.nodes[1:], 1):
            curve = curves.get((node, "rotation"))
            rotations[:, j] = curve.at(times) if curve is not None else rotation_of(rest[node])
        world = np.tile(np.eye(4), (frames, 1, 1))
        path, node = [], self.nodes[0]
        while node >= 0:
            path.append(node)
            node = self.file.parents[node]
        for node in reversed(path):
            world = world @ _animate(self.file.list("nodes")[node], node, rest[node], curves, times)
        rotations[:, 0] = quat_multiply(self.facing, rotation_of(world))
        return make_continuous(rotations), quat_rotate(self.facing, world[:, :3, 3]) + self.shift


def rotation_of(matrices: Array) -> Array:
    """Quaternions of (..., 4, 4) matrices, without their scale."""
    basis = matrices[..., :3, :3]
    return matrix_to_quat(basis / np.maximum(np.linalg.norm(basis, axis=-2, keepdims=True), 1e-12))


def _animate(entry: dict[str, Any], node: int, rest: Array, curves: dict[tuple[int, str], Curve], times: Array) -> Array:
    """(T, 4, 4) local matrices of a node; the rest matrix where nothing moves it."""
    if not any((node, path) in curves for path in ("rotation", "translation", "scale")):
        return np.broadcast_to(rest, (len(times), 4, 4))
    out = np.tile(rest, (len(times), 1, 1))
    turn, size = curves.get((node, "rotation")), curves.get((node, "scale"))
    if turn is not None or size is not None:
        q = turn.at(times) if turn is not None else np.broadcast_to(rotation_of(rest), (len(times), 4))
        scale = size.at(times) if size is not None else np.broadcast_to(entry.get("scale", (1, 1, 1)), (len(times), 3))
        out[:, :3, :3] = quat_to_matrix(q) * scale[:, None, :]
    if (node, "translation") in curves:
        out[:, :3, 3] = curves[node, "translation"].at(times)
    return out
