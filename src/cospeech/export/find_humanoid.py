"""Find the humanoid in a glTF file: by a VRM extension, else by the names and the shape of its nodes; a map overrides both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..motion.bone_map_checks import check_names, names_joints
from ..motion.bone_mapping import REQUIRED, recognise_file
from ..motion.limbs import LIMBS, drop_loose_ends, note_absent_limbs
from ..motion.rotations import quat_conjugate, quat_multiply, quat_rotate
from ..motion.skeleton import Skeleton, humanoid
from ..motion.skeletons.vrm import FROM_VRM0
from ..motion.tpose import with_tpose
from .bind_skeleton import bind_skeleton, find_below, find_trees, read_node_names
from .gltf import GltfFile, report_damage
from .rig import Rig

__all__ = ["read_bone_names", "read_rig"]


def read_bone_names(file: GltfFile) -> dict[str, int] | None:
    """Humanoid name → node, from a VRM 1.0, VRM 0.x or VRMA extension; None where there is no such extension.

    VRM 0.x has other names for the three thumb bones; the result has VRM 1.0's names.
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
            entries = extensions["VRM"]["humanoid"]["humanBones"]
            bones = {FROM_VRM0.get(bone["bone"], bone["bone"]): bone["node"] for bone in entries}
        bones = {str(name): node for name, node in bones.items() if node != -1}  # -1: not set, in old VRM 0.x files
        if not all(isinstance(n, int) and 0 <= n < len(file.parents) for n in bones.values()) or "hips" not in bones:
            raise InputError(f"{file.name} is damaged: its humanoid names bones that are not there", "export it again")
        if len(set(bones.values())) != len(bones):
            raise InputError(f"{file.name} is damaged: its humanoid names a node twice", "export it again")
        return bones


def read_rig(file: GltfFile, bone_map: Mapping[str, str] | None = None) -> Rig:
    """Find the humanoid of a file: by its VRM extension, else by the names and the shape of its nodes.

    Args:
        file: the glTF file.
        bone_map: our name → name of a node; it overrides what is found. A map of other nodes changes nothing.

    Raises:
        InputError: there is no humanoid, or it is damaged.

    Warns:
        CospeechWarning: there are no arms or no legs.
    """
    vrm_bones, ours = read_bone_names(file), humanoid()
    by_name = read_node_names(file) if bone_map else {}
    overrides = dict(bone_map) if bone_map and names_joints(bone_map, by_name) else {}
    own_bones = vrm_bones or (None if overrides else _our_own(file))
    if own_bones is None:
        bones = _guess_bones(file, overrides, by_name, None if overrides else bone_map)
    else:
        bones = drop_loose_ends(_choose_bones(file, own_bones, overrides, by_name))
        note_absent_limbs(bones, file.name)
    nodes = find_below(file, bones["hips"], set(bones.values()))
    if set(ours.names) <= {file.list("nodes")[n].get("name") for n in nodes}:  # as in our own files
        places = {file.list("nodes")[n].get("name"): n for n in nodes}
        nodes = [places[name] for name in ours.names]
    bones = {name: nodes.index(node) for name, node in bones.items() if node in nodes}
    names = {} if vrm_bones is None else {j: name for name, j in bones.items()}
    bind = bind_skeleton(file, nodes, names, "custom" if vrm_bones is None else "vrm")
    if not overrides and bind.names == ours.names and np.allclose(bind.offsets, ours.offsets, atol=1e-5) and _is_still(bind):
        return Rig(file, tuple(nodes), ours, dict(ours.index), np.array([0.0, 0, 0, 1]), np.zeros(3))
    matches = {name: bind.names[j] for name, j in bones.items()}
    skeleton = with_tpose(replace(bind, bone_map=matches), matches)
    facing = quat_multiply(skeleton.rest[0], quat_conjugate(bind.rest[0]))
    shift = skeleton.offsets[0] - quat_rotate(facing, bind.offsets[0])
    return Rig(file, tuple(nodes), skeleton, bones, facing, shift)


def _is_still(skeleton: Skeleton) -> bool:
    return bool(np.abs(skeleton.rest[:, 3]).min() > 1 - 1e-9)


def _choose_bones(
    file: GltfFile, bones: Mapping[str, int], overrides: Mapping[str, str], by_name: Mapping[str, int]
) -> dict[str, int]:
    """Humanoid name → node: the file's own ``bones``, and those that a map has chosen instead."""
    names = check_names(overrides, by_name)
    nodes = {ours: by_name[theirs] for ours, theirs in names.items() if theirs}
    rest = {ours: node for ours, node in bones.items() if ours not in names and node not in nodes.values()}
    missing = [ours for ours in REQUIRED if ours in bones and ours not in rest | nodes]
    if missing:
        raise InputError(f"{file.name}: the map takes the joint of {missing[0]}", f"name another joint for {missing[0]} too")
    return rest | nodes


def _guess_bones(
    file: GltfFile, overrides: Mapping[str, str], by_name: Mapping[str, int], unfit: Mapping[str, str] | None
) -> dict[str, int]:
    """Humanoid name → node, from a map, and names and shape of the largest tree of bones."""
    labels = {by_name[theirs]: theirs for theirs in overrides.values() if theirs}
    trees = find_trees(file, {*labels})
    if not trees:
        raise InputError(f"{file.name} holds no bones", "a rigged humanoid character is needed")
    nodes = max(trees, key=lambda tree: (len({*labels} & {*tree}), len(tree)))
    skeleton = bind_skeleton(file, nodes, {k: labels[node] for k, node in enumerate(nodes) if node in labels}, "custom")
    names = recognise_file(skeleton, overrides, file.name, unfit, may_lack=LIMBS)
    bones = {ours: nodes[skeleton.index[theirs]] for ours, theirs in names.items()}
    below = find_below(file, bones["hips"], {*bones.values()})
    beside = [ours for ours in REQUIRED if ours in bones and bones[ours] not in below]
    if beside:
        problem = f"{file.name}: {beside[0]} = {names[beside[0]]!r} is not below hips = {names['hips']!r}"
        raise InputError(problem, "name as hips the joint from which legs and spine go out")
    return bones


def _our_own(file: GltfFile) -> dict[str, int] | None:
    """Humanoid name → node where every joint of ours is there under its own name."""
    by_name = {str(node.get("name")): k for k, node in enumerate(file.list("nodes"))}
    names = humanoid().names
    return {name: by_name[name] for name in names} if set(names) <= set(by_name) else None
