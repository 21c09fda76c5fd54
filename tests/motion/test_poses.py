"""Pose representations: there and back, continuity, batch dimensions, the published facts."""

from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.points import Points
from cospeech.motion.poses import POSES, direction_vectors, euler, expmap, find_pose, keypoints2d
from cospeech.motion.poses.rot6d import Rot6D
from cospeech.motion.rotations import axis_angle_to_quat, quat_angle, quat_continuous, quat_multiply, quat_normalize
from cospeech.motion.skeleton import Skeleton, find_skeleton

RNG = np.random.default_rng(5)


def smooth(*shape: int, scale: float = 1.0) -> np.ndarray:
    """Random curves along the first axis, some tenths per frame."""
    t = np.arange(shape[0]).reshape(-1, *[1] * (len(shape) - 1)) / 8
    phase = RNG.uniform(0, 6.28, (4, *shape[1:]))
    return scale * sum(np.sin((k + 1) * t / 2 + phase[k]) for k in range(4)) / 2


def moving(skeleton: Skeleton, frames: int = 90, fps: float = 20.0) -> Motion:
    rotations = quat_normalize(
        np.concatenate([smooth(frames, len(skeleton), 3, scale=0.5), np.ones((frames, len(skeleton), 1))], -1)
    )
    turn = axis_angle_to_quat(np.array([0.0, 1, 0]), np.linspace(2.0, 5.0, frames))
    rotations[:, 0] = quat_multiply(turn, rotations[:, 0])
    return Motion(fps, quat_continuous(rotations), smooth(frames, 3) + [0, 0.9, 0], skeleton=skeleton)


@pytest.mark.parametrize("name", POSES)
def test_every_representation_says_what_it_is(name):
    pose = find_pose(name)
    assert pose.name == name
    assert len(pose.names) == len(set(pose.names)) == pose.dimensions
    assert pose.source in ("points", "motion")
    assert pose.fps > 0


def test_dimensions_are_those_of_the_papers():
    dimensions = {"direction-vectors": 27, "keypoints2d": 96, "expmap-upper": 45, "expmap-full": 69, "euler": 141, "rot6d": 282}
    dimensions |= {"rot6d-smplx": 330, "rot6d-humanoid": 330}
    dimensions |= {"expmap-humanoid": 57, "face": 55}  # ours
    assert {name: find_pose(name).dimensions for name in POSES} == dimensions


@pytest.mark.parametrize(("name", "layout"), [("direction-vectors", "ted"), ("keypoints2d", "pats")])
def test_representations_of_key_points_take_motion(name, layout):
    pose, motion = find_pose(name), moving(find_skeleton("humanoid"), frames=5)
    points = importlib.import_module(f"cospeech.corpora.{layout}").points_of(motion)
    assert points.layout == layout
    assert (pose.encode(motion) == pose.encode(points)).all()
    assert np.allclose(
        pose.encode(motion.retarget("mixamo")), pose.encode(motion), atol=0.05 * np.abs(pose.encode(motion)).max()
    )


@pytest.mark.parametrize("name", [name for name in POSES if find_pose(name).source == "motion"])
def test_motion_of_another_skeleton_is_refused_with_the_call_that_mends_it(name):
    pose = find_pose(name)
    other = "beat" if pose.skeleton == "humanoid" else "humanoid"
    motion = replace(moving(find_skeleton(other), frames=3), face=np.zeros((3, 52)))
    with pytest.raises(InputError) as error:
        pose.encode(motion)
    assert error.value.hint == f'motion.retarget("{pose.skeleton}") first'
    assert pose.encode(motion.retarget(pose.skeleton)).shape == (3, pose.dimensions)


def test_unknown_name_is_answered_with_the_nearest():
    with pytest.raises(InputError, match="did you mean 'euler'"):
        find_pose("eulr")


def test_direction_vectors_there_and_back():
    vectors = RNG.normal(size=(7, 27))
    unit = (vectors.reshape(7, 9, 3) / np.linalg.norm(vectors.reshape(7, 9, 3), axis=-1, keepdims=True)).reshape(7, 27)
    points = direction_vectors.DIRECTION_VECTORS.decode(unit)
    assert points.values.shape == (7, 10, 3)
    assert points.layout == "ted"
    np.testing.assert_allclose(direction_vectors.DIRECTION_VECTORS.encode(points), unit, atol=1e-12)
    lengths = [np.linalg.norm(points.values[:, b] - points.values[:, a], axis=-1) for a, b, _ in direction_vectors.BONES]
    np.testing.assert_allclose(lengths, [[length] * 7 for *_, length in direction_vectors.BONES], atol=1e-12)


