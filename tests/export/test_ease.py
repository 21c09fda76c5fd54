"""Easing: weights and places that stretch a bent tube less, by a gradient that is right."""

from dataclasses import replace

import numpy as np
import pytest
from mannequin.ease import Cloth, Poses, _Descent, ease, place
from scipy.sparse import csr_matrix

ROUND, ALONG = 8, 15


@pytest.fixture(scope="module")
def tube():
    """A sleeve of radius 40 mm along x from −0.3 to 0.3, bent in its middle at once; sculpted in the T-pose."""
    turn = 2 * np.pi * np.arange(ROUND) / ROUND
    x = np.repeat(np.linspace(-0.3, 0.3, ALONG), ROUND)
    points = np.stack([x, np.tile(0.04 * np.cos(turn), ALONG), np.tile(0.04 * np.sin(turn), ALONG)], 1)
    triangles = []
    for k in range(ALONG - 1):
        for m in range(ROUND):
            a, b = k * ROUND + m, k * ROUND + (m + 1) % ROUND
            triangles += [(a, b, b + ROUND), (a, b + ROUND, a + ROUND)]
    beyond = (x > 0.01).astype(float)
    count = len(points)
    free = np.where(np.abs(x) < 0.25, 1.0, 0.0)
    still = np.tile(np.eye(3, 4), (2, 1, 1))
    weights = np.stack([1 - beyond, beyond], 1)
    return Cloth(points, np.array(triangles), weights, still, free, 0.004 * free, np.zeros((count, 2), bool))


@pytest.fixture(scope="module")
def bends():
    """The second joint turned about y by ±30° … ±90°."""
    moves = np.tile(np.eye(3, 4), (6, 2, 1, 1))
    for move, angle in zip(moves, np.radians([30, 60, 90, -30, -60, -90]), strict=True):
        move[1, :, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    return Poses(moves, np.full(6, 0.2), np.linspace(1, 2, 6))


def worst(cloth, poses, points, weights):
    return _Descent(cloth, poses).ratios(points, weights, poses.moves).max() - 1


def test_a_bent_tube_is_stretched_less(tube, bends):
    points, weights = ease(tube, bends)
    assert worst(tube, bends, tube.points, tube.weights) > 0.8
    assert worst(tube, bends, points, weights) < 0.3
    assert np.abs(points - tube.points).max() <= 0.004 + 1e-9
    np.testing.assert_allclose(weights.sum(1), 1)
    assert weights.min() >= 0
    is_fixed = tube.free == 0
    np.testing.assert_array_equal(weights[is_fixed], tube.weights[is_fixed])
    np.testing.assert_array_equal(points[is_fixed], tube.points[is_fixed])


def test_the_gradient_is_that_of_the_price(tube, bends):
    shapes = tube.sculpted.copy()
    shapes[1] = bends.moves[0, 1]  # sculpted with the tube bent by 30°
    follow = np.eye(len(tube.points))
    follow[-1] = 0
    follow[-1, [3, 60]] = 0.4, 0.6
    cloth = replace(tube, sculpted=shapes, follow=csr_matrix(follow))
    descent, which = _Descent(cloth, bends), np.arange(6)
    rng = np.random.default_rng(3)
    count = int(descent.may.sum())
    values = np.concatenate([0.03 * rng.random(count), 1e-3 * rng.normal(size=3 * len(descent.loose))])
    _, slope = descent._price(values, which)
    for k in [*rng.integers(count, size=4), *(count + rng.integers(3 * len(descent.loose), size=4))]:
        step = 1e-5 * (np.arange(len(values)) == k)
        change = (descent._price(values + step, which)[0] - descent._price(values - step, which)[0]) / 2e-5
        assert change == pytest.approx(slope[k], rel=2e-2, abs=2e-3 * np.abs(slope).max())


def test_what_is_sewn_on_moves_with_the_cloth(tube, bends):
    follow = np.eye(len(tube.points))
    follow[70] = 0
    follow[70, [62, 63]] = 0.5
    points, weights = ease(replace(tube, follow=csr_matrix(follow)), bends)
    np.testing.assert_allclose(weights[70], weights[[62, 63]].mean(0))
    np.testing.assert_allclose((points - tube.points)[70], (points - tube.points)[[62, 63]].mean(0), atol=1e-12)


def test_a_symmetric_cloth_stays_symmetric(tube, bends):
    mirrored = tube.points * [-1, 1, 1]
    twins = np.argmin(np.linalg.norm(tube.points[:, None] - mirrored, axis=2), axis=0)
    even = np.stack([0.5 - 0.5 * np.tanh(tube.points[:, 0] / 0.03), 0.5 + 0.5 * np.tanh(tube.points[:, 0] / 0.03)], 1)
    points, weights = ease(replace(tube, weights=even, twins=(twins, np.array([1, 0]))), bends)
    np.testing.assert_allclose(points[twins] * [-1, 1, 1], points, atol=1e-5)
    np.testing.assert_allclose(weights[twins][:, ::-1], weights, atol=1e-3)


def test_places_at_rest_are_skinned_to_where_they_were_sculpted(tube, bends):
    weights = np.random.default_rng(0).dirichlet([1, 1], len(tube.points))
    moves = bends.moves[1]
    rest = place(tube.points, weights, moves)
    blend = np.einsum("vj,jab->vab", weights, moves)
    np.testing.assert_allclose(np.einsum("vab,vb->va", blend[..., :3], rest) + blend[..., 3], tube.points, atol=1e-9)
