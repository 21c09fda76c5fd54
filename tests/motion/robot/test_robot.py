"""Robots: arms point where the person's do, by forward kinematics of the robots; limits hold; pieces equal the whole."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cospeech.errors import InputError
from cospeech.motion.motion import Motion
from cospeech.motion.robot import (
    CHANNELS,
    ROBOTS,
    BodyAngles,
    JointLimiter,
    RobotJoint,
    RobotStream,
    find_robot,
    list_followers,
    list_joints,
    narrow_joints,
    read_urdf,
    robot_trajectory,
    save_trajectory,
)
from cospeech.motion.rotations import quat_identity, rotvec_to_quat
from cospeech.motion.skeleton import humanoid

FPS = 50.0
JOINT = humanoid().index


def still(frames: int) -> Motion:
    return Motion(FPS, quat_identity(frames, len(humanoid())), np.zeros((frames, 3)), None, humanoid())


def random_arms(frames: int, seed: int, size: float = 1.2) -> Motion:
    """Arms anywhere, elbows bent about their hinges, twisted forearms; smooth over time."""
    motion, random = still(frames), np.random.default_rng(seed)
    t = np.arange(frames)[:, None] / FPS
    for side in ("left", "right"):
        for name, scale in (("UpperArm", size), ("Shoulder", 0.15), ("Hand", 0.4)):
            phase, rate = random.uniform(0, 6.28, 3), random.uniform(0.5, 2, 3)
            turn = scale * np.sin(rate * t + phase)
            motion.rotations[:, JOINT[side + name]] = rotvec_to_quat(turn)
        bend = 0.9 + 0.8 * np.sin(t[:, 0] + random.uniform(0, 6))
        hinge = np.array([0.0, -1.0 if side == "left" else 1.0, 0.0])
        motion.rotations[:, JOINT[side + "LowerArm"]] = rotvec_to_quat(bend[:, None] * hinge)
    return motion


def turn(axis: str, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    if axis == "x":
        return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    if axis == "y":
        return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def nao_arm(c: dict[str, float], side: str) -> tuple[np.ndarray, np.ndarray]:
    """Directions of upper arm and forearm: NAO's arms lie along x, and turn about y, z, x, z."""
    letter = side[0].upper()
    upper = turn("y", c[f"{letter}ShoulderPitch"]) @ turn("z", c[f"{letter}ShoulderRoll"])
    fore = upper @ turn("x", c[f"{letter}ElbowYaw"]) @ turn("z", c[f"{letter}ElbowRoll"])
    return upper[:, 0], fore[:, 0]


def reachy_arm(c: dict[str, float], side: str) -> tuple[np.ndarray, np.ndarray]:
    """Reachy's arms hang along −z, and turn about y, x, z, y."""
    letter = side[0]
    upper = turn("y", c[f"{letter}_shoulder_pitch"]) @ turn("x", c[f"{letter}_shoulder_roll"])
    fore = upper @ turn("z", c[f"{letter}_arm_yaw"]) @ turn("y", c[f"{letter}_elbow_pitch"])
    return -upper[:, 2], -fore[:, 2]


def directions(motion: Motion, side: str) -> tuple[np.ndarray, np.ndarray]:
    """Of the person's upper arm and forearm, in ROS' axes, relative to the chest (which does not move here)."""
    at = motion.positions()
    shoulder, elbow, wrist = (at[:, JOINT[side + name]] for name in ("UpperArm", "LowerArm", "Hand"))
    ros = [v[:, [2, 0, 1]] / np.linalg.norm(v, axis=1, keepdims=True) for v in (elbow - shoulder, wrist - elbow)]
    return ros[0], ros[1]


