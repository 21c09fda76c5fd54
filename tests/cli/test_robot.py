"""`cospeech robot`: trajectories of known robots and of a URDF, and what cannot be made."""

from __future__ import annotations

import json

import pytest

from cospeech.cli.demo import EXAMPLE
from cospeech.export import save
from tests.support.motions import gesturing

URDF = """<robot name="r">
  <joint name="arm" type="revolute"><limit lower="-1" upper="1" velocity="2"/></joint>
  <joint name="pan" type="revolute"><limit lower="-0.5" upper="0.5" velocity="2"/></joint>
</robot>"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    save(gesturing(30), "talk.bvh")
    (tmp_path / "mine.urdf").write_text(URDF)
    (tmp_path / "map.toml").write_text('[joints]\narm = "-left_shoulder_roll+0.1"\npan = "head_yaw"\n')
    (tmp_path / "bad.toml").write_text("[joints]\narm = 3\n")
    return tmp_path


def test_a_known_robot_and_a_urdf(cli, place):
    code, out, _ = cli("robot", "talk.bvh", "talk.csv", "--robot", "pepper", "--fps", 100)
    assert code == 0
    count = int(out.split()[1])
    assert f"{count} commands for 14 joints" in out
    assert 100 <= count <= 113  # an eighth of a second to stop in
    assert len((place / "talk.csv").read_text().splitlines()) == count + 1
    assert cli("robot", "talk.bvh", "talk.json", "--robot", "mine.urdf", "--map", "map.toml", "-q")[:2] == (0, "")
    message = json.loads((place / "talk.json").read_text())
    assert message["joint_names"] == ["arm", "pan"]
    assert all(abs(point["positions"][0]) <= 1 for point in message["points"])


def test_speech_moves_a_robot_as_the_motion_that_is_generated_of_it(cli, place):
    chosen = ("--style", "lively", "--seed", "3", "--intensity", "0.8")
    assert cli("robot", EXAMPLE, "talk.csv", *chosen, "-q")[0] == 0
    assert cli("generate", EXAMPLE, "-o", "talk.npz", "--fps", "50", *chosen, "-q")[0] == 0
    assert cli("robot", "talk.npz", "other.csv", "-q")[0] == 0
    assert (place / "talk.csv").read_bytes() == (place / "other.csv").read_bytes()
    code, _, err = cli("robot", "talk.npz", "third.csv", "--style", "lively")
    assert code == 2
    assert "--style changes nothing for 'talk.npz'" in err


def test_joints_of_a_urdf_that_are_not_recognised_are_told(cli, place):
    (place / "half.urdf").write_text(URDF.replace('"pan"', '"HeadYaw"'))
    code, out, err = cli("robot", "talk.bvh", "talk.csv", "--robot", "half.urdf")
    assert code == 0
    assert "for 1 joint at" in out
    assert "not moved: arm (--map" in err


def test_joints_that_get_no_movement_are_told(cli, place):
    save(gesturing(30), "face.json")
    code, _, err = cli("robot", "face.json", "talk.csv")
    assert code == 0
    assert "without movement in face.json: HeadYaw, HeadPitch, LShoulderPitch" in err


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["talk.csv", "--robot", "noa"], "no robot is called 'noa'"),
        (["talk.txt"], "a trajectory as .txt"),
        (["talk.csv", "--robot", "mine.urdf"], "is recognised"),
        (["talk.csv", "--robot", "mine.urdf", "--map", "bad.toml"], "no table [joints]"),
        (["talk.csv", "--robot", "nao", "--map", "map.toml"], "--map changes nothing"),
        (["talk.csv", "--robot", "nowhere.urdf"], "nowhere.urdf"),
        (["talk.csv", "--robot", "mine.urdf.xacro"], "xacro mine.urdf.xacro > mine.urdf"),
        (["talk.csv", "--robot", "mine.xml"], "mine.xml"),
        (["talk.csv", "--fps", "0"], "fps 0"),
    ],
)
def test_what_cannot_be_made_leaves_nothing(cli, place, arguments, what):
    code, out, err = cli("robot", "talk.bvh", *arguments)
    assert (code, out) == (2, "")
    assert what in err
    assert not (place / arguments[0]).exists()
