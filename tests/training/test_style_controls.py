"""Style controls: what they measure, where they come from, how they are told."""

from __future__ import annotations

import json

import numpy as np
import pytest

from cospeech.corpora.store import Store
from cospeech.corpora.store_files import Entry
from cospeech.corpora.store_writer import Piece, write_store
from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.poses import POSES, find_pose
from cospeech.motion.poses.controls import CONTROLS, QUANTILES, control_row, read_controls, style_controls
from cospeech.motion.rotations import axis_angle_to_quat, quat_multiply
from cospeech.motion.skeleton import find_skeleton
from cospeech.training.style_controls import control_quantiles, with_controls

FPS = 20.0


def raise_arms(pose_name: str, angle: float, frames: int = 200, yaw: float = 0.0) -> Motion:
    """A motion with both arms turned down from the T-pose by an angle about the front, and the whole body turned about Y."""
    skeleton = find_skeleton(find_pose(pose_name).skeleton)
    names = {"trinity": ("LeftArm", "RightArm"), "humanoid": ("leftUpperArm", "rightUpperArm")}[skeleton.kind]
    rotations = np.broadcast_to(skeleton.rest, (frames, len(skeleton), 4)).copy()
    for name, sign in zip(names, (-1, 1), strict=True):
        rotations[:, skeleton.index[name]] = axis_angle_to_quat(np.array([0.0, 0, 1]), np.full(frames, sign * angle))
    rotations[:, 0] = quat_multiply(axis_angle_to_quat(np.array([0.0, 1, 0]), np.full(frames, yaw)), rotations[:, 0])
    root = np.broadcast_to(skeleton.offsets[0], (frames, 3)).copy()
    return Motion(FPS, rotations, root, skeleton=skeleton)


def store(folder, clips: dict[str, np.ndarray], pose: str = "direction-vectors", split: str = "train") -> Store:
    def piece(name, values):
        entry = Entry(name, name[0], split, 0, len(values), 0.0, ("pose",))
        return Piece(entry, (), lambda: {"pose": values.astype(np.float32)})

    names = {"pose": find_pose(pose).names}
    write_store(folder, [piece(*row) for row in clips.items()], corpus="ted", pose=pose, fps=FPS, names=names)
    return Store(folder)


@pytest.mark.parametrize("name", ["expmap-upper", "expmap-full", "expmap-humanoid", "rot6d-humanoid"])
def test_height_and_radius_of_arms_at_an_angle(name):
    pose = find_pose(name)
    motion = raise_arms(name, np.radians(40))
    got = style_controls(pose.encode(motion), pose, FPS)
    skeleton = motion.skeleton
    arm, hand = ("LeftArm", "LeftHand") if skeleton.kind == "trinity" else ("leftUpperArm", "leftHand")
    rest = skeleton.tpose - skeleton.tpose[0]
    shoulder, length = rest[skeleton.index[arm]], np.linalg.norm(rest[skeleton.index[hand]] - rest[skeleton.index[arm]])
    assert got.shape == (200, 3)
    assert got.dtype == np.float32
    assert np.allclose(got[:, 0], shoulder[1] - length * np.sin(np.radians(40)), atol=0.02)
    assert np.allclose(got[:, 2], np.hypot(shoulder[0] + length * np.cos(np.radians(40)), shoulder[2]), atol=0.02)
    assert np.allclose(got[:, 1], 0, atol=1e-5)


def test_turning_and_walking_change_nothing():
    pose = find_pose("expmap-full")
    straight, another_way = raise_arms("expmap-full", 0.5), raise_arms("expmap-full", 0.5, yaw=1.2)
    another_way = Motion(
        FPS, another_way.rotations, another_way.root + np.linspace(0, 3, 200)[:, None], skeleton=another_way.skeleton
    )
    assert np.allclose(
        style_controls(pose.encode(straight), pose, FPS), style_controls(pose.encode(another_way), pose, FPS), atol=1e-3
    )


