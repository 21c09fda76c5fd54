"""FGD: the Fréchet distance between features of generated and of real motion, seen as two normal distributions.

    FGD = |μ₁ − μ₂|² + tr Σ₁ + tr Σ₂ − 2 tr (Σ₁Σ₂)^½            (Heusel et al. 2017; Yoon et al. 2020)

As usually coded the root is `scipy.linalg.sqrtm` of Σ₁Σ₂, which is not symmetric: with singular covariances (few windows, a
still body) it comes out complex, not finite or too large, and the distance negative. Here the roots are of Σ₁ and Σ₂, by
eigen-decomposition, and the trace is the sum of the singular values of Σ₁^½ Σ₂^½: never negative, exact where singular.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from ..errors import InputError, say_count
from ..motion.rotations import Array
from ._scipy import scipy
from .interval import Resampled, groups_of, number_groups
from .metric import metric
from .sample import FeatureNet, Sample, Score, Tools, select_vectors

__all__ = ["fgd", "fgd_published", "fid_poses", "frechet", "frechet_published", "moments"]

EPS = 1e-6  # pytorch-fid: added to the diagonals where the root is not finite
STILL = 1e-4  # ours: of the largest deviation; a coordinate that moves less is rounding (Mix-StAGE divides it by 1e-8)
DRAWS, WIDE, FEW = 200, 64, 30  # ours: bootstrap draws; fewer where features have more than WIDE dimensions


def moments(features: Array) -> tuple[Array, Array]:
    """Mean (F,) and covariance (F, F; over N − 1) of (N, F) features.

    Raises:
        InputError: fewer than two windows, or a value that is not finite.
    """
    features = np.asarray(features, np.float64)
    if features.ndim != 2 or len(features) < 2:
        raise InputError(f"features of shape {features.shape}", "two windows at least")
    if not np.isfinite(features).all():
        raise InputError("features hold values that are not finite")
    return features.mean(0), np.atleast_2d(np.cov(features, rowvar=False))


def _check(mean: Array, covariance: Array, size: int) -> None:
    if mean.shape != (size,) or covariance.shape != (size, size):
        raise InputError(f"mean of shape {mean.shape} with a covariance of shape {covariance.shape}")
    if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
        raise InputError("mean or covariance hold values that are not finite")
    if not np.allclose(covariance, covariance.T, rtol=1e-6, atol=1e-9 * (1 + np.abs(covariance).max(initial=0))):
        raise InputError("a covariance that is not symmetric")


def _root(covariance: Array) -> Array:
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    return (vectors * np.sqrt(np.maximum(values, 0))) @ vectors.T


def frechet(mean_a: Array, covariance_a: Array, mean_b: Array, covariance_b: Array) -> float:
    """Fréchet distance (squared, as FID is) of two normal distributions; always ≥ 0, also for singular covariances.

    Raises:
        InputError: shapes disagree, values are not finite, or a covariance is not symmetric.
    """
    mean_a, mean_b, covariance_a, covariance_b = (
        np.asarray(x, np.float64) for x in (mean_a, mean_b, covariance_a, covariance_b)
    )
    for mean, covariance in ((mean_a, covariance_a), (mean_b, covariance_b)):
        _check(mean, covariance, mean_a.size)
    root_a, root_b = _root(covariance_a), _root(covariance_b)
    cross = np.linalg.svd(root_a @ root_b, compute_uv=False).sum()
    gap = mean_a - mean_b
    return float(max(gap @ gap + np.square(root_a).sum() + np.square(root_b).sum() - 2 * cross, 0.0))


def frechet_published(mean_a: Array, covariance_a: Array, mean_b: Array, covariance_b: Array) -> float:
    """The same with `scipy.linalg.sqrtm` of Σ₁Σ₂, as in pytorch-fid; may be negative or not a number."""
    sqrtm = scipy("linalg").sqrtm
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        root = sqrtm(covariance_a @ covariance_b)
        if not np.isfinite(root).all():
            extra = np.eye(len(covariance_a)) * EPS
            root = sqrtm((covariance_a + extra) @ (covariance_b + extra))
    gap = mean_a - mean_b
    return float(gap @ gap + np.trace(covariance_a) + np.trace(covariance_b) - 2 * np.trace(np.real(root)))


def _clips(samples: Sequence[Sample], net: FeatureNet) -> list[Array]:
    """(N, F) features of the windows of each group of samples that has one."""
    clips = [net.windows(sample) for sample in samples]
    if sum(map(len, clips)) < 2:
        raise InputError(f"{say_count(sum(map(len, clips)), 'window')} of {net.frames} frames", "longer clips, or more of them")
    return _join(clips, samples)


def _join(rows: Sequence[Array], samples: Sequence[Sample]) -> list[Array]:
    """The rows of all samples of a group, one after the other; samples without a row count for nothing."""
    place = number_groups(groups_of(samples))
    groups: list[list[Array]] = [[] for _ in range(place.max(initial=-1) + 1)]
    for k, own in zip(place, rows, strict=True):
        groups[k] += [own] if len(own) else []
    return [np.concatenate(own) for own in groups if own]


def _resample(a: list[Array], b: list[Array], value: float, seed: int) -> Resampled:
    """Draw the groups of both sides with replacement, and take off the upward bias of the draws."""
    if len(a) < 2 or len(b) < 2:
        return Resampled()
    rng, centre = np.random.default_rng(seed), np.concatenate(b).mean(0)
    sides = [[(len(x), (x - centre).sum(0), (x - centre).T @ (x - centre)) for x in side] for side in (a, b)]
    draws = []
    for _ in range(DRAWS if a[0].shape[1] <= WIDE else FEW):
        normals = []
        for clips in sides:
            sample = [clips[k] for k in rng.integers(0, len(clips), len(clips))]
            count = sum(clip[0] for clip in sample)
            mean = sum(clip[1] for clip in sample) / count
            spread = sum(clip[2] for clip in sample) / count - np.outer(mean, mean)
            normals += [mean, spread * count / max(count - 1, 1)]
        draws.append(frechet(*normals))
    return Resampled.of(np.maximum(np.array(draws) - np.mean(draws) + value, 0.0))


@metric("features", better="lower", same=("rate", "joints"))
def fgd(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Fréchet gesture distance of a named feature network, never negative, with a bootstrap interval."""
    assert tools.features is not None
    a, b = _clips(generated, tools.features), _clips(reference, tools.features)
    value = frechet(*moments(np.concatenate(a)), *moments(np.concatenate(b)))
    count = sum(map(len, a))
    resamples = _resample(a, b, value, tools.seed)
    return Score(value, resamples.interval, count, f"{tools.features.name}, {say_count(count, 'window')}", resamples.draws)


