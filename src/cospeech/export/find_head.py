"""Find the head in a glTF file that holds a face and no body: a bone of its skin, or a node that turns all meshes."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..errors import CospeechWarning
from ..motion.bone_map_checks import names_joints
from ..motion.bone_mapping import by_names
from ..motion.limbs import may_have_limbs
from ..motion.rotations import Array, quat_identity
from ..motion.skeleton import Skeleton
from .bind_skeleton import bind_skeleton, find_below, find_candidates, find_trees, read_node_names
from .face_rig import read_face
from .find_humanoid import read_bone_names
from .gltf import COMPONENTS, GltfFile
from .rig import Rig, world_matrices

__all__ = ["read_head"]

_JOINTS = ("neck", "head", "leftEye", "rightEye", "jaw")
_BESIDE = 0.25  # ours: a node can turn in its place if it is no farther from its surface than this share of the surface's size


def read_head(file: GltfFile, bone_map: Mapping[str, str] | None = None) -> Rig | None:
    """Find the parts of a head without a body that turn.

    Bones of a skin turn if they are called head, neck and eyes. Without a skin, the node called head turns, or the nearest
    ancestor that carries all meshes, if it lies in or near them; so do eyes. Else only the face moves: there are no ``bones``.

    Args:
        file: the glTF file.
        bone_map: our name → name of a node; a map of other nodes changes nothing.

    Returns:
        None where no shape of a face can be driven, or where names or shape suggest that there are arms or legs.

    Warns:
        CospeechWarning: the body is not there.
    """
    face = read_face(file, eyes_are_bones=False)
    if read_bone_names(file) is not None or not face.binds:
        return None
    by_name = read_node_names(file)
    names = {node: name for name, node in by_name.items()}
    overrides = dict(bone_map) if bone_map and names_joints(bone_map, by_name) else {}
    has_skin = bool(file.list("skins"))
    bones: dict[str, int] = {}
    for tree in find_trees(file, set() if has_skin else {*range(len(file.parents))}):
        skeleton = _without_surfaces(file, tree, bind_skeleton(file, tree, dict(enumerate(names[k] for k in tree)), "custom"))
        matches = {ours: theirs for ours, theirs in by_names(skeleton).items() if ours not in overrides} | overrides
        matches = {ours: theirs for ours, theirs in matches.items() if theirs in skeleton.index}
        if may_have_limbs(skeleton, matches):
            return None
        if "head" in matches and "head" not in bones:
            bones = {ours: by_name[matches[ours]] for ours in _JOINTS if ours in matches}
    bones = _drop_what_tears(file, bones) if has_skin else _turning_nodes(file, bones)
    top = next(iter(bones.values()), face.binds[0].node)
    nodes = find_below(file, top, {top, *bones.values()})
    bones = {ours: node for ours, node in bones.items() if node in nodes}
    skeleton = bind_skeleton(file, nodes, dict(enumerate(names[k] for k in nodes)), "custom")
    joint_names = {ours: names[node] for ours, node in bones.items()} or {"head": ""}
    moves = "head and face move" if bones else "its face moves, its head does not turn"
    warnings.warn(f"{file.name} has no body: {moves}", CospeechWarning, stacklevel=2)
    joints = {ours: nodes.index(node) for ours, node in bones.items()}
    return Rig(file, tuple(nodes), replace(skeleton, bone_map=joint_names), joints, quat_identity(), np.zeros(3))


def _without_surfaces(file: GltfFile, nodes: list[int], skeleton: Skeleton) -> Skeleton:
    """The same skeleton, with offset 0 for leaf nodes that only hold a mesh: their distance says nothing about a limb."""
    offsets = skeleton.offsets.copy()
    entries = file.list("nodes")
    offsets[[k for k, node in enumerate(nodes) if k and "mesh" in entries[node] and not entries[node].get("children")]] = 0
    return replace(skeleton, offsets=offsets)


def _drop_what_tears(file: GltfFile, bones: dict[str, int]) -> dict[str, int]:
    """Drop all bones where a mesh without a skin does not follow the head: it would stay behind."""
    counts = _count_meshes(file)
    return bones if counts[next(iter(bones.values()), -1)] == counts[-1] else {}


def _turning_nodes(file: GltfFile, bones: dict[str, int]) -> dict[str, int]:
    """In a file without a skin: the node that turns as the head, and eyes that turn in their places."""
    node, counts = bones.get("head", -1), _count_meshes(file)
    while counts[node] < counts[-1]:
        node = file.parents[node]
    if node < 0 or not _turns_in_place(file, node):
        return {}
    eyes = {ours: eye for ours, eye in bones.items() if ours.endswith("Eye") and _turns_in_place(file, eye)}
    return {"head": node} | eyes


def _count_meshes(file: GltfFile) -> list[int]:
    """How many meshes without a skin are at or below each node; the last number is that of the whole file."""
    counts = [int("mesh" in node and "skin" not in node) for node in file.list("nodes")] + [0]
    for node in reversed(find_candidates(file, {*range(len(file.parents))})):
        counts[file.parents[node]] += counts[node]  # the parent of a root is the last
    return counts


def _turns_in_place(file: GltfFile, node: int) -> bool:
    """Whether a node lies in the box of the meshes at and below it, or near it."""
    world, entries = world_matrices(file), file.list("nodes")
    below = find_below(file, node, {*range(len(entries))})
    boxes = [_box(file, k, world[k]) for k in below if "mesh" in entries[k] and "skin" not in entries[k]]
    if not boxes:
        return False
    corners = np.concatenate(boxes)
    low, high = corners.min(0), corners.max(0)
    room = _BESIDE * (high - low).max()
    return bool(((world[node, :3, 3] >= low - room) & (world[node, :3, 3] <= high + room)).all())


def _box(file: GltfFile, node: int, matrix: Array) -> Array:
    """(C, 3) corners of boxes around a mesh, in the world, by the bounds in its file."""
    corners = []
    for primitive in file.list("meshes")[file.list("nodes")[node]["mesh"]]["primitives"]:
        entry = file.list("accessors")[primitive["attributes"]["POSITION"]]
        ends = np.array([entry["min"], entry["max"]], float).reshape(2, 3)
        if entry.get("normalized"):
            ends /= np.iinfo(COMPONENTS[entry["componentType"]]).max
        corners += [[ends[k >> axis & 1, axis] for axis in range(3)] for k in range(8)]
    return np.array(corners) @ matrix[:3, :3].T + matrix[:3, 3]
