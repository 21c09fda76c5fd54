"""Live Link Face CSV and ARKit JSON: their own order of names, exact length, round trips, bad input."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest

from cospeech.errors import InputError
from cospeech.export import load, open_writer, save
from cospeech.export.arkit_json import NAMES
from cospeech.export.live_link_csv import COLUMNS
from cospeech.motion.motion import Motion
from cospeech.motion.rotations import axis_angle_to_quat, quat_angle
from cospeech.motion.skeleton import humanoid
from cospeech.motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from tests.support.motions import gesturing

# The header as the app writes it (63 columns), typed from its recordings and not from our tables.
APP_HEADER = (
    "Timecode,BlendShapeCount,EyeBlinkLeft,EyeLookDownLeft,EyeLookInLeft,EyeLookOutLeft,EyeLookUpLeft,EyeSquintLeft,"
    "EyeWideLeft,EyeBlinkRight,EyeLookDownRight,EyeLookInRight,EyeLookOutRight,EyeLookUpRight,EyeSquintRight,EyeWideRight,"
    "JawForward,JawRight,JawLeft,JawOpen,MouthClose,MouthFunnel,MouthPucker,MouthRight,MouthLeft,MouthSmileLeft,"
    "MouthSmileRight,MouthFrownLeft,MouthFrownRight,MouthDimpleLeft,MouthDimpleRight,MouthStretchLeft,MouthStretchRight,"
    "MouthRollLower,MouthRollUpper,MouthShrugLower,MouthShrugUpper,MouthPressLeft,MouthPressRight,MouthLowerDownLeft,"
    "MouthLowerDownRight,MouthUpperUpLeft,MouthUpperUpRight,BrowDownLeft,BrowDownRight,BrowInnerUp,BrowOuterUpLeft,"
    "BrowOuterUpRight,CheekPuff,CheekSquintLeft,CheekSquintRight,NoseSneerLeft,NoseSneerRight,TongueOut,HeadYaw,HeadPitch,"
    "HeadRoll,LeftEyeYaw,LeftEyePitch,LeftEyeRoll,RightEyeYaw,RightEyePitch,RightEyeRoll"
)


def one_shape(name: str, frames: int = 1) -> Motion:
    """A still figure with one weight at 0.75."""
    motion = gesturing(frames)
    face = np.zeros((frames, 52))
    face[:, ARKIT_INDEX[name]] = 0.75
    return Motion(fps=30, rotations=motion.rotations, root=motion.root, face=face)


def test_csv_has_the_header_of_the_app():
    assert ",".join(COLUMNS) == APP_HEADER


@pytest.mark.parametrize("name", ARKIT)
def test_csv_puts_every_shape_under_its_own_name(tmp_path, name):
    path = tmp_path / "a.csv"
    save(one_shape(name), path)
    header, row = (line.split(",") for line in path.read_text().splitlines())
    assert header == APP_HEADER.split(",")
    assert row[1] == "61"
    hot = [h for h, cell in zip(header[2:54], row[2:54], strict=True) if float(cell)]
    assert hot == [name[0].upper() + name[1:]]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".csv", ".json"])
@pytest.mark.parametrize("fps", [24, 25, 30, 30000 / 1001, 60, 18, 120])
@pytest.mark.parametrize("frames", [1, 7, 31, 400])
def test_face_round_trip(tmp_path, suffix, fps, frames):
    motion = gesturing(frames, fps=fps)
    path = tmp_path / f"a{suffix}"
    with open_writer(path, skeleton=motion.skeleton, fps=fps) as writer:
        for k in range(0, frames, 13):
            writer.write(motion[k : k + 13])
    options = {"fps": fps} if suffix == ".csv" else {}
    back = load(path, **options)
    assert len(back) == frames
    assert frames == 1 or back.fps == pytest.approx(fps, rel=1e-6)
    np.testing.assert_allclose(back.face, motion.face, atol=1e-5)


@pytest.mark.parametrize("fps", [24, 25, 30, 30000 / 1001, 60])
def test_csv_tells_its_frame_rate_by_itself(tmp_path, fps):
    path = tmp_path / "a.csv"
    motion = gesturing(400, fps=fps)
    save(motion, path)
    back = load(path)
    assert (len(back), back.fps) == (400, pytest.approx(fps, rel=1e-6))
    last = path.read_text().splitlines()[-1].split(",")[0]
    hours, minutes, seconds, frame = last.split(":")
    assert int(hours) * 3600 + int(minutes) * 60 + int(seconds) + float(frame) / round(fps) == pytest.approx(
        399 / fps, abs=1e-3
    )


def test_csv_angles_turn_the_right_way(tmp_path):
    """Positive yaw to the character's left, positive pitch down; the head keeps its turn through the file."""
    motion = gesturing(3)
    q = motion.rotations.copy()
    index = humanoid().index
    q[:, index["neck"]] = axis_angle_to_quat((0, 1, 0), 0.2)  # left is +X, forward is +Z: a left turn is positive about Y
    q[:, index["head"]] = axis_angle_to_quat((0, 1, 0), 0.1)
    q[:, index["leftEye"]] = axis_angle_to_quat((1, 0, 0), 0.15)  # +Z turns to −Y: down
    path = tmp_path / "a.csv"
    save(Motion(fps=30, rotations=q, root=motion.root, face=motion.face), path)
    row = dict(zip(COLUMNS, path.read_text().splitlines()[1].split(","), strict=True))
    assert float(row["HeadYaw"]) == pytest.approx(0.3, abs=1e-6)
    assert float(row["LeftEyePitch"]) == pytest.approx(0.15, abs=1e-6)
    assert float(row["HeadPitch"]) == float(row["RightEyeYaw"]) == 0
    back = load(path)
    for name in ("leftEye", "rightEye"):
        assert quat_angle(back.rotations[:, index[name]], q[:, index[name]]).max() < 1e-5
    assert (
        quat_angle(
            back.skeleton.forward(back.rotations, back.root)[1][:, index["head"]], axis_angle_to_quat((0, 1, 0), 0.3)
        ).max()
        < 1e-5
    )