@metric("features", better="lower", same=("rate", "joints"))
def fgd_published(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """FGD with the matrix root of pytorch-fid: may be negative or not a number."""
    assert tools.features is not None
    a, b = (np.concatenate(_clips(side, tools.features)) for side in (generated, reference))
    return Score(frechet_published(*moments(a), *moments(b)), None, len(a), tools.features.name)


@metric("positions|points", better="lower", same=("joints",))
def fid_poses(generated: Sequence[Sample], reference: Sequence[Sample], tools: Tools) -> Score:
    """Fréchet distance of single poses, normalised by the reference (Mix-StAGE's FID); it cannot see movement.

    Neck, nose and eyes of PATS' key points do not count, as coded.
    """
    a, b = ([select_vectors(sample) for sample in side] for side in (generated, reference))
    poses = np.concatenate(b)
    mean, deviation = poses.mean(0), poses.std(0)
    moving = deviation > STILL * deviation.max(initial=0)
    if not moving.any():
        raise InputError("the reference does not move")
    a, b = ([((x - mean) / np.maximum(deviation, 1e-300))[:, moving] for x in side] for side in (a, b))
    value = frechet(*moments(np.concatenate(a)), *moments(np.concatenate(b)))
    resamples = _resample(_join(a, generated), _join(b, reference), value, tools.seed)
    return Score(value, resamples.interval, sum(map(len, a)), "frames", resamples.draws)