def test_the_published_mean_is_an_upright_person_with_left_at_plus_x():
    points = direction_vectors.to_points(direction_vectors.MEAN)
    name = {joint: points[k] for k, joint in enumerate(direction_vectors.JOINTS)}
    assert name["neck"][1] > 0.2
    assert name["head"][1] > name["neck"][1]
    assert name["leftShoulder"][0] > 0.15
    assert name["rightShoulder"][0] < -0.15
    assert name["leftWrist"][2] > 0.2  # forearms point to the front
    assert name["rightWrist"][2] > 0.2


def test_point_representations_take_any_batch():
    ted, pats = RNG.normal(size=(2, 3, 5, 10, 3)), RNG.normal(size=(2, 3, 52, 2))
    a, b = direction_vectors.to_vectors(ted), keypoints2d.to_vectors(pats)
    assert a.shape == (2, 3, 5, 27)
    assert b.shape == (2, 3, 96)
    np.testing.assert_allclose(a[1, 2, 4], direction_vectors.to_vectors(ted[1, 2, 4]))
    np.testing.assert_allclose(b[1, 2], keypoints2d.to_vectors(pats[1, 2]))
    assert direction_vectors.to_points(a).shape == ted.shape
    assert keypoints2d.to_points(b).shape == pats.shape


def test_a_bone_of_no_length_is_zeros():
    assert not direction_vectors.to_vectors(np.zeros((4, 10, 3))).any()


def test_key_points_there_and_back_whatever_their_place_and_scale():
    vectors = keypoints2d.to_vectors(RNG.normal(size=(6, 52, 2)))
    back = keypoints2d.KEYPOINTS2D.decode(vectors)
    np.testing.assert_allclose(keypoints2d.KEYPOINTS2D.encode(back), vectors, rtol=1e-12, atol=1e-9)
    elsewhere = Points(15, back.values * 2.5 + [400, -300], "pats")
    np.testing.assert_allclose(keypoints2d.KEYPOINTS2D.encode(elsewhere), vectors, rtol=1e-9, atol=1e-7)
    shoulder = np.linalg.norm(back.values[:, 1] - back.values[:, 0], axis=-1)
    np.testing.assert_allclose(shoulder, keypoints2d.SHOULDER)


def test_key_points_lie_as_the_published_means_do():
    """Right shoulder at −167, wrists below the neck: y down in the vectors, up in the points."""
    points = np.zeros((1, 52, 2))
    points[0, 1], points[0, 4], points[0, 3] = (-50, 0), (50, 0), (-60, -75)
    vectors = keypoints2d.to_vectors(points)[0]
    names = dict(zip(keypoints2d.KEYPOINTS2D.names, vectors, strict=True))
    assert names["RShoulder.x"] == pytest.approx(-167)
    assert names["LShoulder.x"] == pytest.approx(167)
    assert names["RWrist.y"] == pytest.approx(75 * 167 / 50)


def test_a_shoulder_on_the_neck_is_refused():
    points = RNG.normal(size=(5, 52, 2))
    points[3, 1] = points[3, 0]
    with pytest.raises(InputError, match="frame 3"):
        keypoints2d.to_vectors(points)


@pytest.mark.parametrize("pose", [euler.EULER, Rot6D(), Rot6D(("Hips", "Head"))], ids=lambda p: f"{p.name}{p.dimensions}")
def test_rotations_there_and_back_on_beat(pose):
    motion = moving(find_skeleton("beat"))
    vectors = pose.encode(motion)
    back = pose.decode(vectors, 20.0)
    columns = [motion.skeleton.index[name] for name in pose.joints]
    assert vectors.shape == (90, pose.dimensions)
    assert quat_angle(back.rotations[:, columns], motion.rotations[:, columns]).max() < 1e-6
    others = [k for k in range(len(motion.skeleton)) if k not in columns]
    assert quat_angle(back.rotations[:, others], motion.skeleton.rest[others]).max() < 1e-9


@pytest.mark.parametrize("name", ["rot6d-smplx", "rot6d-humanoid"])
def test_whole_skeletons_there_and_back(name):
    pose = find_pose(name)
    motion = moving(find_skeleton(pose.skeleton))
    back = pose.decode(pose.encode(motion), motion.fps)
    assert quat_angle(back.rotations, motion.rotations).max() < 1e-6
    assert back.skeleton.kind == pose.skeleton


