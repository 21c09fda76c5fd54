"""Exact t-SNE: maps points of many dimensions to the plane, so that near points stay near (van der Maaten & Hinton 2008).

    p_{j|i} ∝ exp(−|x_i − x_j|² / 2σ_i²),  p = (p_{j|i} + p_{i|j}) / 2N,  q ∝ (1 + |y_i − y_j|²)⁻¹,  minimise KL(p‖q)

The picture is to look at: its distances, the sizes of groups and the gaps between them mean nothing by themselves. Memory and
time are quadratic in the number of points: a few thousand at most.
"""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...motion.rotations import Array

__all__ = ["tsne"]

PERPLEXITY = 30.0  # scikit-learn's, which the flow paper's code leaves as it is
STEPS, EARLY, EXAGGERATION = 750, 250, 12.0  # as scikit-learn, but for 1000 steps
SMALLEST_STEP = 50.0  # Belkina et al. 2019: N / exaggeration, and not less than this (scikit-learn's "auto")
MOMENTUM, LATER_MOMENTUM = 0.5, 0.8
LEAST_GAIN = 0.01
LEAST, MOST = 8, 5000  # points; ours: fewer have no neighbourhoods, more make matrices of over 200 MB


def _square_distances(x: Array) -> Array:
    square = np.square(x).sum(1)
    gap = np.maximum(square[:, None] + square - 2 * x @ x.T, 0)
    np.fill_diagonal(gap, 0)
    return gap


def _affinities(x: Array, perplexity: float) -> Array:
    """(N, N) p: each σ by bisection, for all points at once."""
    gap = _square_distances(x)
    gap /= max(float(gap.mean()), 1e-300)
    low, high, beta = np.zeros(len(x)), np.full(len(x), np.inf), np.ones(len(x))
    off = ~np.eye(len(x), dtype=bool)
    nearest = np.where(off, gap, np.inf).min(1, keepdims=True)
    for _ in range(60):
        p = np.exp(-(gap - nearest) * beta[:, None]) * off
        p /= p.sum(1, keepdims=True)
        entropy = -(p * np.log(np.maximum(p, 1e-300))).sum(1)
        wide = entropy > np.log(perplexity)
        low, high = np.where(wide, beta, low), np.where(wide, high, beta)
        beta = np.where(np.isinf(high), beta * 2, (low + high) / 2)
    p = (p + p.T) / (2 * len(x))
    return np.maximum(p, 1e-12)


def _begin(x: Array) -> Array:
    """The first two principal components, tiny (Kobak & Berens 2019); the sign of each is fixed."""
    centred = x - x.mean(0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    axes = axes[:2] * np.sign(axes[:2][np.arange(len(axes[:2])), np.abs(axes[:2]).argmax(1)])[:, None]
    y = np.zeros((len(x), 2))
    y[:, : len(axes)] = centred @ axes.T
    return y / max(float(y[:, 0].std()), 1e-300) * 1e-4


def tsne(points: Array, *, perplexity: float = PERPLEXITY) -> Array:
    """Map points (N, D) to (N, 2); the same points give the same picture.

    Args:
        points: rows.
        perplexity: how many neighbours count; at most a third of the points.

    Raises:
        InputError: fewer than 8 points or more than 5000, or values that are not finite.
    """
    x = np.asarray(points, np.float64)
    if x.ndim != 2 or not LEAST <= len(x) <= MOST or not np.isfinite(x).all():
        raise InputError(f"t-SNE of points of shape {x.shape}", f"{LEAST} … {MOST} points, finite")
    p = _affinities(x, min(perplexity, (len(x) - 1) / 3))
    y, velocity, gain = _begin(x), np.zeros((len(x), 2)), np.ones((len(x), 2))
    rate = max(len(x) / EXAGGERATION / 4, min(SMALLEST_STEP, len(x) / 2))  # few points fly apart at long steps; ours
    for step in range(STEPS):
        kernel = 1 / (1 + _square_distances(y))
        np.fill_diagonal(kernel, 0)
        q = np.maximum(kernel / kernel.sum(), 1e-12)
        pull = ((EXAGGERATION if step < EARLY else 1) * p - q) * kernel
        gradient = 4 * (pull.sum(1)[:, None] * y - pull @ y)
        gain = np.maximum(np.where(gradient * velocity < 0, gain + 0.2, gain * 0.8), LEAST_GAIN)
        velocity = (MOMENTUM if step < EARLY else LATER_MOMENTUM) * velocity - rate * gain * gradient
        y = y + velocity
    return y - y.mean(0)
