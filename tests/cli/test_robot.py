"""`cospeech robot`: trajectories of known robots and of a URDF, and what cannot be made."""

from __future__ import annotations

import json

import numpy as np
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
    (tmp_path / "odd.toml").write_text("[limit.HeadYaw]\nvelocity = 1\n")
    (tmp_path / "empty.toml").write_text("# nothing\n")
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
    options = ("--style", "lively", "--seed", "3", "--intensity", "0.8")
    assert cli("robot", EXAMPLE, "talk.csv", *options, "--rest", "0", "-q")[0] == 0
    assert cli("generate", EXAMPLE, "-o", "talk.npz", "--fps", "50", *options, "-q")[0] == 0
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


def test_joints_that_follow_another_are_told(cli, place):
    ends = '<limit lower="0" upper="0.8" velocity="2"/></joint>'
    inner = f'<joint name="gripper" type="revolute">{ends}'
    for finger in ("finger_1", "finger_2"):
        inner += f'<joint name="{finger}" type="revolute"><mimic joint="gripper" multiplier="-1"/>{ends}'
    (place / "claw.urdf").write_text(f"<robot>{inner}</robot>")
    (place / "claw.toml").write_text('[joints]\ngripper = "left_hand"\n')
    code, out, err = cli("robot", "talk.bvh", "talk.csv", "--robot", "claw.urdf", "--map", "claw.toml")
    assert (code, err.splitlines()[0]) == (0, "follows gripper: finger_1, finger_2")
    assert "for 1 joint at" in out
    assert "not moved" not in err
    assert (place / "talk.csv").read_text().splitlines()[0] == "time,gripper"


def test_after_the_speech_the_arms_come_down(cli, place):
    import soundfile

    samples, rate = soundfile.read(EXAMPLE, dtype="float32")
    soundfile.write(place / "short.wav", samples[: 3 * rate], rate)  # it ends within a gesture

    def end_of(*options):
        code, out, _ = cli("robot", "short.wav", "talk.csv", *options)
        assert code == 0
        rows = np.genfromtxt(place / "talk.csv", delimiter=",", names=True)
        return int(out.split()[1]), rows

    count, without_rest = end_of("--rest", "0")
    assert 150 <= count <= 156
    count, with_rest = end_of()
    assert 225 <= count <= 231  # 3 s, 1.5 s, and a moment to brake
    first = [name for name in without_rest.dtype.names]
    np.testing.assert_array_equal(*(np.stack([rows[name][:150] for name in first]) for rows in (without_rest, with_rest)))
    bends = {name: (abs(without_rest[name][-1]), abs(with_rest[name][-1])) for name in ("LElbowRoll", "RElbowRoll")}
    assert max(before for before, _ in bends.values()) > 1.2
    assert max(after for _, after in bends.values()) < 1.0
    _, longer = end_of("--rest", "3")
    assert 300 <= len(longer) <= 306
    assert cli("robot", "talk.bvh", "moved.csv", "--fps", 30, "--rest", "1")[1].split()[1] >= "60"


def test_a_map_limits_any_robot(cli, place):
    (place / "limits.toml").write_text("[limits.RElbowRoll]\nvelocity = 0.5\nacceleration = 2.0\nupper = 1\n")
    assert cli("robot", "talk.bvh", "talk.csv", "--map", "limits.toml", "-q")[0] == 0
    rows = np.genfromtxt(place / "talk.csv", delimiter=",", names=True)
    speed = np.diff(rows["RElbowRoll"]) * 50
    assert 0.3 < np.abs(speed).max() <= 0.5 + 1e-3
    assert np.abs(np.diff(speed)).max() * 50 <= 2 + 0.01  # the file has six digits
    (place / "both.toml").write_text('[joints]\narm = "left_elbow"\npan = ""\n[limits.arm]\nupper = 0.0\n')
    code, _, err = cli("robot", "talk.bvh", "talk.csv", "--robot", "mine.urdf", "--map", "both.toml")
    assert (code, err) == (0, "")  # pan is left out on purpose


def test_a_map_gives_the_limits_that_a_urdf_does_not_say(cli, place):
    (place / "bare.urdf").write_text('<robot><joint name="left/arm" type="continuous"/></robot>')
    (place / "bare.toml").write_text('[joints]\n"left/arm" = "right_elbow - 0.1"\n')
    command = ("robot", "talk.bvh", "talk.csv", "--robot", "bare.urdf", "--map", "bare.toml")
    code, _, err = cli(*command)
    assert code == 2
    assert "joint 'left/arm' has no limits: velocity is missing" in err
    with (place / "bare.toml").open("a") as file:
        file.write('[limits."left/arm"]\nvelocity = 0.5\n')
    assert cli(*command)[0] == 0
    rows = np.loadtxt(place / "talk.csv", delimiter=",", skiprows=1)
    assert 0.3 < np.abs(np.diff(rows[:, 1])).max() * 50 <= 0.5 + 1e-3


