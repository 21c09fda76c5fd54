"""SMPL-X npz in BEAT2's layout: opens without pickle, turns as SMPL-X turns, and is read with distrust."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.export import load, open_writer, save
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, quat_angle, quat_to_rotvec
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from tests.support.motions import gesturing

# SMPL-X joint numbers, typed from the model's own list
PELVIS, HEAD, LEFT_SHOULDER, RIGHT_ELBOW, JAW, LEFT_INDEX_1, RIGHT_THUMB_3 = 0, 15, 16, 19, 22, 25, 54


def arrays(path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as data:
        return dict(data)


def test_layout_is_beat2s(tmp_path):
    motion = gesturing(40)
    save(motion, tmp_path / "a.npz")
    data = arrays(tmp_path / "a.npz")
    shapes = {key: (value.shape, value.dtype.kind) for key, value in data.items()}
    assert shapes == {
        "betas": ((300,), "f"), "poses": ((40, 165), "f"), "expressions": ((40, 100), "f"), "trans": ((40, 3), "f"),
        "model": ((), "U"), "gender": ((), "U"), "mocap_frame_rate": ((), "i"),
        "arkit": ((40, 52), "f"), "arkit_names": ((52,), "U"),
    }  # fmt: skip
    assert (str(data["model"]), str(data["gender"]), int(data["mocap_frame_rate"])) == ("smplx2020", "neutral", 30)
    np.testing.assert_allclose(data["arkit"], motion.face, atol=1e-6)
    assert tuple(data["arkit_names"]) == ARKIT


def test_joints_turn_under_smplx_numbers(tmp_path):
    """Each joint alone: its axis-angle stands in SMPL-X's place for it, and nowhere else."""
    index = humanoid().index
    rest = np.zeros((1, 55, 4)) + (0, 0, 0, 1)
    for ours, number in (
        ("hips", PELVIS), ("head", HEAD), ("leftUpperArm", LEFT_SHOULDER), ("rightLowerArm", RIGHT_ELBOW),
        ("leftIndexProximal", LEFT_INDEX_1), ("rightThumbDistal", RIGHT_THUMB_3),
    ):  # fmt: skip
        q = rest.copy()
        q[0, index[ours]] = axis_angle_to_quat((0, 0.6, 0.8), 0.7)
        save(Motion(fps=30, rotations=q, root=humanoid().offsets[:1]), tmp_path / "a.npz")
        poses = arrays(tmp_path / "a.npz")["poses"].reshape(55, 3)
        expected = np.zeros((55, 3))
        expected[number] = 0.7 * np.array([0, 0.6, 0.8])
        np.testing.assert_allclose(poses, expected, atol=2e-6)


def test_jaw_opens_with_the_face(tmp_path):
    motion = gesturing(30)
    save(motion, tmp_path / "a.npz")
    jaw = arrays(tmp_path / "a.npz")["poses"].reshape(30, 55, 3)[:, JAW]
    np.testing.assert_allclose(jaw[:, 0], 0.35 * motion.face[:, ARKIT_INDEX["jawOpen"]], atol=1e-6)
    assert np.abs(jaw[:, 1:]).max() == 0


@pytest.mark.parametrize("fps", [30, 60, 29.97])
def test_round_trip(tmp_path, fps):
    motion = gesturing(70, fps=fps)
    save(motion, tmp_path / "a.npz")
    read = load(tmp_path / "a.npz")
    assert (read.skeleton.kind, len(read), read.fps) == ("smplx", 70, fps)
    back = read.retarget("humanoid")
    others = [k for k, name in enumerate(humanoid().names) if name != "jaw"]  # the jaw is in the face
    assert quat_angle(back.rotations, motion.rotations)[:, others].max() < 1e-5
    np.testing.assert_allclose(back.root, motion.root, atol=1e-6)
    np.testing.assert_allclose(back.face, motion.face, atol=1e-6)


def foreign(**changes: object) -> bytes:
    """A file as another program writes it: no face of ours, strings as numpy makes them."""
    poses = np.zeros((5, 165), np.float32)
    poses[:, JAW * 3] = 0.175
    data = {
        "betas": np.zeros(300), "poses": poses, "expressions": np.zeros((5, 100)), "trans": np.ones((5, 3)),
        "model": np.array("smplx2020"), "gender": np.array("neutral"), "mocap_frame_rate": np.array(30),
    } | changes  # fmt: skip
    out = io.BytesIO()
    np.savez(out, **{key: value for key, value in data.items() if value is not None})
    return out.getvalue()


def test_files_of_others(tmp_path):
    (tmp_path / "a.npz").write_bytes(foreign())
    motion = load(tmp_path / "a.npz")
    np.testing.assert_allclose(motion.face[:, ARKIT_INDEX["jawOpen"]], 0.5, atol=1e-6)
    (tmp_path / "b.npz").write_bytes(foreign(poses=np.zeros((5, 165)), mocap_frame_rate=None, mocap_framerate=np.array(120.0)))
    motion = load(tmp_path / "b.npz")
    assert (motion.face, motion.fps) == (None, 120)


