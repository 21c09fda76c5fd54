"""Key points → our humanoid: where neck, elbows and wrists lie is kept, through the vectors of TED and PATS as well."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech import InputError, Motion, Speech, humanoid
from cospeech.motion.points import Points
from cospeech.motion.poses import direction_vectors, find_pose, keypoints2d
from cospeech.motion.poses.direction_vectors import points_of as ted_points
from cospeech.motion.poses.keypoints2d import points_of as pats_points
from cospeech.motion.poses.lift import lift
from cospeech.motion.rotations import axis_angle_to_quat, quat_angle, quat_multiply
from cospeech.motion.skeletons.ted import JOINTS
from cospeech.rules import RuleBasedModel
from tests.support.rules_laws import babble

INDEX = humanoid().index


@pytest.fixture(scope="module", params=["lively", "seated", "southpaw"])
def take(request) -> Motion:
    return RuleBasedModel().generate(Speech(babble(4, 15.0), 16_000), style=request.param, seed=2, fps=15)


def far(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b, axis=-1).max())


def test_points_of_ted_lie_where_they_lay(take):
    points = ted_points(take)
    motion = lift(points)
    assert motion.fps == points.fps
    assert far(ted_points(motion).values, points.values) < 0.005
    head = [m.skeleton.forward(m.rotations, m.root)[1][:, INDEX["head"]] for m in (motion, take)]
    assert np.degrees(quat_angle(*head)).max() < 2
    still = [k for k in range(55) if humanoid().names[k] in ("hips", "jaw") or "Leg" in humanoid().names[k]]
    assert not quat_angle(motion.rotations[:, still], humanoid().rest[still]).any()
    np.testing.assert_array_equal(motion.root, np.broadcast_to(humanoid().offsets[0], (len(take), 3)))


def test_only_directions_count(take):
    """The test goes through the vectors, which have the bone lengths of other people."""
    pose, points = find_pose("direction-vectors"), ted_points(take)
    motion = lift(pose.decode(pose.encode(points), points.fps))
    assert quat_angle(motion.rotations, lift(points).rotations).max() < 1e-6
    wrists = [JOINTS.index(name) for name in ("leftElbow", "leftWrist", "rightElbow", "rightWrist")]
    assert far(ted_points(motion).values[:, wrists], points.values[:, wrists]) < 0.005


def test_elbows_bend_about_their_hinge(take):
    """The arm's twist is that of the rules, whose elbows are hinges, although no point tells of it."""
    arms = [INDEX["leftUpperArm"], INDEX["rightUpperArm"]]
    arms_of_lift, own = (m.skeleton.forward(m.rotations, m.root)[1][:, arms] for m in (lift(ted_points(take)), take))
    assert np.degrees(quat_angle(arms_of_lift, own)).mean() < 3  # in the world: a shoulder that breathes turns the arm's parent


def test_the_mean_of_the_data_is_an_upright_person():
    motion = lift(direction_vectors.DIRECTION_VECTORS.decode(direction_vectors.MEAN[None]))
    positions, world = motion.skeleton.forward(motion.rotations, motion.root)
    at = {name: positions[0, k] for name, k in INDEX.items()}
    assert np.degrees(quat_angle(world[0, INDEX["head"]], humanoid().rest[0])) < 6
    assert abs(at["head"][2] - at["hips"][2]) < 0.08
    assert at["leftHand"][2] > 0.2
    assert at["rightHand"][2] > 0.2
    assert abs(at["leftHand"][1] - at["rightHand"][1]) < 0.03