def test_limits_in_degrees_are_told(cli, place):
    degrees = '<limit lower="-90" upper="90" velocity="2"/>', '<limit lower="-1" upper="1" velocity="180"/>'
    for limits in (*degrees, '<limit lower="-6.3" upper="6.3" velocity="25"/>'):
        (place / "wide.urdf").write_text(f'<robot><joint name="HeadYaw" type="revolute">{limits}</joint></robot>')
        code, _, err = cli("robot", "talk.bvh", "talk.csv", "--robot", "wide.urdf")
        assert code == 0
        assert ("limits that do not limit: HeadYaw (a URDF counts in radians" in err) == (limits in degrees)


def test_several_joints_of_more_than_a_turn_are_told_and_those_without_end_are_not(cli, place):
    for kind, has_note in (("continuous", False), ("revolute", True)):
        limit = '<limit lower="-4" upper="4" velocity="2"/></joint>'
        three = [f'<joint name="{name}" type="{kind}">{limit}' for name in ("HeadYaw", "HeadPitch", "LElbowYaw")]
        (place / "three.urdf").write_text(f"<robot>{''.join(three)}</robot>")
        code, _, err = cli("robot", "talk.bvh", "talk.csv", "--robot", "three.urdf", "-q")
        assert (code, "limits that do not limit: HeadYaw, HeadPitch, LElbowYaw" in err) == (0, has_note)


def test_angles_that_several_joints_take_are_told(cli, place):
    (place / "twice.toml").write_text('[joints]\narm = "left_elbow"\npan = "left_elbow"\n')
    code, _, err = cli("robot", "talk.bvh", "talk.csv", "--robot", "mine.urdf", "--map", "twice.toml", "-q")
    assert (code, "several joints take left_elbow: arm, pan" in err) == (0, True)


def test_a_map_names_the_joints_of_a_foreign_motion(cli, place):
    from cospeech.motion.skeleton import humanoid

    text = (place / "talk.bvh").read_text()
    bones = "[bones]\n"
    for number, name in enumerate(humanoid().names):
        if f" {name}\n" in text:
            text = text.replace(f" {name}\n", f" q{number}\n")
            bones += f'{name} = "q{number}"\n'
    (place / "foreign.bvh").write_text(text)
    (place / "bones.toml").write_text(bones + "[limits.HeadYaw]\nvelocity = 8\n")
    assert cli("robot", "talk.bvh", "talk.csv", "-q")[0] == 0
    assert cli("robot", "foreign.bvh", "other.csv", "--map", "bones.toml", "-q") == (0, "", "")
    tables = [np.genfromtxt(place / name, delimiter=",") for name in ("talk.csv", "other.csv")]
    np.testing.assert_allclose(tables[0][1:], tables[1][1:], atol=0.02)
    assert "is none of their joints" in cli("robot", "talk.bvh", "x.csv", "--map", "bones.toml")[2]
    assert "[bones] of --map changes nothing for" in cli("robot", EXAMPLE, "x.csv", "--map", "bones.toml")[2]
    (place / "bones.toml").write_text("[bones]\nhips = 3\n")
    assert "holds no table of names" in cli("robot", "talk.bvh", "x.csv", "--map", "bones.toml")[2]


def test_an_offset_in_degrees_is_told(cli, place):
    (place / "degrees.toml").write_text('[joints]\narm = "left_shoulder_pitch-90"\npan = ""\n')
    code, _, err = cli("robot", "talk.bvh", "talk.csv", "--robot", "mine.urdf", "--map", "degrees.toml")
    assert code == 0
    assert "offsets of more than a turn: arm (are they in radians?)\n" in err


def test_joints_that_get_no_movement_are_told(cli, place):
    save(gesturing(30), "face.json")
    code, _, err = cli("robot", "face.json", "talk.csv")
    assert code == 0
    assert "without movement in face.json: HeadYaw, HeadPitch, LShoulderPitch" in err


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["talk.csv", "--robot", "noa"], "no robot is called 'noa'"),
        (["talk.csv", "--robot", "talk.bvh"], "known: nao, pepper, reachy, or a .urdf file: my_robot.urdf"),
        (["talk.txt"], "a trajectory as .txt"),
        (["talk.csv", "--robot", "mine.urdf"], "is recognised"),
        (["talk.csv", "--robot", "mine.urdf", "--map", "bad.toml"], "[joints] that holds not only texts"),
        (["talk.csv", "--robot", "nao", "--map", "map.toml"], "[joints] of --map changes nothing for 'nao'"),
        (["talk.csv", "--map", "odd.toml"], "has a table [limit] (did you mean 'limits'?"),
        (["talk.csv", "--map", "empty.toml"], "has no table [joints] or [limits.JOINT]"),
        (["talk.csv", "--rest", "-1"], "rest -1"),
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