def nodding(joints: int, upright: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(20, joints · 3) poses of a body whose head (joint 15) nods and whose left elbow (18) bends, and its (20, 3) places."""
    poses = np.zeros((20, joints, 3))
    poses[:, 0] = upright
    poses[:, 15, 0] = np.linspace(0, 0.4, 20)
    poses[:, 18, 1] = -0.8
    return poses.reshape(20, -1), np.column_stack([np.linspace(0, 1, 20), np.full(20, 0.2), np.full(20, 0.9)])


@pytest.mark.parametrize(("joints", "fingers"), [(55, 25), (52, 22), (24, None)])
def test_amass_stands_upright_with_every_body(tmp_path, joints, fingers):
    """AMASS' world has Z up: its poses turn the pelvis by a quarter about X, and the height is the third number."""
    poses, places = nodding(joints, np.array([np.pi / 2, 0, 0]))
    if fingers is not None:
        poses[:, 3 * fingers + 2] = 0.5  # the first joint of the left index finger
    data = foreign(poses=poses, trans=places, mocap_frame_rate=None, mocap_framerate=np.array(60.0))
    (tmp_path / "a.npz").write_bytes(data)
    motion = load(tmp_path / "a.npz")
    assert (motion.skeleton.kind, motion.fps, len(motion)) == ("smplx", 60, 20)
    np.testing.assert_allclose(quat_to_rotvec(motion.rotations[:, 0].astype(float)), 0, atol=1e-6)
    np.testing.assert_allclose(motion.root[:, 1], 0.9, atol=0.03)  # the height
    np.testing.assert_allclose(np.diff(motion.root[[0, -1]], axis=0)[0], [1, 0, 0], atol=1e-6)
    angles = quat_to_rotvec(motion.rotations.astype(float))
    names = list(motion.skeleton.names)
    np.testing.assert_allclose(angles[:, names.index("head"), 0], np.linspace(0, 0.4, 20), atol=1e-6)
    np.testing.assert_allclose(angles[:, names.index("left_elbow"), 1], -0.8, atol=1e-6)
    np.testing.assert_allclose(angles[:, names.index("left_index1"), 2], 0 if fingers is None else 0.5, atol=1e-6)


def test_a_world_with_y_up_stays_and_so_does_who_bows(tmp_path):
    poses, places = nodding(55, np.array([0.7, 0.3, 0.0]))  # bent forward by 40°
    (tmp_path / "a.npz").write_bytes(foreign(poses=poses, trans=places))
    motion = load(tmp_path / "a.npz")
    np.testing.assert_allclose(
        quat_to_rotvec(motion.rotations[:, 0].astype(float)), np.tile([0.7, 0.3, 0.0], (20, 1)), atol=1e-6
    )
    np.testing.assert_allclose(np.diff(motion.root[[0, -1]], axis=0)[0], [1, 0, 0], atol=1e-6)


def bomb() -> bytes:
    """A few kilobytes that say they unpack to 3 GiB."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("poses.npy", bytes(12 << 20))
    data = bytearray(out.getvalue())
    at = data.rindex(b"PK\x01\x02")
    data[at + 24 : at + 28] = (3 << 30).to_bytes(4, "little")
    return bytes(data)


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"", "empty"),
        (b"PK\x05\x06" + bytes(18), "no 'poses'"),
        (b"hello", "not a readable"),
        (foreign()[:-30], "not a readable"),
        (foreign(poses=None), "no 'poses'"),
        (foreign(trans=None), "no 'trans'"),
        (foreign(mocap_frame_rate=None), "mocap_frame_rate"),
        (foreign(poses=np.zeros((5, 159))), "165"),
        (foreign(poses=np.zeros(5)), "165"),
        (foreign(trans=np.zeros((4, 3))), "165"),
        (foreign(poses=np.full((5, 165), np.nan)), "not finite"),
        (foreign(poses=np.zeros((5, 165), "<U3")), "165"),
        (foreign(mocap_frame_rate=np.array(0)), "frames per second"),
        (foreign(mocap_frame_rate=np.array([30, 30])), "165|frames"),
        (foreign(arkit=np.zeros((5, 3)), arkit_names=np.array(ARKIT)), "arkit"),
        (foreign(poses=np.array([{"a": 1}], object)), "object"),
        (bomb(), "unpacks"),
    ],
)
def test_bad_files(tmp_path, data, problem):
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(InputError, match=problem) as refusal:
        load(tmp_path / "a.npz")
    assert "\n" not in str(refusal.value)


def test_a_writer_takes_no_motion_of_another_skeleton(tmp_path):
    """SMPL-X has as many joints as our humanoid: its rotations would be those of other joints."""
    body = gesturing(3).retarget("smplx")
    assert len(body.skeleton) == len(humanoid())
    with open_writer(tmp_path / "a.bvh", skeleton=humanoid(), fps=body.fps) as writer:
        writer.write(gesturing(2))
        with pytest.raises(InputError, match=r"'humanoid', 55 joints.* got .*'smplx', 55 joints"):
            writer.write(body)