def test_points_of_pats_lie_where_they_lay_in_the_picture(take):
    points = pats_points(take)
    motion = lift(points)
    now, was = (keypoints2d.to_vectors(p.values).reshape(-1, 2, 48) for p in (pats_points(motion), points))
    metres = 0.1753 / keypoints2d.SHOULDER
    off = np.linalg.norm(now - was, axis=1)[:, :6] * metres
    sides = [take.positions()[:, INDEX[f"{side}UpperArm"]] for side in ("left", "right")]
    across = sides[0] - sides[1]
    away = np.degrees(np.arctan2(np.abs(across[:, 2]), across[:, 0]))
    assert off[away < 18].max() < 0.06  # a speaker who is turned away has a narrow shoulder in the picture
    assert off[away < 18].mean() < 0.015
    pose = find_pose("keypoints2d")
    again = lift(pose.decode(pose.encode(points), points.fps))
    assert quat_angle(again.rotations, motion.rotations).max() < 1e-6
    shoulders, elbows, wrists = (
        motion.positions()[:, [INDEX["left" + n], INDEX["right" + n]], 2] for n in ("UpperArm", "LowerArm", "Hand")
    )
    assert (elbows - shoulders).min() > -0.01
    assert (wrists - elbows).min() > -0.01


def test_left_is_left_and_a_mirror_is_a_mirror(take):
    flip = [0, 1, 2, 3, 7, 8, 9, 4, 5, 6]
    points = ted_points(take)
    other = lift(Points(15, points.values[:, flip] * np.array([-1.0, 1, 1]), "ted"))
    assert quat_angle(other.rotations, lift(points).mirror().rotations).max() < 1e-5


def test_nothing_jumps_where_the_body_turns_and_bends():
    frames = 120
    rotations = np.broadcast_to(humanoid().rest, (frames, 55, 4)).copy()
    t = np.linspace(0, 2 * np.pi, frames)
    bend = quat_multiply(
        axis_angle_to_quat(np.array([0.0, 1, 0]), 0.9 * np.sin(t)),
        axis_angle_to_quat(np.array([1.0, 0, 0]), 0.5 * np.sin(2 * t)),
    )
    rotations[:, INDEX["upperChest"]] = bend
    rotations[:, INDEX["neck"]] = bend
    for side, sign in (("left", -1.0), ("right", 1.0)):
        rotations[:, INDEX[side + "UpperArm"]] = axis_angle_to_quat(np.array([0.0, 0, 1]), sign * (1 + 0.5 * np.sin(t)))
        rotations[:, INDEX[side + "LowerArm"]] = axis_angle_to_quat(np.array([0.0, 1, 0]), sign * (0.8 + 0.7 * np.sin(t)))
    motion = Motion(30, rotations, np.broadcast_to(humanoid().offsets[0], (frames, 3)))
    result = lift(ted_points(motion))
    assert np.degrees(quat_angle(result.rotations[1:], result.rotations[:-1])).max() < 12
    assert far(ted_points(result).values, ted_points(motion).values) < 0.04  # all of the bend is in one joint here


def test_bones_without_length_are_as_in_the_t_pose():
    motion = lift(Points(15, np.zeros((2, 10, 3)), "ted"))
    arms = [INDEX["leftHand"], INDEX["rightHand"]]
    np.testing.assert_allclose(motion.positions()[0, arms], humanoid().tpose[arms], atol=0.01)
    assert len(lift(Points(15, np.zeros((0, 10, 3)), "ted"))) == 0
    random = np.random.default_rng(0)
    wild = lift(Points(15, random.normal(size=(300, 10, 3)) * 10.0 ** random.uniform(-12, 6, (300, 1, 1)), "ted"))
    assert np.isfinite(wild.rotations).all()


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (Points(15, np.zeros((2, 10, 3)), "other"), "layout"),
        (Points(15, np.zeros((2, 9, 3)), "ted"), "10, 3"),
        (Points(15, np.zeros((2, 52, 3)), "pats"), "52, 2"),
        (Points(15, np.zeros((2, 52, 2)), "pats"), "frame 0"),
        (Points(15, np.full((2, 10, 3), np.nan), "ted"), "finite"),
    ],
)
def test_bad_points_are_told(points, words):
    with pytest.raises(InputError, match=words):
        lift(points)
