"""Arms that sweep through the torso are led around it smoothly, in pieces of any size; others stay as they are."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.motion.kinematics.arm_clearance import find_pushes, keep_arms_out
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, quat_identity, quat_multiply
from cospeech.motion.skeleton import humanoid
from cospeech.rules.arm_push import ArmPush

REACH, FRAMES, FPS = 7, 90, 30.0


def sweeping() -> np.ndarray:
    """The right forearm swings from the side into the belly and back, twice; the left arm hangs."""
    q = quat_identity(FRAMES, len(humanoid()))
    joint = humanoid().index
    q[:, joint["leftUpperArm"]] = axis_angle_to_quat((0, 0, 1), -np.radians(55))
    q[:, joint["rightUpperArm"]] = axis_angle_to_quat((0, 0, 1), np.radians(75))
    swing = 0.5 * (1 - np.cos(2 * np.pi * np.arange(FRAMES) / 45))
    inwards = axis_angle_to_quat((0, 1, 0), 1.9 * swing)
    q[:, joint["rightLowerArm"]] = quat_multiply(axis_angle_to_quat((0, 0, 1), np.full(FRAMES, 0.5)), inwards)
    return q


def keep_arms_out_in_pieces(q: np.ndarray, *cuts: int) -> np.ndarray:
    pushes, pieces, start_of_waiting, waiting = ArmPush(REACH, REACH, 1.0), [], 0, q
    for start, end in zip((0, *cuts), (*cuts, len(q)), strict=True):
        pushes.add(q[start:end])
        count = max(end - REACH, 0) - start_of_waiting
        if count > 0:
            piece, waiting, start_of_waiting = waiting[:count].copy(), waiting[count:], start_of_waiting + count
            pushes.apply(piece)
            pieces.append(piece)
    pushes.finish()
    piece = waiting.copy()
    pushes.apply(piece)
    return np.concatenate([*pieces, piece])


def jerk(q: np.ndarray) -> float:
    motion = Motion(FPS, q, np.tile(humanoid().offsets[0], (len(q), 1)))
    wrist = motion.positions()[:, humanoid().index["rightHand"]]
    return float(np.linalg.norm(np.diff(wrist, 3, axis=0), axis=1).max() * FPS**3)


def test_the_sweep_meets_the_body():
    deep = np.linalg.norm(find_pushes(sweeping()), axis=-1)
    assert deep[:, 1].max() > 0.05
    assert deep[:, 0].max() < 1e-6


def test_an_arm_is_led_around_the_body_without_a_jerk():
    once, smooth = sweeping(), keep_arms_out_in_pieces(sweeping())
    keep_arms_out(once)
    keep_arms_out(smooth)
    assert np.linalg.norm(find_pushes(smooth), axis=-1).max() < 0.01
    assert jerk(smooth) < 0.7 * jerk(once)


@pytest.mark.parametrize("cuts", [(1,), (8, 9, 40), (30, 60), tuple(range(1, FRAMES))])
def test_pieces_make_the_bits_of_the_whole(cuts):
    assert np.array_equal(keep_arms_out_in_pieces(sweeping(), *cuts), keep_arms_out_in_pieces(sweeping()))


def test_arms_that_touch_nothing_stay_as_they_are():
    q = sweeping()
    joint = humanoid().index
    before, after = q.copy(), keep_arms_out_in_pieces(q)
    for name in ("leftUpperArm", "leftLowerArm"):
        np.testing.assert_allclose(after[:, joint[name]], before[:, joint[name]], atol=1e-9)
    far = np.flatnonzero(np.linalg.norm(find_pushes(q), axis=-1).max(1) > 0)
    away = np.setdiff1d(np.arange(FRAMES), np.concatenate([far + k for k in range(-REACH, REACH + 1)]))
    assert len(away)
    assert np.array_equal(after[away], before[away])
