"""Robots by name: the angle that each joint takes, and its limits."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...errors import InputError, nearest
from .joints import RobotJoint

__all__ = ["ROBOTS", "TURNS", "find_robot"]


def _aldebaran(
    rolls: tuple[float, float], elbow: tuple[float, float], head: tuple[float, float], v: Mapping[str, float]
) -> tuple[RobotJoint, ...]:
    """NAO's and Pepper's joints, which differ in limits only."""
    turn, wrist = 2.0857, 1.8238
    joints = [
        RobotJoint("HeadYaw", "head_yaw", -turn, turn, v["head_yaw"]),
        RobotJoint("HeadPitch", "head_pitch", *head, v["head_pitch"]),
    ]
    for side, letter, s in (("left", "L", 1), ("right", "R", -1)):

        def limits(low: float, high: float, s: int = s) -> tuple[float, float]:
            return (low, high) if s > 0 else (-high, -low)

        joints += [
            RobotJoint(f"{letter}ShoulderPitch", f"{side}_shoulder_pitch", -turn, turn, v["pitch"]),
            RobotJoint(f"{letter}ShoulderRoll", f"{side}_shoulder_roll", *limits(*rolls), v["roll"]),
            RobotJoint(f"{letter}ElbowYaw", f"{side}_shoulder_yaw", -turn, turn, v["yaw"]),
            RobotJoint(f"{letter}ElbowRoll", f"{side}_elbow", *limits(*elbow), v["elbow"]),
            RobotJoint(f"{letter}WristYaw", f"{side}_forearm_yaw", -wrist, wrist, v["wrist"]),
            RobotJoint(f"{letter}Hand", f"{side}_hand", 0.0, 1.0, 8.3),
        ]
    return tuple(joints)


def _reachy() -> tuple[RobotJoint, ...]:
    """An arm that hangs down at 0 and bends its elbow about y, as Reachy's does. Limits in degrees, speed ours (moderate)."""
    quarter, speed, joints = np.pi / 2, 3.0, []
    for side, letter, s in (("left", "l", 1.0), ("right", "r", -1.0)):
        roll = (-10.0, 180.0) if s > 0 else (-180.0, 10.0)
        for name, channel, low, high, sign, offset in (
            ("shoulder_pitch", "shoulder_pitch", -180.0, 90.0, 1.0, -quarter),
            ("shoulder_roll", "shoulder_roll", *roll, 1.0, 0.0),
            ("arm_yaw", "shoulder_yaw", -90.0, 90.0, -1.0, -s * quarter),
            ("elbow_pitch", "elbow", -125.0, 0.0, s, 0.0),
            ("forearm_yaw", "forearm_yaw", -100.0, 100.0, -1.0, 0.0),
        ):
            ends = float(np.radians(low)), float(np.radians(high))
            joints.append(RobotJoint(f"{letter}_{name}", f"{side}_{channel}", *ends, speed, sign, offset))
    return tuple(joints)


ROBOTS: Mapping[str, tuple[RobotJoint, ...]] = {
    "nao": _aldebaran((-0.3142, 1.3265), (-1.5446, -0.0349), (-0.6720, 0.5149), {
        "head_yaw": 8.26797, "head_pitch": 7.19407, "pitch": 8.26797, "roll": 7.19407, "yaw": 8.26797, "elbow": 7.19407,
        "wrist": 24.6229}),
    "pepper": _aldebaran((0.0087, 1.5621), (-1.5621, -0.0087), (-0.7069, 0.6371), {
        "head_yaw": 7.33998, "head_pitch": 9.22756, "pitch": 7.33998, "roll": 9.22756, "yaw": 7.33998, "elbow": 9.22756,
        "wrist": 17.3835}),
    "reachy": _reachy(),
}  # fmt: skip
"""Name → joints. Ranges of NAO (V4 and later) and Pepper as in Aldebaran's documentation, speeds as in their URDFs."""


_ABOUT = {
    "HeadYaw": "z", "HeadPitch": "y", "ShoulderPitch": "y", "ShoulderRoll": "z", "ElbowYaw": "x", "ElbowRoll": "z",
    "WristYaw": "x", "shoulder_pitch": "y", "shoulder_roll": "x", "arm_yaw": "z", "elbow_pitch": "y", "forearm_yaw": "z",
}  # fmt: skip
TURNS: Mapping[str, str] = {
    joint.name: about
    for robot in ROBOTS.values()
    for joint in robot
    for name, about in _ABOUT.items()
    if joint.name in (name, f"L{name}", f"R{name}", f"l_{name}", f"r_{name}")
}
"""Joint → the axis that it turns about where all joints are at 0, in the frame of the base (ROS, REP 103); hands have none. NAO
and Pepper as in Aldebaran's documentation, whose arms point forward at 0; Reachy's hang down."""


def find_robot(name: str) -> tuple[RobotJoint, ...]:
    """A robot by name.

    Raises:
        InputError: there is none of that name; the message lists those that there are.
    """
    if name not in ROBOTS:
        raise InputError(f"no robot is called {name!r}", f"{nearest(name, ROBOTS)}, or a .urdf file: my_robot.urdf")
    return ROBOTS[name]
