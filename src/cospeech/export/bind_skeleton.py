"""The nodes of a glTF file that may be bones, their names, and the skeleton that they make in the file's own rest pose."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..limits import JOINTS
from ..motion.rotations import quat_conjugate, quat_multiply, quat_rotate
from ..motion.skeleton import Skeleton
from .gltf import GltfFile, report_damage
from .rig import rotation_of, world_matrices

__all__ = ["bind_skeleton", "find_below", "find_candidates", "find_trees", "read_node_names"]


def read_node_names(file: GltfFile) -> dict[str, int]:
    """Name → node, of all nodes that a map can name. Of two with one name, a bone keeps it, the other gets a number."""
    order = find_candidates(file, set())
    order += sorted({*range(len(file.parents))} - {*order})
    return dict(zip(_unique([_name_of(file, node) for node in order], {}), order, strict=True))


def find_candidates(file: GltfFile, nodes: set[int]) -> list[int]:
    """``nodes``, those that may be bones (joints of skins, else all nodes without a mesh), and all their ancestors.

    Parents come before children.
    """
    with report_damage(file.name):
        nodes = nodes | {int(joint) for skin in file.list("skins") for joint in skin["joints"]}
        if any(not 0 <= k < len(file.parents) for k in nodes):
            raise InputError(f"{file.name} is damaged: a skin names nodes that are not there", "export it again")
        if not file.list("skins"):
            nodes |= {k for k, node in enumerate(file.list("nodes")) if "mesh" not in node}
        for k in list(nodes):
            while (k := file.parents[k]) >= 0 and k not in nodes:
                nodes.add(k)
    order: list[int] = []
    stack = [k for k, parent in reversed(list(enumerate(file.parents))) if parent < 0]
    while stack:
        k = stack.pop()
        if k in nodes:
            order.append(k)
            stack += [child for child in reversed(file.list("nodes")[k].get("children", [])) if child in nodes]
    return order


def find_trees(file: GltfFile, nodes: set[int]) -> list[list[int]]:
    """The candidates, one list for each tree."""
    owner: dict[int, list[int]] = {}
    trees: list[list[int]] = []
    for node in find_candidates(file, nodes):
        tree = owner.get(file.parents[node])
        if tree is None:
            trees.append(tree := [])
        tree.append(node)
        owner[node] = tree
    return trees


def find_below(file: GltfFile, hips: int, nodes: set[int]) -> list[int]:
    """The candidates from ``hips`` down, the hips first, parents before children."""
    inside, below = {hips}, [hips]
    for k in find_candidates(file, nodes):
        if file.parents[k] in inside:
            inside.add(k)
            below.append(k)
    return below


def bind_skeleton(file: GltfFile, nodes: list[int], names: dict[int, str], kind: str) -> Skeleton:
    """The skeleton of ``nodes`` in the file's own rest pose and axes; ``rest`` is that pose, T or not.

    ``names`` (joint → name) replace those of the file.

    Raises:
        InputError: the character is mirrored or of no size.
    """
    if len(nodes) > JOINTS:
        raise InputError(f"{file.name} has {len(nodes):,} joints", f"at most {JOINTS:,}; is this a character?")
    world = world_matrices(file)[nodes]
    if np.any(np.linalg.det(world[:, :3, :3]) <= 1e-18):
        raise InputError(f"{file.name} has a bone that is mirrored or has no size", "apply all scales before exporting")
    index = {node: k for k, node in enumerate(nodes)}
    turns, points = rotation_of(world), world[:, :3, 3]
    offsets, rest = points.copy(), turns.copy()
    parents = [index.get(file.parents[node], -1) for node in nodes]
    for k, parent in enumerate(parents):
        if parent >= 0:
            back = quat_conjugate(turns[parent])
            offsets[k] = quat_rotate(back, points[k] - points[parent])
            rest[k] = quat_multiply(back, turns[k])
    own = [_name_of(file, node) for node in nodes]
    return Skeleton(tuple(_unique(own, names)), tuple(parents), offsets, rest, kind=kind)


def _name_of(file: GltfFile, node: int) -> str:
    return str(file.list("nodes")[node].get("name") or f"node {node}")


def _unique(own: list[str], names: dict[int, str]) -> list[str]:
    """``names`` where there are some, else ``own``; a name that is taken gets a number."""
    numbers = dict.fromkeys(names.values(), 1)  # name → the number that was tried last for it
    result = []
    for k, name in enumerate(own):
        fresh = names.get(k, name)
        while k not in names and fresh in numbers:
            numbers[name] = numbers.get(name, 1) + 1
            fresh = f"{name} {numbers[name]}"
        numbers.setdefault(fresh, 1)
        result.append(fresh)
    return result
