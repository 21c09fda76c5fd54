"""The pose in which we sculpt, weights, and the way from there to the T-pose.

The body is sculpted with the arms lowered by 48° and the elbows a little bent, because that is nearer to how a speaker is seen
than the T-pose. `unpose` then applies the inverse of linear blend skinning, so that skinning reproduces the sculpted shape
exactly in that pose; a T-pose sculpt would lose its shoulders whenever the arms hang.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cospeech.export.mannequin.character import Part
from cospeech.motion.rotations import Array, euler_to_quat, quat_identity, quat_to_matrix
from cospeech.motion.skeleton import humanoid

from .net import Net

__all__ = [
    "DARK", "HAIR", "SKIN", "joint", "make_part", "mirror_part", "pack_weights", "sculpt_pose", "srgb", "unpack_weights",
    "unpose", "weights_of",
]  # fmt: skip

ARM_DOWN = 48.0  # degrees from the T-pose; ours: midway in gesturing, so that neither the T-pose nor hanging arms lose much
ELBOW_BENT = 20.0  # degrees; ours: halfway to what a relaxed arm shows


def srgb(code: str) -> Array:
    """Linear RGB of a ``"rrggbb"`` colour (IEC 61966-2-1)."""
    c = np.array([int(code[k : k + 2], 16) for k in (0, 2, 4)]) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


SKIN, HAIR, DARK = srgb("e3b08f"), srgb("523a2b"), srgb("3a1a1c")


@dataclass(frozen=True, eq=False)
class SculptPose:
    """Joint positions (J, 3) and world rotation matrices (J, 3, 3) of the sculpting pose."""

    positions: Array
    turns: Array


@lru_cache(1)
def sculpt_pose() -> SculptPose:
    """The pose the body is modelled in."""
    skeleton = humanoid()
    local = quat_identity(len(skeleton))
    for side, sign in (("left", 1), ("right", -1)):
        local[skeleton.index[side + "UpperArm"]] = euler_to_quat(np.radians([0, 0, -sign * ARM_DOWN]))
        local[skeleton.index[side + "LowerArm"]] = euler_to_quat(np.radians([0, -sign * ELBOW_BENT, 0]))
    positions, world = skeleton.forward(local, skeleton.offsets[0])
    return SculptPose(positions, quat_to_matrix(world))


def joint(name: str) -> Array:
    """Position of a joint in the sculpting pose."""
    return sculpt_pose().positions[humanoid().index[name]]


def unpose(points: Array, normals: Array, weights: Array) -> tuple[Array, Array]:
    """T-pose points and normals of a surface modelled in the sculpting pose; ``weights`` is (V, J)."""
    pose, rest = sculpt_pose(), humanoid().tpose
    turn = np.einsum("vj,jab->vab", weights, pose.turns)
    shift = weights @ (pose.positions - np.einsum("jab,jb->ja", pose.turns, rest))
    back = np.linalg.solve(turn, (points - shift)[:, :, None])[:, :, 0]
    rest_normals = np.einsum("vba,vb->va", turn, normals)
    return back, rest_normals / np.linalg.norm(rest_normals, axis=1, keepdims=True)


def weights_of(count: int, **columns: Array | float) -> Array:
    """(V, J) weights from joint name → value or (V,) values; rows are scaled to 1."""
    out = np.zeros((count, len(humanoid())))
    for name, value in columns.items():
        out[:, humanoid().index[name]] += value
    return out / out.sum(1, keepdims=True)


def pack_weights(weights: Array, least: float = 0.004) -> tuple[Array, Array]:
    """Joints (V, 4) int32 and their weights (V, 4) float32: the four largest of each row (V, J), none below ``least``."""
    order = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    four = np.take_along_axis(weights, order, 1)
    four = np.where(four < least, 0, four)
    four /= four.sum(1, keepdims=True)
    return np.where(four > 0, order, 0).astype(np.int32), four.astype(np.float32)


def unpack_weights(joints: Array, four: Array, count: int | None = None) -> Array:
    """(V, J) weights of all joints: of the humanoid, or ``count``."""
    weights = np.zeros((len(joints), count or len(humanoid())))
    np.add.at(weights, (np.arange(len(joints))[:, None], joints), four)
    return weights


def make_part(
    name: str,
    net: Net,
    normals: Array,
    weights: Array,
    colour: Array,
    roughness: float = 0.8,
    morphs: dict[str, Array] | None = None,
    is_posed: bool = False,
) -> Part:
    """Pack a net: points in use, and the four largest weights per vertex; moved to the T-pose if modelled ``is_posed``."""
    in_use = np.unique([i for f in net.faces for i in f])
    renumber = np.zeros(len(net.points), np.int32)
    renumber[in_use] = np.arange(len(in_use))
    triangles = renumber[net.triangles()]
    colour = np.asarray(colour, np.float32)
    colour = colour if colour.ndim == 1 else colour[in_use]
    joints, four = pack_weights(weights[in_use])
    points, normals = net.points[in_use], normals[in_use]
    if is_posed:
        points, normals = unpose(points, normals, unpack_weights(joints, four))
    return Part(
        name,
        points.astype(np.float32),
        normals.astype(np.float32),
        triangles,
        joints,
        four,
        colour,
        roughness,
        {k: v[in_use].astype(np.float32) for k, v in (morphs or {}).items()},
    )


def mirror_part(part: Part, name: str) -> Part:
    """The other side's part: x negated, left joints for right ones, faces turned."""
    from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX, ARKIT_MIRROR
    from cospeech.motion.skeletons.humanoid import MIRROR

    index = humanoid().index
    swap = np.array([index[MIRROR.get(n, n)] for n in humanoid().names], np.int32)
    flip = np.array([-1, 1, 1], np.float32)
    return Part(
        name,
        part.vertices * flip,
        part.normals * flip,
        np.ascontiguousarray(part.triangles[:, ::-1]),
        swap[part.joints],
        part.weights,
        part.colour,
        part.roughness,
        {ARKIT[ARKIT_MIRROR[ARKIT_INDEX[k]]]: v * flip for k, v in part.morphs.items()},
    )