@pytest.mark.parametrize("pose", [expmap.UPPER, expmap.FULL], ids=lambda p: p.name)
def test_exponential_maps_there_and_back(pose):
    motion = moving(find_skeleton("trinity"))
    vectors = pose.encode(motion)
    place, turn = expmap.walk(motion)
    options = {"start": (place[0, 0], place[0, 2], turn[0])} if pose.hips else {}
    back = pose.decode(vectors, 20.0, motion.skeleton, **options)
    columns = [motion.skeleton.index[name] for name in pose.joints]
    assert quat_angle(back.rotations[:, columns], motion.rotations[:, columns]).max() < 1e-6
    if pose.hips:
        np.testing.assert_allclose(back.root, motion.root, atol=1e-9)
        assert quat_angle(back.rotations[:, 0], motion.rotations[:, 0]).max() < 1e-6


def test_the_walking_point_is_smoothed_as_scipy_does():
    motion = moving(find_skeleton("trinity"))
    place, _ = expmap.walk(motion)
    for axis in (0, 2):
        expected = gaussian_filter1d(motion.root[:, axis], 0.25 * motion.fps, mode="nearest")
        np.testing.assert_allclose(place[:, axis], expected, rtol=0, atol=1e-12)
    assert np.ptp(place[:, [0, 2]], axis=0).min() > 0.1


def test_hips_do_not_depend_on_where_and_which_way_the_walk_goes():
    motion = moving(find_skeleton("trinity"))
    turn = axis_angle_to_quat(np.array([0.0, 1, 0]), 1.3)
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat_multiply(turn, rotations[:, 0])
    from cospeech.motion.rotations import quat_rotate

    elsewhere = Motion(motion.fps, rotations, quat_rotate(turn, motion.root) + [3.0, 0, -2], skeleton=motion.skeleton)
    np.testing.assert_allclose(expmap.FULL.encode(elsewhere), expmap.FULL.encode(motion), atol=1e-9)


@pytest.mark.parametrize("pose", [euler.EULER, expmap.UPPER], ids=lambda p: p.name)
def test_no_jumps_past_half_a_turn(pose):
    """An arm that turns from 150° to 250°: the vectors go on as smoothly as it does."""
    skeleton = find_skeleton("beat") if pose is euler.EULER else find_skeleton("trinity")
    rotations = np.broadcast_to(skeleton.rest, (60, len(skeleton), 4)).copy()
    angles = np.radians(np.linspace(150, 250, 60))
    rotations[:, skeleton.index["LeftArm"]] = axis_angle_to_quat(np.array([0.36, 0.48, 0.8]), angles)
    either_sign = rotations * RNG.choice([-1.0, 1.0], (60, 1, 1))  # signs of quaternions mean nothing
    vectors = pose.encode(Motion(20, either_sign, np.zeros((60, 3)), skeleton=skeleton))
    step = np.abs(np.diff(vectors, axis=0)).max()
    assert step < (8 if pose is euler.EULER else 0.05)
    canonical = pose.encode(Motion(20, rotations[30:31], np.zeros((1, 3)), skeleton=skeleton))
    back = pose.decode(vectors, 20, skeleton)
    assert quat_angle(back.rotations, rotations).max() < 1e-6
    assert np.abs(canonical).max() <= (180 if pose is euler.EULER else np.pi) + 1e-9


def test_rotation_vectors_near_zero_half_and_full_turns():
    axis = np.array([0.6, 0, 0.8])
    for angle in (0, 1e-14, 1e-9, 1e-4, np.pi - 1e-9, np.pi, np.pi + 1e-9, 6.0):
        vector = expmap.to_rotvecs(axis_angle_to_quat(axis, angle))
        np.testing.assert_allclose(vector, axis * angle, atol=1e-9)
        assert quat_angle(expmap.to_rotations(vector), axis_angle_to_quat(axis, angle)) < 1e-8


def test_wrong_shapes_and_joints_are_named():
    with pytest.raises(InputError, match="141"):
        euler.EULER.decode(np.zeros((4, 140)))
    with pytest.raises(InputError, match="without the joint 'Spine'"):
        euler.EULER.encode(Motion(15, np.zeros((2, 55, 4)) + [0, 0, 0, 1], np.zeros((2, 3))))
    with pytest.raises(InputError, match="direction vectors"):
        direction_vectors.to_vectors(np.zeros((4, 52, 2)))
    with pytest.raises(InputError, match="key points"):
        keypoints2d.to_vectors(np.zeros((4, 10, 3)))
