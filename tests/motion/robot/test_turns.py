"""Whole turns of a robot's joints: no angle winds up, none jumps, and what was taken back leaves no trace."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cospeech.errors import InputError
from cospeech.motion.robot import BodyAngles, JointLimiter, RobotStream, find_robot, robot_trajectory, save_trajectory
from cospeech.motion.robot.turns import TurnChooser
from cospeech.motion.rotations import quat_multiply, rotvec_to_quat
from tests.motion.robot.test_robot import FPS, JOINT, random_arms, still

NAO = find_robot("nao")
WRIST = [joint.name for joint in NAO].index("LWristYaw")


def test_a_forearm_that_turns_and_turns_is_followed_where_it_can_be_reached():
    """Without whole turns it would stand at its limit from the first turn on."""
    motion, seconds = still(600), np.arange(600) / FPS
    spin = 2.0 * np.minimum(seconds, 6.5)  # radians: two turns, and then it stays at .43 of one
    motion.rotations[:, JOINT["leftHand"]] = rotvec_to_quat(spin[:, None] * [1.0, 0, 0])
    commands = robot_trajectory(motion, NAO)[:600, WRIST]
    goals = (spin + np.pi) % (2 * np.pi) - np.pi
    joint = NAO[WRIST]
    assert (np.abs(commands) <= joint.upper).all()
    remainder = np.abs((goals - commands + np.pi) % (2 * np.pi) - np.pi)
    assert remainder[-50:].max() < 0.01  # 13 radians are .43 more than two turns
    assert np.mean(remainder[np.abs(goals) < 1.5] < 0.05) > 0.75


@given(
    st.floats(-3, 3), st.floats(0.1, 9.0), st.lists(st.floats(-40, 40, width=32), min_size=1, max_size=40), st.integers(1, 39)
)
def test_other_turns_are_the_same_angles_within_the_limits_where_that_is_possible(lower, width, angles, cut):
    ends = np.array([lower]), np.array([lower + width])
    rows = np.array(angles, float)[:, None]
    choice = TurnChooser(*ends, np.array([True])).push(rows)
    turns = (choice - rows) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    possible = np.floor((ends[1] - rows) / (2 * np.pi)) >= np.ceil((ends[0] - rows) / (2 * np.pi))
    beside = np.maximum(np.maximum(ends[0] - choice, choice - ends[1]), 0)
    assert beside[possible].max(initial=0) <= 0.5 + 1e-9  # what keeps it from flickering
    assert beside.max() <= np.pi + 0.25  # half a turn, and half of that
    pieces = TurnChooser(*ends, np.array([True]))
    np.testing.assert_array_equal(np.concatenate([pieces.push(rows[:cut]), pieces.push(rows[cut:])]), choice)


def test_a_joint_stays_on_its_turn_while_it_can():
    chooser = TurnChooser(np.array([-2 * np.pi]), np.array([2 * np.pi]), np.array([True]))
    spin = np.arange(0, 12, 0.1)[:, None]
    choice = chooser.push((spin + np.pi) % (2 * np.pi) - np.pi)
    np.testing.assert_allclose(choice[:62], spin[:62], atol=1e-9)  # up to the limit
    assert choice.max() <= 2 * np.pi + 0.5  # what keeps it from flickering
    assert (np.abs(np.diff(choice[:, 0])) > 1).sum() == 1  # there it comes back, once
    hand = TurnChooser(np.array([0.0]), np.array([1.0]), np.array([False]))
    np.testing.assert_array_equal(hand.push(np.array([[9.0]])), [[9.0]])


def test_a_joint_with_a_range_of_a_turn_does_not_flicker_at_its_limit():
    seconds = np.arange(200) / FPS
    angles = np.pi + 0.03 * np.sin(2 * np.pi * seconds)[:, None]
    for end in (np.pi, 3.15, 3.2):
        choice = TurnChooser(np.array([-end]), np.array([end]), np.array([True])).push((angles + np.pi) % (2 * np.pi) - np.pi)
        assert np.ptp(choice) < 0.1


def test_a_pitch_that_goes_round_does_not_jump():
    motion, seconds = still(400), np.arange(400) / FPS
    aside = rotvec_to_quat(np.array([[0, 0, 1.2]]))  # the left arm, nearly straight up, circles
    round_about = rotvec_to_quat((4.0 * seconds)[:, None] * [1.0, 0, 0])
    motion.rotations[:, JOINT["leftUpperArm"]] = quat_multiply(round_about, np.repeat(aside, 400, 0))
    pitch = BodyAngles().push(motion)["left_shoulder_pitch"]
    assert np.abs(np.diff(pitch)).max() * FPS < 13  # as fast as it is turned, at most


def test_commands_that_are_taken_back_leave_no_jump():
    motion, other = random_arms(300, 1), random_arms(200, 2)
    robot = RobotStream(NAO, fps=FPS)
    start = robot.push(motion)[:120]
    robot.rewind(180)
    commands = np.concatenate([start, robot.push(other), robot.finish()])
    speeds = np.diff(commands, axis=0) * FPS
    assert (np.abs(speeds) <= np.array([joint.velocity for joint in NAO]) + 1e-9).all()
    pushes = np.diff(speeds, axis=0) * FPS
    assert (np.abs(pushes) <= np.array([joint.acceleration for joint in NAO]) + 1e-6).all()


def test_all_commands_may_be_taken_back_and_no_more():
    robot, motion = RobotStream(NAO, fps=FPS), random_arms(50, 3)
    first = robot.push(motion)
    robot.rewind(0)
    robot.rewind(50)
    np.testing.assert_array_equal(robot.push(motion), first)
    for count in (51, -1, 2.0, "3", None, True):
        with pytest.raises(InputError, match="commands cannot be taken back"):
            robot.rewind(count)
    robot.finish()
    with pytest.raises(InputError, match="finished"):
        robot.rewind(1)


def test_a_file_has_the_commands_and_stays_within_the_limits(tmp_path):
    joints = [NAO[0], *NAO[2:3]]
    ends = np.array([[joint.upper for joint in joints], [joint.lower for joint in joints]]) * (1 - 1e-12)
    save_trajectory(tmp_path / "a.csv", ends, joints, fps=50)
    rows = np.loadtxt(tmp_path / "a.csv", delimiter=",", skiprows=1)[:, 1:]
    assert (rows <= [joint.upper for joint in joints]).all()
    assert (rows >= [joint.lower for joint in joints]).all()
    np.testing.assert_allclose(rows, ends, atol=2e-9)


@pytest.mark.parametrize(
    ("commands", "fps", "what"),
    [
        (np.zeros((3, 3)), 50, r"commands of shape \(3, 3\)"), (np.zeros(3), 50, r"shape \(3,\)"),
        (np.zeros((2, 2)), 0, "fps is 0"), (np.full((2, 2), np.nan), 50, "finite"), (np.zeros((2, 2)), "50", "fps is '50'"),
    ],
)  # fmt: skip
def test_what_is_no_trajectory_leaves_nothing(tmp_path, commands, fps, what):
    with pytest.raises(InputError, match=what):
        save_trajectory(tmp_path / "a.json", commands, NAO[:2], fps=fps)
    assert not [*tmp_path.iterdir()]


def test_what_is_no_motion_no_rate_and_no_start():
    with pytest.raises(InputError, match="ndarray for a robot"):
        RobotStream(NAO, fps=FPS).push(np.zeros((3, 55, 4)))
    for options, what in (
        ({"fps": "50"}, "fps is '50'"),
        ({"fps": np.nan}, "fps is nan"),
        ({"fps": 1e18}, "fps is 1e"),
        ({"start": [0.0]}, r"a start that is"),
    ):
        with pytest.raises(InputError, match=what):
            RobotStream(NAO, **{"fps": FPS, **options})
    limiter = JointLimiter(np.array([-1.0]), np.array([1.0]), np.array([1.0]), np.array([8.0]), fps=50)
    with pytest.raises(InputError, match="goals of shape"):
        limiter.push(np.array([[0.0], [np.nan]]))
    np.testing.assert_array_equal(limiter.push(np.array([[0.5]])), [[0.5]])
