"""Rotations: group laws, round trips near the identity and near half turns, and scipy as an oracle."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from cospeech.motion import rotations as r

RNG = np.random.default_rng(11)
ANY = r.quat_normalize(RNG.normal(size=(400, 4)))
SMALL = [0.0, 1e-300, 1e-160, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3]
AXES = RNG.normal(size=(60, 3))
AXES = np.concatenate([AXES / np.linalg.norm(AXES, axis=1, keepdims=True), np.eye(3), -np.eye(3)])
ORDERS = ["".join(p) for p in permutations("XYZ")]


def same(a: np.ndarray, b: np.ndarray, tolerance: float = 1e-12) -> bool:
    """Equal as rotations, whatever the sign."""
    return bool(np.abs(np.abs(np.sum(a * b, -1)) - 1).max() < tolerance)


def scipy(q: np.ndarray) -> Rotation:
    return Rotation.from_quat(q.reshape(-1, 4))


def test_group_laws():
    a, b, c = ANY[:100], ANY[100:200], ANY[200:300]
    one = r.quat_identity(100)
    assert np.allclose(r.quat_multiply(a, r.quat_multiply(b, c)), r.quat_multiply(r.quat_multiply(a, b), c), atol=1e-15)
    assert np.allclose(r.quat_multiply(a, one), a, atol=0)
    assert np.allclose(r.quat_multiply(one, a), a, atol=0)
    assert np.allclose(r.quat_multiply(a, r.quat_conjugate(a)), one, atol=1e-15)
    inverse = r.quat_conjugate(r.quat_multiply(a, b))
    assert np.allclose(inverse, r.quat_multiply(r.quat_conjugate(b), r.quat_conjugate(a)), atol=1e-15)


def test_products_act_like_their_factors_one_after_the_other():
    v = RNG.normal(size=(100, 3))
    a, b = ANY[:100], ANY[100:200]
    assert np.allclose(r.quat_rotate(r.quat_multiply(a, b), v), r.quat_rotate(a, r.quat_rotate(b, v)), atol=1e-14)
    assert np.allclose(np.linalg.norm(r.quat_rotate(a, v), axis=-1), np.linalg.norm(v, axis=-1), atol=1e-14)


def test_against_scipy():
    a, b, v = ANY[:200], ANY[200:], RNG.normal(size=(200, 3))
    assert same(r.quat_multiply(a, b), (scipy(a) * scipy(b)).as_quat())
    assert np.allclose(r.quat_rotate(a, v), scipy(a).apply(v), atol=1e-14)
    assert np.allclose(r.quat_to_matrix(a), scipy(a).as_matrix(), atol=1e-14)
    assert same(r.matrix_to_quat(r.quat_to_matrix(a)), a)
    assert np.allclose(r.quat_to_rotvec(a), scipy(a).as_rotvec(), atol=1e-13)
    assert same(r.rotvec_to_quat(v), Rotation.from_rotvec(v).as_quat())
    assert np.allclose(r.quat_angle(a, b), (scipy(a).inv() * scipy(b)).magnitude(), atol=1e-13)


@pytest.mark.parametrize("order", ORDERS)
def test_euler_angles_against_scipy(order):
    angles = r.quat_to_euler(ANY, order)
    assert np.allclose(angles, scipy(ANY).as_euler(order), atol=1e-9)  # capitals: intrinsic, as with us
    assert same(r.euler_to_quat(angles, order), ANY)
    assert same(r.euler_to_quat(angles, order), Rotation.from_euler(order, angles).as_quat())


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-9, 1e-7, 1e-4])
def test_euler_angles_at_the_poles(order, off):
    first, third = (x.ravel() for x in np.meshgrid(np.linspace(-3, 3, 9), np.linspace(-3, 3, 9)))
    for sign in (1, -1):
        angles = np.stack([first, np.full_like(first, sign * (np.pi / 2 - off)), third], -1)
        q = r.euler_to_quat(angles, order)
        again = r.quat_to_euler(q, order)
        assert np.isfinite(again).all()
        assert r.quat_angle(r.euler_to_quat(again, order), q).max() < 2e-8


@pytest.mark.parametrize("order", ["X", "Y", "Z", "XY", "ZX", "XYX"])
def test_euler_orders_of_any_length(order):
    angles = RNG.uniform(-3, 3, (20, len(order)))
    expected = scipy(r.quat_identity(20))
    for k, letter in enumerate(order):
        expected = expected * Rotation.from_euler(letter, angles[:, k : k + 1])
    assert same(r.euler_to_quat(angles, order), expected.as_quat())


@pytest.mark.parametrize("order", ["X", "Y", "Z", "XY", "YX", "YZ", "ZY", "XZ", "ZX"])
def test_few_angles_are_those_of_the_nearest_rotation(order):
    angles = r.quat_to_euler(ANY, order)
    off = r.quat_angle(r.euler_to_quat(angles, order), ANY)
    assert np.abs(angles).max() <= np.pi
    for away in RNG.uniform(-np.pi, np.pi, (300, len(order))):  # no others are nearer
        assert (r.quat_angle(r.euler_to_quat(np.broadcast_to(away, angles.shape), order), ANY) > off - 1e-9).all()
    for away in 0.01 * RNG.normal(size=(20, len(order))):
        assert (r.quat_angle(r.euler_to_quat(angles + away, order), ANY) > off - 1e-9).all()
    possible = r.euler_to_quat(RNG.uniform(-3, 3, (50, len(order))), order)
    assert r.quat_angle(r.euler_to_quat(r.quat_to_euler(possible, order), order), possible).max() < 1e-7


@pytest.mark.parametrize("angle", [*SMALL, 0.1, 1.0, 3.0, np.pi - 1e-3, np.pi - 1e-9, np.pi - 1e-13])
def test_rotation_vectors_come_back(angle):
    v = AXES * angle
    again = r.quat_to_rotvec(r.rotvec_to_quat(v))
    assert np.allclose(again, v, rtol=1e-9, atol=1e-15) or (angle > 3 and np.allclose(np.abs(again), np.abs(v), atol=1e-9))
    q = r.axis_angle_to_quat(AXES, angle)
    assert same(q, r.rotvec_to_quat(v))
    assert np.allclose(r.quat_angle(r.quat_identity(len(q)), q), angle, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("angle", [*SMALL[3:], 0.5, np.pi - 1e-6, np.pi - 1e-12, np.pi])
def test_matrices_and_six_numbers_come_back(angle):
    q = r.axis_angle_to_quat(AXES, angle)
    assert same(r.matrix_to_quat(r.quat_to_matrix(q)), q)
    assert same(r.matrix_to_quat(r.rot6d_to_matrix(r.quat_to_rot6d(q))), q)


def test_six_numbers_are_made_orthonormal():
    m = r.rot6d_to_matrix(RNG.normal(size=(50, 6)))
    assert np.allclose(m @ np.swapaxes(m, -1, -2), np.eye(3), atol=1e-12)
    assert np.allclose(np.linalg.det(m), 1)
    assert np.allclose(m[:, :, 0] * 3, r.rot6d_to_matrix(r.matrix_to_rot6d(m) * [3, 3, 3, 7, 7, 7])[:, :, 0] * 3, atol=1e-12)


def test_slerp_against_scipy_and_its_ends():
    for a, b in zip(ANY[:50], ANY[50:100], strict=True):
        t = np.linspace(0, 1, 7)
        assert same(r.quat_slerp(a, b, t), Slerp([0, 1], Rotation.from_quat([a, b]))(t).as_quat(), 1e-10)
    assert same(r.quat_slerp(ANY, ANY, 0.3), ANY)
    assert same(r.quat_slerp(ANY, -ANY, 0.3), ANY)
    near = r.quat_multiply(ANY, r.rotvec_to_quat(np.full((400, 3), 1e-8)))
    assert np.allclose(r.quat_angle(ANY, r.quat_slerp(ANY, near, 0.25)), 0.25e-8 * np.sqrt(3), rtol=1e-5)
    middle = r.quat_slerp(ANY[:200], ANY[200:], 0.5)
    assert np.allclose(r.quat_angle(ANY[:200], middle), r.quat_angle(middle, ANY[200:]), atol=1e-7)


def test_continuous_signs():
    q = r.quat_multiply(r.rotvec_to_quat(np.cumsum(RNG.normal(0, 0.1, (300, 5, 3)), 0)), ANY[:5])
    either_sign = q * RNG.choice([-1.0, 1.0], (300, 5, 1))
    smooth = r.quat_continuous(either_sign)
    assert (np.sum(smooth[1:] * smooth[:-1], -1) > 0).all()
    assert same(smooth, q)
    assert np.array_equal(smooth[0], either_sign[0])
    assert np.array_equal(r.quat_continuous(np.swapaxes(either_sign, 0, 1), axis=1), np.swapaxes(smooth, 0, 1))
    assert r.quat_continuous(either_sign[:1]).shape == (1, 5, 4)
    assert r.quat_continuous(either_sign[:0]).shape == (0, 5, 4)
    assert r.quat_continuous(either_sign.astype(np.float32)).dtype == np.float32


def test_between_directions():
    a, b = RNG.normal(size=(200, 3)), RNG.normal(size=(200, 3))
    q = r.quat_between(a, b)
    result = r.quat_rotate(q, a / np.linalg.norm(a, axis=1, keepdims=True))
    assert np.allclose(result, b / np.linalg.norm(b, axis=1, keepdims=True), atol=1e-12)
    assert np.allclose(np.sum(q[:, :3] * a, -1), 0, atol=1e-12)  # the shortest: no turn about the direction itself
    assert np.allclose(r.quat_between(a, 5 * a), r.quat_identity(200), atol=1e-7)
    for v in (*np.eye(3), *AXES):
        half = r.quat_between(v, -v)
        assert np.allclose(r.quat_rotate(half, v), -v, atol=1e-9)
    close = -a + 1e-6 * b
    unit = a / np.linalg.norm(a, axis=1, keepdims=True)
    assert np.allclose(
        r.quat_rotate(r.quat_between(a, close), unit), close / np.linalg.norm(close, axis=1, keepdims=True), atol=1e-4
    )


def test_swing_and_twist():
    for axis in np.eye(3):
        twist = r.quat_twist(ANY, axis)
        swing = r.quat_multiply(ANY, r.quat_conjugate(twist))
        assert np.allclose(np.cross(twist[:, :3], axis), 0, atol=1e-12)
        assert np.allclose(swing[:, :3] @ axis, 0, atol=1e-12)
        assert same(r.quat_multiply(swing, twist), ANY)


def test_unit_length():
    assert np.allclose(np.linalg.norm(r.quat_normalize(RNG.normal(size=(9, 4)) * 1e6), axis=-1), 1)
    assert np.array_equal(r.quat_normalize(np.zeros((2, 4))), r.quat_identity(2))
    assert r.quat_normalize(np.ones((2, 4), np.float32)).dtype == np.float32


def test_any_batch_dimensions():
    a, b = ANY[:24].reshape(2, 3, 4, 4), ANY[24:28]
    assert r.quat_multiply(a, b).shape == (2, 3, 4, 4)
    assert r.quat_rotate(a, np.ones(3)).shape == (2, 3, 4, 3)
    assert r.quat_to_matrix(a).shape == (2, 3, 4, 3, 3)
    assert r.matrix_to_quat(r.quat_to_matrix(a)).shape == a.shape
    assert r.quat_to_euler(a, "ZXY").shape == (2, 3, 4, 3)
    assert r.quat_to_rot6d(a).shape == (2, 3, 4, 6)
    assert r.quat_slerp(a, b, np.zeros((2, 3, 4))).shape == a.shape
    assert r.quat_twist(a, [0, 1, 0]).shape == a.shape
    assert r.quat_between(np.ones((2, 1, 3)), np.ones((5, 3))).shape == (2, 5, 4)
    for empty in (r.quat_multiply(ANY[:0], ANY[:0]), r.rotvec_to_quat(np.zeros((0, 3))), r.euler_to_quat(np.zeros((0, 3)))):
        assert empty.shape == (0, 4)