@pytest.mark.parametrize(("robot", "arm"), [("nao", nao_arm), ("reachy", reachy_arm)])
@pytest.mark.parametrize("seed", range(4))
def test_a_robots_arms_point_where_the_persons_do(robot, arm, seed):
    motion = random_arms(150, seed, size=0.9)
    angles = BodyAngles().push(motion)
    away = []
    for side in ("left", "right"):
        upper, fore = directions(motion, side)
        commands = {j.name: j.sign * angles[j.channel] + j.offset for j in find_robot(robot)}
        free = np.cos(angles[f"{side}_shoulder_roll"]) > 0.36
        for k in np.flatnonzero(free):
            bones = arm({name: values[k] for name, values in commands.items()}, side)
            away.append(max(np.linalg.norm(bones[0] - upper[k]), np.linalg.norm(bones[1] - fore[k])))
    assert np.median(away) < 1e-5  # before pitch has caught up after the side, the arm may be off
    assert np.mean(np.array(away) < 0.05) > 0.85


def test_poses_that_a_robot_builder_knows():
    motion = still(3)
    for side, sign in (("left", 1), ("right", -1)):
        arm = JOINT[side + "UpperArm"]
        motion.rotations[0, arm] = rotvec_to_quat(np.array([0.0, -sign * np.pi / 2, 0.0]))  # forward
        motion.rotations[1, arm] = rotvec_to_quat(np.array([0.0, 0.0, -sign * np.pi / 2]))  # hanging
    angles = BodyAngles().push(motion)
    for side in ("left", "right"):
        assert angles[f"{side}_shoulder_pitch"][:2] == pytest.approx([0, np.pi / 2], abs=1e-6)
        assert angles[f"{side}_shoulder_roll"][:2] == pytest.approx([0, 0], abs=1e-6)
        assert angles[f"{side}_elbow"] == pytest.approx(np.zeros(3), abs=1e-6)
        assert angles[f"{side}_hand"] == pytest.approx(np.ones(3))
    assert angles["left_shoulder_roll"][2] == pytest.approx(np.pi / 2)  # the T-pose
    assert angles["right_shoulder_roll"][2] == pytest.approx(-np.pi / 2)


def test_nod_and_turn_have_the_signs_of_ros():
    motion = still(2)
    motion.rotations[0, JOINT["head"]] = rotvec_to_quat(np.array([0.3, 0.0, 0.0]))  # looks down
    motion.rotations[1, JOINT["head"]] = rotvec_to_quat(np.array([0.0, 0.4, 0.0]))  # looks to the left
    motion.rotations[1, JOINT["chest"]] = rotvec_to_quat(np.array([0.2, 0.0, 0.0]))  # leans forward
    angles = BodyAngles().push(motion)
    assert angles["head_pitch"][0] == pytest.approx(0.3)
    assert angles["head_yaw"][1] == pytest.approx(0.4)
    assert angles["torso_pitch"] == pytest.approx([0, 0.2])


def test_an_arm_that_passes_the_side_spins_no_joint():
    """Through the line where pitch and yaw are one: the arm goes from the front, straight out to the side, to the back."""
    motion = still(120)
    u = np.linspace(-0.9, 0.9, 120)
    for side, sign in (("left", 1), ("right", -1)):
        lift = rotvec_to_quat(np.stack([0 * u, sign * u, np.full(120, sign * 0.02)], 1))
        motion.rotations[:, JOINT[side + "UpperArm"]] = lift
    angles = BodyAngles().push(motion)
    for channel in CHANNELS[:12]:
        assert np.abs(np.diff(angles[channel])).max() < np.radians(14), channel


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("sizes", [[1] * 60, [7, 13, 40], [60]])
def test_pieces_give_the_commands_of_the_whole(robot, sizes):
    motion = random_arms(60, 3)
    whole, stream, first, parts = robot_trajectory(motion, ROBOTS[robot]), RobotStream(ROBOTS[robot], fps=FPS), 0, []
    for size in sizes:
        parts.append(stream.push(motion[first : first + size]))
        first += size
    np.testing.assert_array_equal(np.concatenate([*parts, stream.finish()]), whole)
    assert 60 < len(whole) <= 60 + np.ceil(FPS / 8)
    for call in (stream.finish, lambda: stream.push(motion)):
        with pytest.raises(InputError, match="is finished"):
            call()


