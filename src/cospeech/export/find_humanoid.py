"""Finding the humanoid in a glTF file: by a VRM extension, else by the names and the shape of its nodes."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..limits import JOINTS
from ..motion.bone_mapping import recognise
from ..motion.rotations import quat_conjugate, quat_multiply, quat_rotate
from ..motion.skeleton import Skeleton, humanoid
from ..motion.skeletons.vrm import FROM_VRM0
from ..motion.tpose import with_tpose
from .gltf import GltfFile, report_damage
from .rig import Rig, rotation_of, world_matrices

__all__ = ["read_bone_names", "read_rig"]


def read_bone_names(file: GltfFile) -> dict[str, int] | None:
    """Humanoid name → node, as a VRM 1.0, VRM 0.x or VRMA extension says it; None where there is no such extension.

    VRM 0.x calls the three thumb bones otherwise; the result has VRM 1.0's names.
    """
    with report_damage(file.name):
        extensions = file.json.get("extensions", {})
        for key in ("VRMC_vrm", "VRMC_vrm_animation"):
            if key in extensions:
                bones = {name: bone["node"] for name, bone in extensions[key]["humanoid"]["humanBones"].items()}
                break
        else:
            if "VRM" not in extensions:
                return None
            listed = extensions["VRM"]["humanoid"]["humanBones"]
            bones = {FROM_VRM0.get(bone["bone"], bone["bone"]): bone["node"] for bone in listed}
        bones = {str(name): node for name, node in bones.items() if node != -1}  # -1: not set, in old VRM 0.x files
        if not all(isinstance(n, int) and 0 <= n < len(file.parents) for n in bones.values()) or "hips" not in bones:
            raise InputError(f"{file.name} is damaged: its humanoid names bones that are not there", "export it again")
        if len(set(bones.values())) != len(bones):
            raise InputError(f"{file.name} is damaged: its humanoid names a node twice", "export it again")
        return bones


def read_rig(file: GltfFile) -> Rig:
    """Find the humanoid of a file: by its VRM extension, else by the names and the shape of its nodes.

    Raises:
        InputError: there is no humanoid, or it is damaged.
    """
    told, ours = read_bone_names(file), humanoid()
    bones = told or _our_own(file) or _guess_bones(file)
    nodes = _below(file, bones["hips"], set(bones.values()))
    if set(ours.names) <= {file.list("nodes")[n].get("name") for n in nodes}:  # as in our own files
        by_name = {file.list("nodes")[n].get("name"): n for n in nodes}
        nodes = [by_name[name] for name in ours.names]
    bones = {name: nodes.index(node) for name, node in bones.items() if node in nodes}
    names = {} if told is None else {j: name for name, j in bones.items()}
    bind = _bind_skeleton(file, nodes, names, "custom" if told is None else "vrm")
    if bind.names == ours.names and np.allclose(bind.offsets, ours.offsets, atol=1e-5) and _is_still(bind):
        return Rig(file, tuple(nodes), ours, dict(ours.index), np.array([0.0, 0, 0, 1]), np.zeros(3))
    skeleton = with_tpose(bind, {name: bind.names[j] for name, j in bones.items()})
    facing = quat_multiply(skeleton.rest[0], quat_conjugate(bind.rest[0]))
    shift = skeleton.offsets[0] - quat_rotate(facing, bind.offsets[0])
    return Rig(file, tuple(nodes), skeleton, bones, facing, shift)


def _is_still(skeleton: Skeleton) -> bool:
    return bool(np.abs(skeleton.rest[:, 3]).min() > 1 - 1e-9)


def _guess_bones(file: GltfFile) -> dict[str, int]:
    """Humanoid name → node, from names and shape of the largest tree of bones."""
    order = _candidates(file, set())
    trees: list[list[int]] = []
    owner: dict[int, list[int]] = {}
    for k in order:
        tree = owner.get(file.parents[k])
        if tree is None:
            trees.append(tree := [])
        tree.append(k)
        owner[k] = tree
    if not trees:
        raise InputError(f"{file.name} holds no bones", "a rigged humanoid character is needed")
    nodes = max(trees, key=len)
    skeleton = _bind_skeleton(file, nodes, {}, "custom")
    names = recognise(skeleton)
    return {ours: nodes[skeleton.index[theirs]] for ours, theirs in names.items()}


def _our_own(file: GltfFile) -> dict[str, int] | None:
    """Humanoid name → node where every joint of ours is there under its own name."""
    by_name = {str(node.get("name")): k for k, node in enumerate(file.list("nodes"))}
    names = humanoid().names
    return {name: by_name[name] for name in names} if set(names) <= set(by_name) else None


def _candidates(file: GltfFile, wanted: set[int]) -> list[int]:
    """``wanted`` nodes and those that may be bones: joints of skins, else all nodes without a mesh; and what they hang on.

    Parents stand before children.
    """
    with report_damage(file.name):
        wanted = wanted | {int(joint) for skin in file.list("skins") for joint in skin["joints"]}
        if any(not 0 <= k < len(file.parents) for k in wanted):
            raise InputError(f"{file.name} is damaged: a skin names nodes that are not there", "export it again")
        if not file.list("skins"):
            wanted |= {k for k, node in enumerate(file.list("nodes")) if "mesh" not in node}
        for k in list(wanted):
            while (k := file.parents[k]) >= 0 and k not in wanted:
                wanted.add(k)
    order: list[int] = []
    stack = [k for k, parent in reversed(list(enumerate(file.parents))) if parent < 0]
    while stack:
        k = stack.pop()
        if k in wanted:
            order.append(k)
            stack += [child for child in reversed(file.list("nodes")[k].get("children", [])) if child in wanted]
    return order


def _below(file: GltfFile, hips: int, wanted: set[int]) -> list[int]:
    """The candidates from ``hips`` down, the hips first, parents before children."""
    inside, below = {hips}, [hips]
    for k in _candidates(file, wanted):
        if file.parents[k] in inside:
            inside.add(k)
            below.append(k)
    return below


def _bind_skeleton(file: GltfFile, nodes: list[int], names: dict[int, str], kind: str) -> Skeleton:
    """The skeleton of ``nodes`` in the file's own rest pose and axes; ``rest`` is that pose, T or not.

    ``names`` (joint → name) go before those of the file.

    Raises:
        InputError: the character is mirrored or of no size.
    """
    if len(nodes) > JOINTS:
        raise InputError(f"{file.name} has {len(nodes):,} joints", f"at most {JOINTS:,}; is this a character?")
    world = world_matrices(file)[nodes]
    if np.any(np.linalg.det(world[:, :3, :3]) <= 1e-18):
        raise InputError(f"{file.name} has a bone that is mirrored or has no size", "apply all scales before exporting")
    index = {node: k for k, node in enumerate(nodes)}
    turned, points = rotation_of(world), world[:, :3, 3]
    offsets, rest = points.copy(), turned.copy()
    parents = [index.get(file.parents[node], -1) for node in nodes]
    for k, parent in enumerate(parents):
        if parent >= 0:
            back = quat_conjugate(turned[parent])
            offsets[k] = quat_rotate(back, points[k] - points[parent])
            rest[k] = quat_multiply(back, turned[k])
    own = [str(file.list("nodes")[node].get("name") or f"node {node}") for node in nodes]
    return Skeleton(tuple(_unique(own, names)), tuple(parents), offsets, rest, kind=kind)


def _unique(own: list[str], given: dict[int, str]) -> list[str]:
    """``given`` names where there are, else ``own``, with a number behind those that are taken."""
    numbers = dict.fromkeys(given.values(), 1)  # name → the number that was tried last for it
    result = []
    for k, name in enumerate(own):
        fresh = given.get(k, name)
        while k not in given and fresh in numbers:
            numbers[name] = numbers.get(name, 1) + 1
            fresh = f"{name} {numbers[name]}"
        numbers.setdefault(fresh, 1)
        result.append(fresh)
    return result
