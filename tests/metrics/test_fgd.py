"""FGD: never negative, exact where singular, and what the published form does there."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.metrics import FeatureNet, Sample, Tools
from cospeech.metrics.fgd import fgd, fgd_published, fid_poses, frechet, frechet_published, moments

NET = FeatureNet("mean and last of 10", lambda w: np.concatenate([w.mean(1), w[:, -1]], 1), 10, 5)


def pair(seed: int):
    """Two random normal distributions of 1 … 12 dimensions, of full or lower rank, at times with equal covariances."""
    rng = np.random.default_rng(seed)
    size = int(rng.integers(1, 13))
    parameters = []
    for _ in range(2):
        rank = int(rng.integers(0, size + 1)) if seed % 2 else size
        root = rng.normal(size=(size, rank)) * 10.0 ** rng.uniform(-3, 3)
        parameters += [rng.normal(size=size) * 10.0 ** rng.uniform(-3, 1), root @ root.T]
    if seed % 7 == 0:
        parameters[3] = parameters[1].copy()
    return parameters


def direct(mean_a, cov_a, mean_b, cov_b):
    """The trace of the root from the eigenvalues of Σ₁Σ₂ themselves, in double precision: another way than ours."""
    values = np.linalg.eigvals(cov_a @ cov_b).real
    return np.sum((mean_a - mean_b) ** 2) + np.trace(cov_a + cov_b) - 2 * np.sqrt(np.maximum(values, 0)).sum()


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_it_is_never_negative_and_zero_for_the_same(part):
    for seed in range(250 * part, 250 * (part + 1)):
        a, b, c, d = pair(seed)
        assert frechet(a, b, c, d) >= 0
        scale = np.trace(b) + np.trace(d) + 1e-30
        assert frechet(a, b, a, b) <= 1e-9 * scale
        assert frechet(a, b, c, d) == pytest.approx(frechet(c, d, a, b), rel=1e-9, abs=1e-9 * scale)


def test_it_equals_a_direct_computation_in_double_precision():
    for seed in range(0, 400, 2):  # of full rank
        arguments = pair(seed)
        scale = np.trace(arguments[1]) + np.trace(arguments[3])
        assert frechet(*arguments) == pytest.approx(direct(*arguments), rel=1e-6, abs=1e-6 * scale)
        assert frechet(*arguments) == pytest.approx(frechet_published(*arguments), rel=1e-6, abs=1e-6 * scale)


def test_commuting_singular_covariances_have_a_closed_form():
    rng = np.random.default_rng(0)
    for _ in range(50):
        turn = np.linalg.qr(rng.normal(size=(8, 8)))[0]
        a, b = (np.where(rng.random(8) < 0.5, 0, rng.uniform(0.1, 9, 8)) for _ in range(2))
        value = frechet(np.zeros(8), turn * a @ turn.T, np.ones(8), turn * b @ turn.T)
        assert value == pytest.approx(8 + np.sum((np.sqrt(a) - np.sqrt(b)) ** 2), abs=1e-6)


def test_the_published_root_comes_out_negative_where_ours_is_zero():
    """Few windows of many features, compared with themselves."""
    distances = []
    for seed in range(20):
        mean, covariance = moments(np.random.default_rng(seed).normal(size=(6, 40)))
        assert 0 <= frechet(mean, covariance, mean, covariance) < 1e-10
        distances.append(frechet_published(mean, covariance, mean, covariance))
    assert min(distances) < 0
    assert np.nanmax(np.abs(distances)) > 1e-7


@pytest.mark.parametrize(
    "arguments",
    [
        (np.zeros(2), np.eye(3), np.zeros(2), np.eye(2)),
        (np.zeros(2), np.eye(2), np.zeros(2), np.array([[1.0, 2.0], [0.0, 1.0]])),
        (np.zeros(2), np.eye(2) * np.nan, np.zeros(2), np.eye(2)),
        (np.zeros(2), np.eye(2), np.zeros(3), np.eye(3)),
    ],
)
def test_what_is_no_distribution_is_refused(arguments):
    with pytest.raises(InputError):
        frechet(*arguments)


def clips(seed: int, noise: float = 0.0, count: int = 6) -> list[Sample]:
    rng = np.random.default_rng(seed)
    samples = []
    for k in range(count):
        walk = np.cumsum(rng.normal(size=(120, 4, 3)), 0) * 0.01
        samples.append(Sample(f"{k}", 30.0, positions=walk + noise * rng.normal(size=walk.shape)))
    return samples


@pytest.mark.slow
def test_the_metric_grows_with_corruption_whatever_the_order_of_clips():
    real = clips(0)
    tools = Tools(features=NET)
    scores = [fgd(clips(0, noise), real, tools) for noise in (0.0, 0.05, 0.2, 0.8)]
    assert scores[0].value < 1e-12
    assert all(a.value < b.value for a, b in pairwise(scores))
    assert fgd(clips(0, 0.2)[::-1], real[::-1], tools).value == pytest.approx(scores[2].value)
    low, high = scores[2].interval
    assert 0 <= low <= scores[2].value <= high
    assert NET.name in scores[2].note
    assert str(scores[2].count) in scores[2].note
    assert fgd_published(clips(0, 0.2), real, tools).value == pytest.approx(scores[2].value, rel=1e-6)


@pytest.mark.slow
def test_poses_alone_do_not_see_movement():
    """Frames in any order have the same poses: that is what FID on raw poses cannot tell."""
    real = clips(1)
    shuffled = [Sample(s.name, 30.0, positions=np.random.default_rng(k).permutation(s.positions)) for k, s in enumerate(real)]
    assert fid_poses(shuffled, real).value < 1e-9
    assert fgd(shuffled, real, Tools(features=NET)).value > 1e-3
    values = [fid_poses(clips(1, noise), real).value for noise in (0.05, 0.2, 0.8)]
    assert values == sorted(values)
    assert values[0] > 0


def test_a_network_must_be_named_and_passed_in():
    with pytest.raises(InputError, match="features"):
        fgd(clips(0), clips(1))
    with pytest.raises(InputError, match="windows"):
        fgd([Sample("a", 30.0, positions=np.zeros((5, 4, 3)))], clips(1), Tools(features=NET))
    bad_net = FeatureNet("broken", lambda w: np.full((len(w), 2), np.nan), 10, 5)
    with pytest.raises(InputError, match="finite"):
        fgd(clips(0), clips(1), Tools(features=bad_net))