def test_a_robot_goes_from_where_it_is_to_the_motion():
    joints, motion = find_robot("nao"), random_arms(200, 4)
    beyond = next(joint.upper for joint in joints if joint.name == "LElbowRoll") + 0.03  # as a sensor may say
    here = {"HeadYaw": 1.0, "LShoulderPitch": -1.5, "LElbowRoll": beyond}
    commands = RobotStream(joints, fps=FPS, start=here).push(motion)
    usual = RobotStream(joints, fps=FPS).push(motion)
    names = [joint.name for joint in joints]
    assert commands[0, names.index("HeadYaw")] == 1
    assert commands[0, names.index("LShoulderPitch")] == -1.5
    assert commands[0, names.index("LElbowRoll")] == joints[names.index("LElbowRoll")].upper
    others = [k for k, name in enumerate(names) if name not in here]
    np.testing.assert_array_equal(commands[:, others], usual[:, others])
    np.testing.assert_allclose(commands[-50:], usual[-50:], atol=1e-6)
    with pytest.raises(InputError, match="a start of joint 'Head'"):
        RobotStream(joints, fps=FPS, start={"Head": 0.0})
    for wrong in ("a", None, float("nan"), 23.0):  # the last: degrees
        with pytest.raises(InputError, match="start of joint 'HeadYaw'"):
            RobotStream(joints, fps=FPS, start={"HeadYaw": wrong})


@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(ROBOTS)), st.sampled_from([20.0, 50.0, 125.0]), st.floats(0.1, 3.0))
def test_limits_of_position_speed_and_acceleration_hold_whatever_is_wanted(seed, robot, fps, scale):
    joints, random = ROBOTS[robot], np.random.default_rng(seed)
    lower, upper, velocity, push = (
        np.array([getattr(j, n) for j in joints]) for n in ("lower", "upper", "velocity", "acceleration")
    )
    goals = np.repeat(random.normal(0, scale, (12, len(joints))), random.integers(1, 9), axis=0)
    limiter = JointLimiter(lower, upper, velocity, push, fps=fps, start=random.normal(0, 2, len(joints)))
    commands = np.concatenate([limiter.push(goals), limiter.finish()])
    commands = np.concatenate([commands[:1], commands, commands[-1:]])  # at rest before and after
    assert ((commands >= lower) & (commands <= upper)).all()
    speed = np.diff(commands, axis=0) * fps
    assert (np.abs(speed) <= velocity * (1 + 1e-9)).all()
    assert (np.abs(np.diff(speed, axis=0)) <= push / fps * (1 + 1e-6) + 1e-9).all()


def test_a_goal_is_reached_without_overshoot():
    limiter = JointLimiter(np.array([-2.0]), np.array([2.0]), np.array([3.0]), np.array([24.0]), fps=FPS)
    angles = limiter.push(np.concatenate([[[0.0]], np.full((100, 1), 1.0)]))[:, 0]
    assert angles.max() <= 1 + 1e-6
    assert angles[-1] == pytest.approx(1, abs=1e-3)
    assert np.argmax(angles > 0.95) < 30  # 0.6 s: as fast as the limits allow, nearly


@pytest.mark.parametrize("change", [{"lower": [2.0]}, {"velocity": [0.0]}, {"acceleration": [-1.0]}])
def test_limits_that_nothing_can_keep(change):
    usual = {"lower": [-1.0], "upper": [1.0], "velocity": [1.0], "acceleration": [1.0]} | change
    with pytest.raises(InputError, match="limits of joints"):
        JointLimiter(*(np.array(usual[name]) for name in ("lower", "upper", "velocity", "acceleration")), fps=50)


URDF = """<robot name="r">
  <joint name="LShoulderPitch" type="revolute"><limit lower="-1" upper="1" velocity="2"/></joint>
  <joint name="arm" type="continuous"><limit velocity="1.5"/></joint>
  <joint name="base" type="fixed"/>
  <joint name="broken" type="revolute"/>
</robot>"""