def test_csv_of_the_app_with_gaps(tmp_path):
    """Sixty rows per second counted in thirtieths, one empty row, one lost row: an even 60 fps comes out."""
    rows = [APP_HEADER]
    for k in range(180):
        value = ",".join([f"{k / 180:.5f}"] * 52 + ["0.1"] * 9)
        clock = f"23:59:{59 if k < 60 else k // 60 - 1:02d}" if k < 60 else f"00:00:{k // 60 - 1:02d}"
        rows.append(f"{clock}:{k % 60 / 2:06.3f}," + ("0" if k == 70 else f"61,{value}"))
    del rows[100]
    path = tmp_path / "a.csv"
    path.write_text("\r\n".join(rows) + "\r\n\r\n")
    motion = load(path)
    assert (motion.fps, len(motion)) == (60, 180)
    np.testing.assert_allclose(motion.face[:, 0], np.arange(180) / 180, atol=1e-4)


def test_json_is_beats_layout(tmp_path):
    path = tmp_path / "a.json"
    motion = gesturing(4, fps=60)
    save(motion, path)
    data = json.loads(path.read_text())
    assert list(data) == ["names", "frames"]
    assert data["names"] == [*sorted(set(ARKIT) - {"tongueOut"}), "tongueOut"] == list(NAMES)
    assert [list(frame) for frame in data["frames"]] == [["weights", "time", "rotation"]] * 4
    assert [frame["time"] for frame in data["frames"]] == pytest.approx([0, 1 / 60, 2 / 60, 3 / 60], abs=1e-6)
    assert data["frames"][2]["weights"][NAMES.index("jawOpen")] == pytest.approx(
        motion.face[2, ARKIT_INDEX["jawOpen"]], abs=1e-5
    )


