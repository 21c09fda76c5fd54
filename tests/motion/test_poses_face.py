"""The representation of a talking face: there and back, and what it makes of any numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.poses.face import FACE, MIRROR
from cospeech.motion.rotations import quat_angle, quat_multiply, rotvec_to_quat
from cospeech.motion.skeleton import find_skeleton, humanoid

RNG = np.random.default_rng(0)
FRAMES = 30
BODY = humanoid()
NECK, HEAD = BODY.index["neck"], BODY.index["head"]


def vectors() -> np.ndarray:
    return np.concatenate([RNG.uniform(0, 1, (FRAMES, 52)), RNG.uniform(-0.2, 0.2, (FRAMES, 3))], 1)


def test_there_and_back():
    numbers = vectors()
    np.testing.assert_allclose(FACE.encode(FACE.decode(numbers)), numbers, atol=1e-6)


def test_neck_and_head_turn_half_each_and_nothing_else_moves():
    numbers = vectors()
    motion = FACE.decode(numbers, 30.0, start=2.0)
    assert (motion.fps, motion.start) == (30.0, 2.0)
    assert quat_angle(motion.rotations[:, NECK], motion.rotations[:, HEAD]).max() < 1e-3
    whole = quat_multiply(motion.rotations[:, NECK].astype(float), motion.rotations[:, HEAD].astype(float))
    assert quat_angle(whole, rotvec_to_quat(numbers[:, 52:])).max() < 1e-3
    others = [k for k in range(len(BODY)) if k not in (NECK, HEAD)]
    np.testing.assert_array_equal(motion.rotations[:, others], np.broadcast_to(BODY.rest[others], (FRAMES, len(others), 4)))
    np.testing.assert_allclose(motion.root, np.broadcast_to(BODY.offsets[0], (FRAMES, 3)), atol=1e-7)


def test_what_a_face_cannot_be_is_held_back():
    wild = vectors() * 8 - 3
    motion = FACE.decode(wild)
    np.testing.assert_allclose(motion.face, np.clip(wild[:, :52], 0, 1), atol=1e-6)
    back = np.linalg.norm(FACE.encode(motion)[:, 52:], axis=1)
    assert back.max() <= 0.6 + 1e-5
    assert not FACE.decode(np.zeros((3, 55))).face.any()


def test_pieces_are_the_whole():
    rows = vectors()
    whole, pieces = FACE.decode(rows), [FACE.decode(rows[a : a + 7]) for a in range(0, FRAMES, 7)]
    np.testing.assert_array_equal(np.concatenate([p.face for p in pieces]), whole.face)
    rotations = np.concatenate([p.rotations for p in pieces])
    assert quat_angle(rotations, whole.rotations).max() < 1e-3


def test_a_mirrored_motion_is_the_mirrored_numbers():
    numbers = vectors()
    signs = np.array([*np.ones(53), -1, -1])
    np.testing.assert_allclose(FACE.encode(FACE.decode(numbers).mirror()), numbers[:, MIRROR] * signs, atol=1e-6)


def test_what_is_no_face_is_refused():
    body = FACE.decode(vectors())
    with pytest.raises(InputError, match="without a face"):
        FACE.encode(replace(body, face=None))
    other = find_skeleton("trinity")
    still = Motion(20.0, np.broadcast_to(other.rest, (2, len(other), 4)), np.zeros((2, 3)), skeleton=other)
    with pytest.raises(InputError, match="retarget"):
        FACE.encode(still)
    with pytest.raises(InputError, match="retarget"):
        FACE.decode(vectors(), skeleton=other)
    for wrong in (np.zeros((3, 54)), np.full((3, 55), np.nan), np.full((3, 55), np.inf), np.full((3, 55), 1e3)):
        with pytest.raises(InputError):
            FACE.decode(wrong)
