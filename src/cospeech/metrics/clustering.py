"""Clustering of features by speaker: Calinski–Harabasz index (CHI) and silhouette.

The flow paper computes both on a 2-D t-SNE picture with the labels that k-means (k = 5) finds *in that picture*: such points
are clustered whatever they are. `chi` and `silhouette` are of the features themselves, with the speakers as labels.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..motion.rotations import Array
from ._scipy import scipy
from .metric import metric
from .sample import Sample, Score, Tools

__all__ = ["calinski_harabasz", "chi", "chi_gfge", "silhouette", "silhouette_coefficient", "silhouette_gfge"]

GROUPS = 5  # GFGE generator.py, vis_latent_space.py: five videos, five clusters
MOST = 4000  # ours: distances of more windows than this are taken of a random part


def _check_labels(points: Array, labels: Array) -> tuple[Array, Array]:
    points, labels = np.asarray(points, np.float64), np.unique(labels, return_inverse=True)[1]
    groups = labels.max(initial=-1) + 1
    if points.ndim != 2 or len(points) != len(labels) or not 2 <= groups < len(points):
        raise InputError(f"clustering of {len(points)} points with {groups} labels", "2 labels at least, and more points")
    if not np.isfinite(points).all():
        raise InputError("points to cluster hold values that are not finite")
    return points, labels


def calinski_harabasz(points: Array, labels: Array) -> float:
    """Spread between groups over spread within, each by its degrees of freedom (Calinski & Harabasz 1974)."""
    points, labels = _check_labels(points, labels)
    sizes = np.bincount(labels)
    means = np.stack([points[labels == k].mean(0) for k in range(len(sizes))])
    between = sizes @ np.square(means - points.mean(0)).sum(1)
    within = np.square(points - means[labels]).sum()
    count, groups = len(points), len(sizes)
    return float(between * (count - groups) / (within * (groups - 1))) if within else float("inf")


def silhouette_coefficient(points: Array, labels: Array) -> float:
    """Mean of (b − a) / max(a, b) over points (Rousseeuw 1987); a point that is alone in its group counts 0.

    a is the mean distance to the own group, b that to the nearest other group.
    """
    points, labels = _check_labels(points, labels)
    square = np.square(points).sum(1)
    sizes = np.bincount(labels)
    member = np.eye(len(sizes))[labels]
    scores = np.zeros(len(points))
    for start in range(0, len(points), 500):
        part = slice(start, start + 500)
        gap = np.sqrt(np.maximum(square[part, None] + square - 2 * points[part] @ points.T, 0))
        gap[np.arange(len(gap)), np.arange(start, start + len(gap))] = 0
        sums, own = gap @ member, labels[part]
        rows = np.arange(len(own))
        inside = sums[rows, own] / np.maximum(sizes[own] - 1, 1)
        means = sums / sizes
        means[rows, own] = np.inf
        outside = means.min(1)
        scores[part] = np.where(sizes[own] > 1, (outside - inside) / np.maximum(np.maximum(outside, inside), 1e-300), 0)
    return float(scores.mean())


def _label_windows(generated: Sequence[Sample], tools: Tools) -> tuple[Array, Array]:
    assert tools.features is not None
    rows, labels = [], []
    for sample in generated:
        features = tools.features.windows(sample)
        if len(features):
            rows.append(features)
            labels += [sample.label] * len(features)
    if not rows:
        raise InputError(f"no clip has {tools.features.frames} frames", "longer clips")
    points, names = np.concatenate(rows), np.array(labels)
    if len(points) > MOST:
        indices = np.random.default_rng(tools.seed).choice(len(points), MOST, replace=False)
        points, names = points[indices], names[indices]
    return points, names


def _embed_windows(generated: Sequence[Sample], tools: Tools) -> tuple[Array, Array]:
    assert tools.embedding is not None
    points = np.asarray(tools.embedding(_label_windows(generated, tools)[0]), np.float64)
    vq = scipy("cluster.vq")
    try:
        labels = vq.kmeans2(points, GROUPS, minit="++", missing="raise", rng=np.random.default_rng(tools.seed))[1]
    except vq.ClusterError:
        raise InputError(f"k-means finds no {GROUPS} groups in {len(points)} points") from None
    return points, labels


def _score(value: float, points: Array, tools: Tools) -> Score:
    assert tools.features is not None
    return Score(value, None, len(points), tools.features.name)


@metric("features", better="higher", same=("rate", "joints"))
def chi(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Calinski–Harabasz index of features with speakers as labels; grows with the number of windows."""
    points, labels = _label_windows(generated, tools)
    return _score(calinski_harabasz(points, labels), points, tools)


@metric("features", better="higher", same=("rate", "joints"))
def silhouette(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Silhouette coefficient of features with speakers as labels, −1 … 1."""
    points, labels = _label_windows(generated, tools)
    return _score(silhouette_coefficient(points, labels), points, tools)


@metric("features", "embedding", better="higher", same=("rate", "joints"))
def chi_gfge(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """CHI of the flow paper: on a 2-D embedding that you pass in, with the labels that k-means (k = 5) finds in it."""
    points, labels = _embed_windows(generated, tools)
    return _score(calinski_harabasz(points, labels), points, tools)


@metric("features", "embedding", better="higher", same=("rate", "joints"))
def silhouette_gfge(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Silhouette of the flow paper: on a 2-D embedding that you pass in, with the labels that k-means (k = 5) finds in it."""
    points, labels = _embed_windows(generated, tools)
    return _score(silhouette_coefficient(points, labels), points, tools)