def test_json_reads_any_subset_in_any_order(tmp_path):
    path = tmp_path / "a.json"
    frames = [{"weights": [0.5, 0.25, 9], "time": k / 60, "rotation": []} for k in range(5)]
    path.write_text(json.dumps({"names": ["JawOpen", "eyeBlinkLeft", "unknown"], "frames": frames}))
    motion = load(path)
    assert (motion.fps, len(motion)) == (60, 5)
    assert motion.face[0, ARKIT_INDEX["jawOpen"]] == 0.5
    assert motion.face[0, ARKIT_INDEX["eyeBlinkLeft"]] == 0.25
    assert motion.face.sum() == pytest.approx(5 * 0.75)


@pytest.mark.parametrize("fps", [24, 29.97, 60.0])
def test_json_of_audio2face(tmp_path, fps):
    names, rows = ["EyeBlinkLeft", "JawOpen", "TongueUp"], [[0, k / 10, 1] for k in range(5)]
    data = {"exportFps": fps, "trackPath": "talk.wav", "numPoses": 3, "numFrames": 5, "facsNames": names, "weightMat": rows}
    (tmp_path / "a2f.json").write_text(json.dumps(data))
    motion = load(tmp_path / "a2f.json")
    assert (len(motion), motion.fps) == (5, pytest.approx(fps, rel=1e-5))
    np.testing.assert_allclose(motion.face[:, ARKIT_INDEX["jawOpen"]], np.arange(5) / 10, atol=1e-4)
    assert np.count_nonzero(motion.face) == 4


@pytest.mark.parametrize(
    ("suffix", "text", "problem"),
    [
        (".csv", "", "empty"),
        (".csv", "a,b,c\n", "Timecode"),
        (".csv", APP_HEADER + "\n", "no frames"),
        (".csv", APP_HEADER + "\n00:00:00:00.000,61,0.5\n", "columns"),
        (".csv", APP_HEADER + "\n00:00:00:00.000,61" + ",x" * 61 + "\n", "not a number"),
        (".csv", APP_HEADER + "\n00:00:00:00.000,61" + ",nan" * 61 + "\n", "not finite"),
        (".csv", APP_HEADER + "\nnoon,61" + ",0" * 61 + "\n", "timecode"),
        (".csv", APP_HEADER + "\n00:00:00:00,61" + ",0" * 61 + "\n99:00:00:00,61" + ",0" * 61 + "\n", "spread"),
        (".json", "[1, 2", "not JSON"),
        (".json", "[" * 100000, "nested|JSON"),
        (".json", '{"names": ["jawOpen"], "frames": []}', "no frames"),
        (".json", '{"names": ["jawOpen"], "frames": [{"weights": [NaN], "time": 0}]}', "NaN"),
        (".json", '{"names": ["jawOpen"], "frames": [{"weights": [1e999], "time": 0}]}', "finite"),
        (".json", '{"names": ["jawOpen"], "frames": [{"weights": [1, 2], "time": 0}]}', "2 weights for 1"),
        (".json", '{"names": ["jawOpen"], "frames": [{"weights": ["a"], "time": 0}]}', "cannot be read"),
        (".json", '{"names": ["a"], "frames": [{"weights": [1], "time": 0}]}', "none of ARKit"),
        (".json", '{"exportFps": "30", "facsNames": ["jawOpen"], "weightMat": [[1]]}', "exportFps 30"),
        (".json", '{"facsNames": ["jawOpen"], "weightMat": [[1]]}', "exportFps None"),
        (".json", '{"exportFps": 30, "facsNames": ["jawOpen"], "weightMat": [[1, 2]]}', "2 weights for 1"),
        (".json", '{"exportFps": 30, "facsNames": ["jawOpen"], "weightMat": [1]}', "cannot be read"),
        (".json", '{"exportFps": 30, "weightMat": [[1]]}', "no ARKit weights"),
    ],
)
def test_bad_faces(tmp_path, suffix, text, problem):
    path = tmp_path / f"a{suffix}"
    path.write_text(text)
    with pytest.raises(InputError, match=problem) as refusal:
        load(path)
    assert "\n" not in str(refusal.value)


def test_readers_do_not_hang_on_pipes_and_folders(tmp_path):
    os.mkfifo(tmp_path / "a.csv")
    (tmp_path / "b.json").mkdir()
    for name in ("a.csv", "b.json", "missing.npz"):
        with pytest.raises(InputError):
            load(tmp_path / name)