def test_speed_is_metres_per_second_and_the_mean_is_over_four_seconds():
    pose = find_pose("expmap-upper")
    still, second_pose = raise_arms("expmap-upper", 0.0, 400), raise_arms("expmap-upper", 0.8, 400)
    rotations = np.where((np.arange(400) < 200)[:, None, None], still.rotations, second_pose.rotations)
    got = style_controls(pose.encode(Motion(FPS, rotations, still.root, skeleton=still.skeleton)), pose, FPS)
    reach = np.flatnonzero(np.abs(np.diff(got[:, 0])) > 1e-6)
    assert reach.min() == 200 - 41
    assert reach.max() == 200 + 39
    length = 0.29111 + 0.2465  # upper arm and forearm of Trinity
    jump = 2 * length * np.sin(0.4) * FPS  # one step, metres per second
    assert np.allclose(got[200, 1], jump / 81, rtol=1e-3)


@pytest.mark.parametrize("name", POSES)
def test_every_representation_with_hands_in_space_has_finite_controls_and_the_others_are_refused(name):
    pose = find_pose(name)
    if name != "keypoints2d":
        values = np.random.default_rng(0).normal(size=(30, pose.dimensions)).cumsum(0) * 0.1 + 1
        got = style_controls(values, pose, FPS)
        assert got.shape == (30, 3)
        assert np.isfinite(got).all()
        assert (got[:, 1:] > 0).all() == (name != "face")  # whose hands rest
        return
    with pytest.raises(InputError, match="three dimensions"):
        style_controls(np.ones((5, pose.dimensions)), pose, FPS)


def test_a_store_gets_them_as_an_array_with_statistics(tmp_path):
    rng = np.random.default_rng(0)
    clips = {name: rng.normal(size=(frames, 27)).cumsum(0) for name, frames in (("a1", 90), ("a2", 130), ("b1", 60))}
    plain = store(tmp_path / "s", clips)
    more = with_controls(plain)
    assert "control" not in plain.arrays
    assert with_controls(more) is more
    own = style_controls(plain.clip("a2")["pose"], find_pose(plain.pose), FPS)
    assert np.array_equal(more.clip("a2")["control"], own)
    mean, std = more.statistics("control")
    assert np.allclose(mean, more.arrays["control"].mean(0), atol=1e-5)
    assert np.allclose(std, more.arrays["control"].std(0), rtol=1e-3)
    assert np.allclose(more.statistics("control", "b")[0], more.clip("b1")["control"].mean(0), atol=1e-5)
    window = next(more.windows(20, batch=4, seed=0, arrays=("pose", "control")))
    assert window["control"].shape == (4, 20, 3)
    assert "control" not in json.loads((tmp_path / "s" / "index.json").read_text())["arrays"]
    quantiles = control_quantiles(more)
    assert quantiles.shape == (QUANTILES, 3)
    assert (np.diff(quantiles, axis=0) >= 0).all()
    assert np.allclose(control_row({"hand_speed": 0.85}, quantiles), [quantiles[50, 0], quantiles[85, 1], quantiles[50, 2]])
    assert np.allclose(control_row({"hand_radius": 1}, quantiles[:, 2:], ("hand_radius",)), quantiles[100, 2])


def test_what_is_no_control_is_refused(tmp_path):
    for text in ("hand", "hand_height", "hand_height:", "hand_height:x", "hand_height:1.1", "hand_height:nan", "",
                 "hand_height:0.5,hand_height:0.6"):  # fmt: skip
        with pytest.raises(InputError):
            read_controls(text)
    with pytest.raises(InputError, match="trained without"):
        control_row({"hand_height": 0.5}, np.zeros((QUANTILES, 0)), ())
    with pytest.raises(InputError, match="hand_speed"):
        control_row({"hand_height": 0.5}, np.zeros((QUANTILES, 1)), ("hand_speed",))
    with pytest.raises(InputError, match="0 … 1"):
        control_row({"hand_height": 2}, np.zeros((QUANTILES, 3)), CONTROLS)
    with pytest.raises(InputError, match="training"):
        control_quantiles(with_controls(store(tmp_path / "s", {"a": np.ones((9, 27))}, split="test")))
