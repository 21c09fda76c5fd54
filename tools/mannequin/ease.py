"""Weights that stretch a surface less: those that were modelled are bettered by gradient descent over many poses.

Linear blending moves a point by the weighted mean of its joints' transforms. So the length of every edge in every pose is a
smooth function of the weights, and its gradient is cheap.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from cospeech.export.mannequin.character import Part
from cospeech.motion.rotations import Array, quat_to_matrix
from cospeech.motion.skeleton import Skeleton

__all__ = ["ease"]

# All ours, by trial: what stretches least without a joint that loses its volume.
_FREE = 0.15  # stretch that costs nothing
_STEEP, _POWER = 100.0, 4  # pull of an edge by its stretch beyond that: the worst edges weigh most
_PRESSED = 0.5  # length, of that in the T-pose, below which an edge counts as pressed; folds may be pressed
_PUSH = 0.3  # push of such an edge by what it lacks
_SMOOTH = 2  # rounds of averaging over neighbours that make the change of the weights smooth
_STEP = 0.006  # change of a weight in a step of Adam (Kingma and Ba 2015) at first; it falls to a twentieth
_RINGS = 8  # edges from a point to those whose joints it may follow


def ease(part: Part, skeleton: Skeleton, poses: Array, free: Array, rounds: int = 400) -> Part:
    """The part with weights (V, 4) that stretch its edges less.

    Args:
        part: as it was modelled.
        skeleton: that the poses are of.
        poses: (P, J, 4) local rotations.
        free: (V,) 0 … 1, how far the weights of each point may change.
        rounds: steps of the descent.
    """
    edges, lengths = _edges(part)
    used = np.unique(part.joints[part.weights > 0])
    moved = _moved(part.vertices, skeleton, poses, used)  # (P, J', V, 3)
    old = np.zeros((len(part.vertices), len(used)))
    np.add.at(old, (np.arange(len(old))[:, None], np.searchsorted(used, part.joints)), part.weights)
    mean = _mean_of_neighbours(edges, len(old))
    reach = old.copy()
    for _ in range(_RINGS):
        reach = np.maximum(reach, mean @ reach)
    weights = 0.98 * old + 0.02 * reach / reach.sum(1, keepdims=True)
    weights = np.where(free[:, None] > 0, weights, old)
    may, first, second, least = weights > 0, np.zeros_like(old), np.zeros_like(old), 0.0
    for k in range(rounds):
        if k == rounds // 2:
            may = _four_largest(weights) > 0
        slope = _slope(weights, moved, edges, lengths)
        slope = np.where(may, slope, 0)
        slope = np.where(may, slope - slope.sum(1, keepdims=True) / may.sum(1, keepdims=True), 0)
        for _ in range(_SMOOTH):
            slope = mean @ slope
        first, second = 0.9 * first + 0.1 * slope, 0.99 * second + 0.01 * slope**2
        least = least or 0.1 * float(np.quantile(np.abs(slope), 0.98))
        step = (first / (1 - 0.9 ** (k + 1))) / (np.sqrt(second / (1 - 0.99 ** (k + 1))) + least)
        weights = weights - _STEP * (1 - 0.95 * k / rounds) * free[:, None] * step
        weights = np.where(may, np.maximum(weights, 0), 0)
        weights /= weights.sum(1, keepdims=True)
    order = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    four = np.take_along_axis(weights, order, 1)
    four = np.where(four < 0.004, 0, four)
    four /= four.sum(1, keepdims=True)
    joints = np.where(four > 0, used[order], 0)
    if four.shape[1] < 4:
        more = ((0, 0), (0, 4 - four.shape[1]))
        four, joints = np.pad(four, more), np.pad(joints, more)
    return replace(part, joints=joints.astype(np.int32), weights=four.astype(np.float32))


def _moved(vertices: Array, skeleton: Skeleton, poses: Array, used: Array) -> Array:
    """(P, J', V, 3) where each used joint alone would carry each vertex in each pose."""
    positions, world = skeleton.forward(poses, np.tile(skeleton.offsets[0], (len(poses), 1)))
    turns = quat_to_matrix(world[:, used])
    shift = positions[:, used] - np.einsum("pjab,jb->pja", turns, skeleton.tpose[used])
    return np.einsum("pjab,vb->pjva", turns, vertices) + shift[:, :, None]


def _slope(weights: Array, moved: Array, edges: csr_matrix, lengths: Array) -> Array:
    """(V, J') gradient of the price of all edges in all poses."""
    total = np.zeros_like(weights)
    for pose in moved:
        between = edges @ np.einsum("vj,jva->va", weights, pose)
        now = np.linalg.norm(between, axis=1)
        ratio = now / lengths
        price = _STEEP * np.maximum(ratio - 1 - _FREE, 0) ** _POWER - _PUSH * np.maximum(_PRESSED - ratio, 0)
        pull = between * (price / np.maximum(now, 1e-9))[:, None]
        total += np.einsum("va,jva->vj", edges.T @ pull, pose)
    return total


def _edges(part: Part) -> tuple[csr_matrix, Array]:
    """(E, V) differences along the edges of some length, and their lengths (E,)."""
    pairs = np.concatenate([part.triangles[:, [0, 1]], part.triangles[:, [1, 2]], part.triangles[:, [2, 0]]])
    pairs = np.unique(np.sort(pairs, 1), axis=0)
    lengths = np.linalg.norm(part.vertices[pairs[:, 0]] - part.vertices[pairs[:, 1]], axis=1)
    pairs, lengths = pairs[lengths > 1e-4], lengths[lengths > 1e-4]
    row = np.arange(len(pairs))
    data = np.concatenate([np.ones(len(pairs)), -np.ones(len(pairs))])
    where = np.concatenate([row, row]), pairs.T.ravel()
    return coo_matrix((data, where), shape=(len(pairs), len(part.vertices))).tocsr(), lengths


def _mean_of_neighbours(edges: csr_matrix, count: int) -> csr_matrix:
    """(V, V) that averages over a point and its neighbours."""
    near = abs(edges.T @ edges).sign() + coo_matrix((np.full(count, 1e-9), (range(count), range(count))), (count, count))
    near = near.tocsr()
    near.data[:] = 1
    return (coo_matrix((1 / np.asarray(near.sum(1)).ravel(), (range(count), range(count)))) @ near).tocsr()


def _four_largest(weights: Array) -> Array:
    """Weights without those beyond each row's four largest."""
    if weights.shape[1] <= 4:
        return weights
    least = np.sort(weights, axis=1)[:, -4][:, None]
    return np.where(weights >= least, weights, 0)