@pytest.fixture
def urdf(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_text(URDF)
    return path


def test_joints_of_a_urdf(urdf):
    (shoulder,) = read_urdf(urdf)
    assert (shoulder.name, shoulder.channel, shoulder.lower, shoulder.upper, shoulder.velocity) == (
        "LShoulderPitch",
        "left_shoulder_pitch",
        -1,
        1,
        2,
    )
    _, arm = read_urdf(urdf, {"arm": "-left_elbow+0.5"})
    assert (arm.channel, arm.sign, arm.offset, arm.velocity) == ("left_elbow", -1, 0.5, 1.5)
    assert arm.upper == pytest.approx(2 * np.pi)


def test_limits_are_given_where_a_urdf_says_none(tmp_path):
    inner = '<joint name="arm" type="revolute"/><joint name="pan" type="continuous"/><joint name="tilt" type="revolute">'
    inner += '<limit lower="-1" upper="1" effort="0" velocity="0"/></joint>'  # as exporters write it that do not know
    (tmp_path / "r.urdf").write_text(f"<robot>{inner}</robot>")
    channels = {"arm": "left_elbow", "pan": "head_yaw", "tilt": "head_pitch"}
    given = {"arm": {"lower": -1.5, "upper": 0, "velocity": 3}, "pan": {"velocity": 2}, "tilt": {"velocity": 1, "lower": -9}}
    arm, pan, tilt = read_urdf(tmp_path / "r.urdf", channels, given)
    assert (arm.lower, arm.upper, arm.velocity) == (-1.5, 0, 3)
    assert (pan.upper, pan.velocity) == (pytest.approx(2 * np.pi), 2)
    assert (tilt.lower, tilt.upper, tilt.velocity) == (-1, 1, 1)  # what the URDF says counts
    with pytest.raises(InputError, match=r"'tilt' has no limits: velocity is 0 .*\[limits.\"tilt\"\] and velocity = …"):
        read_urdf(tmp_path / "r.urdf", {"tilt": "head_pitch"})
    with pytest.raises(InputError, match="'arm' has no limits: upper is missing"):
        read_urdf(tmp_path / "r.urdf", {"arm": "left_elbow"}, {"arm": {"lower": -1.5}})
    with pytest.raises(InputError, match="'pan' has velocity = '2'"):
        read_urdf(tmp_path / "r.urdf", channels, given | {"pan": {"velocity": "2"}})


def test_blanks_in_a_map_say_nothing(urdf):
    for what in ("-left_elbow-0.5", " - left_elbow - 0.5 ", "-left_elbow -5e-1"):
        _, arm = read_urdf(urdf, {"arm": what})
        assert (arm.channel, arm.sign, arm.offset) == ("left_elbow", -1, -0.5)


def test_a_urdf_may_have_a_namespace(tmp_path):
    inner = '<axis xyz="0 0 -1"/><limit lower="-1" upper="1" velocity="2"/><safety_controller soft_upper_limit="0.5"/>'
    inner = (
        f'<joint name="HeadYaw" type="revolute">{inner}</joint><joint name="b" type="revolute"><mimic joint="HeadYaw"/></joint>'
    )
    (tmp_path / "r.urdf").write_text(f'<robot xmlns="http://www.ros.org">{inner}</robot>')
    (head,) = read_urdf(tmp_path / "r.urdf")
    assert (head.name, head.sign, head.lower, head.upper) == ("HeadYaw", -1, -1, 0.5)
    assert list_followers(tmp_path / "r.urdf") == {"b": "HeadYaw"}


def test_soft_limits_that_are_narrower_hold(tmp_path):
    def limits(soft: str, kind: str = "revolute") -> tuple[float, float]:
        inner = f'<limit lower="-1" upper="1" velocity="2"/><safety_controller k_velocity="1" {soft}/>'
        (tmp_path / "r.urdf").write_text(f'<robot><joint name="HeadYaw" type="{kind}">{inner}</joint></robot>')
        (joint,) = read_urdf(tmp_path / "r.urdf")
        return joint.lower, joint.upper

    assert limits('soft_lower_limit="-0.4" soft_upper_limit="0.3"') == (-0.4, 0.3)
    assert limits('soft_lower_limit="-4" soft_upper_limit="0.5"') == (-1, 0.5)
    assert limits("") == (-1, 1)
    assert limits('soft_lower_limit="-0.5"', "continuous")[0] == -0.5
    with pytest.raises(InputError, match="the URDF says soft_upper_limit='x' of joint 'HeadYaw'"):
        limits('soft_upper_limit="x"')
    limits('soft_lower_limit="-0.2" soft_upper_limit="0.1"')
    motion = still(100)
    motion.rotations[:, JOINT["head"]] = rotvec_to_quat(np.array([0, 0.9, 0]))
    assert robot_trajectory(motion, read_urdf(tmp_path / "r.urdf")).max() <= 0.1


def test_a_map_adds_to_the_names_and_takes_joints_out(urdf):
    assert [joint.name for joint in read_urdf(urdf, {"arm": "left_elbow"})] == ["LShoulderPitch", "arm"]
    assert [joint.name for joint in read_urdf(urdf, {"arm": "left_elbow", "LShoulderPitch": ""})] == ["arm"]
    assert read_urdf(urdf, {"LShoulderPitch": "-left_shoulder_pitch"})[0].sign == -1


def test_a_joint_whose_axis_points_the_other_way_takes_the_other_sign(tmp_path):
    ends = '<limit lower="-2" upper="2" velocity="9"/></joint>'
    for axis, sign in (("0 0 1", 1), ("0 0 -1.0", -1), ("0.7 0 -0.7", 1), (None, 1)):
        inner = "" if axis is None else f'<axis xyz="{axis}"/>'
        three = [f'<joint name="{name}" type="revolute">{inner}{ends}' for name in ("HeadYaw", "l_shoulder_pitch", "LHand")]
        three[1] = three[1].replace("0 0", "0").replace('1"', '1 0"').replace('1.0"', '1.0 0"')  # it turns about y
        (tmp_path / "r.urdf").write_text(f"<robot>{''.join(three)}</robot>")
        head, shoulder, hand = read_urdf(tmp_path / "r.urdf")
        assert (head.sign, head.offset) == (sign, 0)
        assert (shoulder.sign, shoulder.offset) == (sign, pytest.approx(-sign * np.pi / 2, abs=1e-6))
        assert hand.sign == 1  # 0 … 1 has no direction
    rest, with_turn = still(3), still(3)
    with_turn.rotations[:, JOINT["head"]] = rotvec_to_quat(np.array([0, 0.3, 0]))
    (tmp_path / "r.urdf").write_text(f'<robot><joint name="HeadYaw" type="revolute"><axis xyz="0 0 -1"/>{ends}</robot>')
    joints = read_urdf(tmp_path / "r.urdf")
    assert robot_trajectory(rest, joints)[0, 0] == pytest.approx(0)
    assert robot_trajectory(with_turn, joints)[0, 0] == pytest.approx(-0.3)


@pytest.mark.parametrize(
    ("channels", "what"),
    [
        ({"leg": "left_elbow"}, "has no joint 'leg' that moves"),
        ({"arm": "left_knee"}, "takes 'left_knee'"),
        ({"arm": "left_elbow+x"}, "takes 'left_elbow.x'"),
        ({"arm": "--left_elbow"}, "takes '--left_elbow'"),
        ({"broken": "left_elbow"}, "has no limits"),
        ({"LShoulderPitch": ""}, "is recognised"),
    ],
)
def test_what_a_urdf_cannot_give(urdf, channels, what):
    with pytest.raises(InputError, match=what):
        read_urdf(urdf, channels)


GRIPPERS = """<robot name="r">
  <joint name="slide" type="prismatic"><limit lower="0" upper="0.04" velocity="0.1"/></joint>
  <joint name="claw" type="revolute"><limit lower="0" upper="0.8" velocity="2"/></joint>
  <joint name="wheel" type="continuous"><limit velocity="2"/></joint>
  <joint name="arm" type="revolute"><limit lower="-1" upper="${pi}" velocity="2"/></joint>
</robot>"""


def opening(frames: int) -> Motion:
    """The left hand opens from a fist (70° at the knuckles) to a flat hand."""
    motion = still(frames)
    bend = np.radians(np.linspace(75, 0, frames))[:, None] * np.array([0.0, 0, -1])
    for finger in ("Index", "Middle", "Ring", "Little"):
        motion.rotations[:, JOINT[f"left{finger}Proximal"]] = rotvec_to_quat(bend)
    return motion


def test_a_gripper_closes_at_one_limit_and_opens_at_the_other(tmp_path):
    (tmp_path / "r.urdf").write_text(GRIPPERS)
    assert list_joints(tmp_path / "r.urdf") == ("slide", "claw", "wheel", "arm")
    for what, ends in (("left_hand", (0, 1)), ("-left_hand", (1, 0))):
        joints = read_urdf(tmp_path / "r.urdf", {"slide": what, "claw": what})
        commands = robot_trajectory(opening(200), joints)
        for column, upper in zip(commands.T, (0.04, 0.8), strict=True):
            assert column[[0, -1]] == pytest.approx(upper * np.array(ends), abs=0.003 * upper)  # an open hand, nearly at rest
    nao = narrow_joints(find_robot("nao"), {"LHand": {"lower": 0.2}})
    hand = robot_trajectory(opening(200), nao)[:, [joint.name for joint in nao].index("LHand")]
    assert hand[[0, -1]] == pytest.approx([0.2, 1], abs=1e-3)


def test_a_joint_that_mimics_another_gets_no_commands(tmp_path):
    ends = '<limit lower="0" upper="1" velocity="2"/></joint>'
    follower = f'<joint name="RHand" type="prismatic"><mimic joint="LHand" multiplier="-1" offset="0.1"/>{ends}'
    (tmp_path / "r.urdf").write_text(f'<robot><joint name="LHand" type="revolute">{ends}{follower}</robot>')
    assert [joint.name for joint in read_urdf(tmp_path / "r.urdf")] == ["LHand"]
    assert list_joints(tmp_path / "r.urdf") == ("LHand",)
    assert list_followers(tmp_path / "r.urdf") == {"RHand": "LHand"}
    with pytest.raises(InputError, match=r"joint 'RHand' of .* follows 'LHand' and takes nothing"):
        read_urdf(tmp_path / "r.urdf", {"RHand": "right_hand"})
    (tmp_path / "r.urdf").write_text("<robot>" + follower.replace('joint="LHand"', "") + "</robot>")
    with pytest.raises(InputError, match="mimics a joint that has no name"):
        list_joints(tmp_path / "r.urdf")


@pytest.mark.parametrize(
    ("channels", "what"),
    [
        ({"slide": "left_elbow"}, r"joint 'slide' slides and cannot take 'left_elbow' \(a prismatic joint takes left_hand"),
        ({"slide": "left_hand+0.01"}, "hand with an offset"),
        ({"wheel": "left_hand"}, "turns without end"),
        ({"arm": "left_elbow"}, r"the URDF says upper='\$\{pi\}' of joint 'arm' \(a number; xacro"),
        ({"claw": "left_elbow+nan"}, "offset nan"),
    ],
)
def test_what_a_gripper_or_its_urdf_cannot_give(tmp_path, channels, what):
    (tmp_path / "r.urdf").write_text(GRIPPERS)
    with pytest.raises(InputError, match=what):
        read_urdf(tmp_path / "r.urdf", channels)


def test_limits_of_a_joint_become_narrower_and_hold():
    assert RobotJoint("a", "left_elbow", -1, 1, 2.0).acceleration == 16
    assert RobotJoint("a", "left_elbow", -1, 1, 2.0, acceleration=3.0).acceleration == 3
    limits = {"LShoulderPitch": {"velocity": 1.5, "acceleration": 6.0, "lower": -0.5, "upper": 1.0}, "HeadYaw": {"velocity": 2}}
    joints = narrow_joints(find_robot("nao"), limits)
    names = [joint.name for joint in joints]
    assert joints[names.index("HeadYaw")].acceleration == pytest.approx(16)  # an eighth of a second still
    commands = robot_trajectory(random_arms(200, 4), joints)[:, names.index("LShoulderPitch")]
    speed = np.diff(commands, prepend=commands[0], append=commands[-1]) * FPS
    assert commands.min() >= -0.5
    assert commands.max() <= 1
    assert 1.4 < np.abs(speed).max() <= 1.5 + 1e-9
    assert np.abs(np.diff(speed)).max() * FPS <= 6 * (1 + 1e-6)


@pytest.mark.parametrize(
    ("limits", "what"),
    [
        ({"Head": {"velocity": 1.0}}, "'Head', which is not moved .did you mean 'HeadYaw'"),
        ({"HeadYaw": {"speed": 1.0}}, "has a limit 'speed'"),
        ({"HeadYaw": {"velocity": "1"}}, "a number"),
        ({"HeadYaw": {"velocity": True}}, "a number"),
        ({"HeadYaw": {"velocity": 90.0}}, "may only be narrowed"),
        ({"HeadYaw": {"upper": 3.0}}, "may only be narrowed"),
        ({"HeadYaw": {"lower": -3.0}}, "may only be narrowed"),
        ({"HeadYaw": {"acceleration": 0.0}}, "above 0"),
        ({"HeadYaw": {"lower": 1.0, "upper": 0.5}}, "lower ≤ upper"),
    ],
)
def test_limits_that_a_robot_cannot_take(limits, what):
    with pytest.raises(InputError, match=what):
        narrow_joints(find_robot("nao"), limits)


def test_joints_that_stay_at_a_limit_are_known(urdf):
    joints = read_urdf(urdf, {"LShoulderPitch": "left_shoulder_pitch-90", "arm": "left_elbow"})  # degrees
    stream = RobotStream(joints, fps=FPS)
    assert stream.outside == ()
    commands = stream.push(random_arms(50, 1))
    assert stream.outside == ("LShoulderPitch",)
    assert (np.abs(commands[:, 0]) == 1).all()


TWICE = '<joint name="HeadYaw" type="revolute"><limit lower="-1" upper="1" velocity="2"/></joint>' * 2
AXIS = '<joint name="HeadYaw" type="revolute"><axis xyz="up"/><limit lower="-1" upper="1" velocity="2"/></joint>'


@pytest.mark.parametrize(
    "text",
    [
        "", "<robot>", "<!DOCTYPE x [<!ENTITY a 'b'>]><robot>&a;</robot>", "<robot/>", "\0", f"<robot>{TWICE}</robot>",
        f"<robot>{AXIS}</robot>",
    ],
)  # fmt: skip
def test_files_that_are_no_urdf(tmp_path, text):
    (tmp_path / "bad.urdf").write_text(text)
    with pytest.raises(InputError):
        read_urdf(tmp_path / "bad.urdf")


def test_files_of_commands(tmp_path):
    joints, motion = find_robot("nao"), random_arms(20, 1)
    commands = robot_trajectory(motion, joints)
    save_trajectory(tmp_path / "talk.csv", commands, joints, fps=FPS)
    save_trajectory(tmp_path / "talk.json", commands, joints, fps=FPS)
    header, *rows = (tmp_path / "talk.csv").read_text().splitlines()
    assert header.split(",") == ["time", *(joint.name for joint in joints)]
    read = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    np.testing.assert_allclose(read[:, 0], np.arange(len(commands)) / FPS)
    np.testing.assert_allclose(read[:, 1:], commands, atol=1e-6)
    message = json.loads((tmp_path / "talk.json").read_text())
    assert message["joint_names"] == header.split(",")[1:]
    np.testing.assert_allclose([p["positions"] for p in message["points"]], commands, atol=1e-6)
    at = [p["time_from_start"]["sec"] + p["time_from_start"]["nanosec"] / 1e9 for p in message["points"]]
    np.testing.assert_allclose(at, np.arange(len(commands)) / FPS)
    speeds = np.array([p["velocities"] for p in message["points"]])
    assert not speeds[[0, -1]].any()  # at rest, as controllers of ROS want it
    np.testing.assert_allclose(speeds[1:-1], (commands[2:] - commands[:-2]) * FPS / 2, atol=1e-5)
    with pytest.raises(InputError, match=r"known: \.csv \.json"):
        save_trajectory(tmp_path / "talk.txt", commands, joints, fps=FPS)
    with pytest.raises(InputError, match="no robot is called 'noa'"):
        find_robot("noa")
    for wrong in ("nao", (), ["HeadYaw"]):
        with pytest.raises(InputError, match=r"find_robot\('nao'\)"):
            RobotStream(wrong, fps=FPS)
    with pytest.raises(InputError, match="for a robot of 25"):
        RobotStream(joints, fps=25).push(motion)
