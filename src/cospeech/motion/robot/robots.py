"""Robots: which angle each joint takes, and its limits; three by name, others from their URDF."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from xml.etree import ElementTree

import numpy as np

from ...errors import InputError, nearest
from ...files import read_regular
from .angles import CHANNELS

__all__ = ["ROBOTS", "RobotJoint", "find_robot", "list_joints", "read_urdf"]

_URDF = 16 << 20  # bytes; ours: a large robot has some 200 kB
_PUSH = 8.0  # per second: a joint reaches its full speed in an eighth of a second [ours; makers do not publish it]


@dataclass(frozen=True)
class RobotJoint:
    """One joint of a robot."""

    name: str
    channel: str
    """Of `CHANNELS`, the angle that it takes."""
    lower: float
    """Radians; of a hand 0 … 1."""
    upper: float
    velocity: float
    """Radians per second, at most."""
    sign: float = 1.0
    offset: float = 0.0
    """Radians: command = sign × angle + offset."""

    @property
    def acceleration(self) -> float:
        """Radians per second², at most."""
        return _PUSH * self.velocity

    def __post_init__(self) -> None:
        if self.channel not in CHANNELS:
            raise InputError(f"joint {self.name!r} takes {self.channel!r}", nearest(self.channel, CHANNELS))
        if not (np.isfinite([self.lower, self.upper, self.velocity]).all() and self.lower <= self.upper and self.velocity > 0):
            raise InputError(
                f"joint {self.name!r} has limits {self.lower} … {self.upper}, speed {self.velocity}",
                "lower ≤ upper, and a speed above 0",
            )


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


def find_robot(name: str) -> tuple[RobotJoint, ...]:
    """A robot by name.

    Raises:
        InputError: there is none of that name; the message lists those that there are.
    """
    if name not in ROBOTS:
        raise InputError(f"no robot is called {name!r}", nearest(name, ROBOTS))
    return ROBOTS[name]


def read_urdf(path: str | PathLike[str], channels: Mapping[str, str] | None = None) -> tuple[RobotJoint, ...]:
    """Joints of a robot from its URDF, in the order of the file.

    Args:
        path: the ``.urdf`` (of a ``.xacro``, what xacro makes of it).
        channels: joint → what it takes of `CHANNELS`; ``"-left_elbow"`` takes it with the other sign,
            ``"left_shoulder_pitch-1.5708"`` with an offset in radians, and with ``""`` the joint is not moved. Joints with the
            names of a known robot need none. Such a joint takes the other sign where its axis points the other way.

    Raises:
        InputError: no URDF, a joint that it does not have, or one without limits.
    """
    moving = _read_joints(path)
    wanted = {name: what for name, what in (_recognise(moving) | dict(channels or {})).items() if what}
    if not wanted:
        raise InputError(
            f"no joint of {str(path)!r} is recognised", 'a map says what each takes, such as arm_1 = "left_shoulder_pitch"'
        )
    for name in wanted:
        if name not in moving:
            raise InputError(f"{str(path)!r} has no turning joint {name!r}", nearest(name, moving))
    return tuple(_joint(name, moving[name], wanted[name]) for name in moving if name in wanted)


def list_joints(path: str | PathLike[str]) -> tuple[str, ...]:
    """Names of the turning joints of a URDF, in the order of the file.

    Raises:
        InputError: no URDF.
    """
    return tuple(_read_joints(path))


def _read_joints(path: str | PathLike[str]) -> dict[str, ElementTree.Element]:
    data = read_regular(path, "a URDF", _URDF)
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise InputError(f"{str(path)!r} has a document type", "remove <!DOCTYPE …>; a URDF needs none")
    try:
        tree = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise InputError(f"{str(path)!r} is no XML: {error}", "is it a .urdf, not a .xacro?") from None
    found: dict[str, ElementTree.Element] = {}
    for joint in tree.iter("joint"):
        if joint.get("type") in ("revolute", "continuous"):
            name = joint.get("name", "")
            if name in found:
                raise InputError(f"{str(path)!r} has two joints {name!r}", "each joint needs a name of its own")
            found[name] = joint
    return found


def _recognise(joints: Mapping[str, ElementTree.Element]) -> dict[str, str]:
    """Joints with the names of a robot of ours, with its signs and offsets, both turned over where the axis is."""
    known, found = {joint.name: joint for robot in ROBOTS.values() for joint in robot}, {}
    for name, element in joints.items():
        if name in known:
            joint = known[name]
            way = -1.0 if _is_turned_over(element) and not joint.channel.endswith("_hand") else 1.0
            found[name] = f"{'-' * (way * joint.sign < 0)}{joint.channel}{way * joint.offset:+.6f}"
    return found


def _is_turned_over(element: ElementTree.Element) -> bool:
    """Whether a joint turns about x, y or z the other way; all joints of our robots turn about +x, +y or +z.

    Of an axis that is oblique, nothing is known; one that is not written is +x.
    """
    axis = element.find("axis")
    try:
        parts = [] if axis is None else [float(part) for part in axis.get("xyz", "").split()]
    except ValueError:
        raise InputError(f"joint {element.get('name')!r} has an axis that is no numbers", 'write xyz="0 0 1"') from None
    return sum(parts) < 0 and sum(part != 0 for part in parts) == 1


def _joint(name: str, element: ElementTree.Element, what: str) -> RobotJoint:
    limit = element.find("limit")
    try:
        found = {} if limit is None else {key: float(limit.get(key, "nan")) for key in ("lower", "upper", "velocity")}
        channel, offset = what.lstrip("-"), 0.0
        for mark in "+-":
            if mark in channel:
                channel, _, text = channel.partition(mark)
                offset = float(mark + text)
                break
    except ValueError:
        raise InputError(
            f"joint {name!r}: {what!r} or its limits are no numbers", "write left_elbow, or -left_elbow+0.5"
        ) from None
    if element.get("type") == "continuous":
        found |= {"lower": -2 * np.pi, "upper": 2 * np.pi}
    if not np.isfinite(list(found.values())).all() or len(found) < 3:
        raise InputError(f"joint {name!r} has no limits", "a URDF says <limit lower=… upper=… velocity=…/>")
    return RobotJoint(
        name, channel, found["lower"], found["upper"], found["velocity"], -1.0 if what.startswith("-") else 1.0, offset
    )
