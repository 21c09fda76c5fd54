"""The body of somebody's character with our 55 joints: its proportions, our names, no rest rotations.

A bone that is not ours, a twist bone or a strand of hair say, moves with the nearest bone above it that is. A joint of ours
that the character lacks is put where our humanoid has it, at the character's size; no surface follows it. Where limbs or the
whole body are missing, ``bone_map`` of the skeleton is ``""`` for all joints that do not move.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..motion.limbs import LIMBS
from ..motion.rotations import Array, quat_conjugate, quat_multiply, quat_to_matrix
from ..motion.skeleton import Skeleton, humanoid
from ..motion.skeletons.humanoid import HEIGHT
from .avatar import Avatar
from .rig import Rig, rotation_of, world_matrices

__all__ = ["TPose", "pose_nodes", "shape_humanoid"]

_HEAD = 0.30  # metres; ours: a head alone ends in the neck, this far below the crown of our humanoid
_SPINE = ("spine", "chest", "upperChest")
_EYES = ("leftEye", "rightEye")


@dataclass(frozen=True, eq=False)
class TPose:
    """A character in its T-pose, facing +Z.

    Args:
        matrices: (N, 4, 4) world matrices of all nodes.
        owners: (N,) the joint of ours that each node moves with.
    """

    matrices: Array
    owners: Array


def pose_nodes(avatar: Avatar) -> TPose:
    """The T-pose of a character, from that of its rig."""
    rig, ours = avatar.rig, humanoid()
    file = rig.file
    matrices = _turn_to_tpose(rig)
    carrier = _carrier_names(rig)
    heads = _EYES if avatar.eyes_by_shapes else ()
    owner_of = {rig.nodes[j]: ours.index["head" if name in heads else name] for name, j in carrier.items()}
    owners = np.zeros(len(file.parents), np.int64)
    loose = 0 if "hips" in carrier else ours.index["head"]
    for node in range(len(owners)):
        k = node
        while k >= 0 and k not in owner_of:
            k = file.parents[k]
        owners[node] = owner_of.get(k, loose)
    return TPose(matrices, owners)


def shape_humanoid(rig: Rig, surface: Array, scale: float = 1.0, lift: float = 0.0) -> Skeleton:
    """Our humanoid with the character's proportions.

    Args:
        rig: of the character.
        surface: (V, 3) metres, its points in the T-pose; they tell the size of a head alone.
        scale: applied first.
        lift: metres upwards, applied after the scale.
    """
    ours, carrier = humanoid(), _carrier_names(rig)
    points = _joint_positions(rig, carrier) if "hips" in carrier else _positions_below_head(rig, carrier, surface)
    points = points * scale + (0.0, lift, 0.0)
    offsets = points.copy()
    for joint, parent in enumerate(ours.parents[1:], 1):
        offsets[joint] -= points[parent]
    part = not {*LIMBS["arms"], *LIMBS["legs"]} <= {*carrier}
    there = {name: name if name in carrier else "" for name in ours.names} if part else {}
    skeleton = Skeleton(ours.names, ours.parents, offsets, kind="humanoid", bone_map=there)
    return ours if not part and np.allclose(offsets, ours.offsets, atol=1e-5) else skeleton


def _carrier_names(rig: Rig) -> dict[str, int]:
    """Our name → joint of the rig. The last of its spine bones is our upper chest: it carries the arms."""
    names = dict(rig.bones)
    top = next((name for name in reversed(_SPINE) if name in names), None)
    if top is not None:
        names["upperChest"] = names.pop(top)
    return {name: names[name] for name in humanoid().names if name in names}


def _turn_to_tpose(rig: Rig) -> Array:
    """(N, 4, 4) world matrices of all nodes when the rig is in its T-pose."""
    file, skeleton = rig.file, rig.skeleton
    points, turns = skeleton.forward(skeleton.rest, skeleton.offsets[0])
    front = np.eye(4)
    front[:3, :3], front[:3, 3] = quat_to_matrix(rig.facing), rig.shift
    matrices = front @ world_matrices(file)
    change: dict[int, Array] = {}  # of the rig's nodes, from the file's rest pose
    for j, node in enumerate(rig.nodes):
        turn = quat_to_matrix(quat_multiply(turns[j], quat_conjugate(rotation_of(matrices[node]))))
        change[node] = np.eye(4)
        change[node][:3, :3], change[node][:3, 3] = turn, points[j] - turn @ matrices[node, :3, 3]
    for node in range(len(matrices)):
        k = node
        while k >= 0 and k not in change:
            k = file.parents[k]
        if k >= 0:
            matrices[node] = change[k] @ matrices[node]
    return matrices


def _joint_positions(rig: Rig, carrier: dict[str, int]) -> Array:
    """(55, 3) positions in metres: of the rig's joints, and guesses for the joints that it lacks."""
    ours, theirs = humanoid(), rig.skeleton.tpose
    positions = {name: theirs[j] for name, j in carrier.items()}
    size = (positions["head"] - positions["hips"])[1] / (ours.tpose[ours.index["head"]] - ours.tpose[0])[1]
    size = float(size) if size > 1e-3 else 1.0
    points = np.zeros((len(ours), 3))
    for joint, name in enumerate(ours.names):
        parent = ours.parents[joint]
        if name in positions:
            points[joint] = positions[name]
        elif name in ("spine", "chest", "neck"):  # between the joint before and the next that is there
            upper = ("head",) if name == "neck" else ("chest", "upperChest")
            above = next(positions[n] for n in upper if n in positions and ours.index[n] > joint)
            points[joint] = (points[parent] + above) / 2
        elif name.endswith("Shoulder") and name.replace("Shoulder", "UpperArm") in positions:
            points[joint] = positions[name.replace("Shoulder", "UpperArm")]  # it turns, and the arm stays in its place
        else:
            points[joint] = points[parent] + size * ours.offsets[joint]
    return points


def _positions_below_head(rig: Rig, carrier: dict[str, int], surface: Array) -> Array:
    """(55, 3) positions in metres of a person whose head is as large as this surface, which is a head alone."""
    ours, theirs = humanoid(), rig.skeleton.tpose
    low, high = surface.min(0), surface.max(0)
    size = float(high[1] - low[1]) / _HEAD
    top = np.array([(low[0] + high[0]) / 2, high[1], (low[2] + high[2]) / 2])
    points = size * (ours.tpose - (0.0, HEIGHT, 0.0)) + top
    for name, joint in carrier.items():
        points[ours.index[name]] = theirs[joint]
    return points
