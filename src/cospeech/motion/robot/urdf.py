"""Read the joints of a robot from its URDF."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from ...errors import InputError, nearest
from ...files import read_regular
from ...limits import URDF_BYTES
from .joints import RobotJoint, check_limits
from .robots import ROBOTS, TURNS
from .urdf_axes import Axis, read_axes

__all__ = ["list_followers", "list_joints", "read_urdf"]

_MOVING = ("revolute", "continuous", "prismatic")
_ANY = {"lower": -np.inf, "upper": np.inf, "velocity": np.inf}
_OTHERS = ("fixed", "floating", "planar")  # the other types of the specification, which take no angle


def read_urdf(
    path: str | PathLike[str],
    channels: Mapping[str, str] | None = None,
    limits: Mapping[str, Mapping[str, float]] | None = None,
) -> tuple[RobotJoint, ...]:
    """Read the joints of a robot from its URDF, in the order of the file.

    Args:
        path: the ``.urdf`` (for a ``.xacro``, the output of xacro).
        channels: joint → the one of `CHANNELS` that it takes. ``"-left_elbow"`` takes it with the other sign,
            ``"left_shoulder_pitch-1.5708"`` with an offset in radians; with ``""`` the joint does not move. A hand goes from
            the lower limit (closed) to the upper one (open); for ``"-left_hand"``, open is the lower one. Joints with the names
            of a known robot need no channel if they turn about the same axis (`read_axes`). If the axis points the other way,
            such a joint takes the other sign. A joint that follows another (``<mimic>``) takes no channel; it narrows the
            limits of the joint that it follows to its own.
        limits: joint → lower, upper and velocity, used if the URDF does not give them; a velocity of 0 counts as not given.
            `narrow_joints` narrows the limits that the URDF gives.

    Raises:
        InputError: no URDF, a joint of unknown type, a channel for a joint that is absent or follows another, a joint whose
            limits neither the URDF nor ``limits`` gives, or a sliding joint that takes no hand.
    """
    root = _read_root(path)
    moving, followers = _read_joints(root, path)
    axes = read_axes(root, _MOVING)
    for name in channels or {}:
        if name in followers:
            leader = _read_leader(name, followers[name])
            problem = f"joint {name!r} of {str(path)!r} follows {leader!r} and takes nothing"
            raise InputError(problem, f"map {leader}, and leave {name} out of the map")
    assignments = {name: what for name, what in (_recognise(moving, axes) | dict(channels or {})).items() if what}
    if not assignments:
        raise InputError(
            f"no joint of {str(path)!r} is recognised", 'a map says what each takes, such as arm_1 = "left_shoulder_pitch"'
        )
    for name in assignments:
        if name not in moving:
            raise InputError(f"{str(path)!r} has no joint {name!r} that moves", nearest(name, moving))
    limit_table = limits or {}
    for name in limit_table:
        check_limits(name, limit_table[name])
    joints = tuple(
        _joint(name, moving[name], assignments[name], limit_table.get(name, {})) for name in moving if name in assignments
    )
    return _narrow_leaders(joints, followers, limit_table)


def list_joints(path: str | PathLike[str]) -> tuple[str, ...]:
    """Names of the joints of a URDF that turn or slide and follow no other, in the order of the file.

    Raises:
        InputError: no URDF.
    """
    return tuple(_read_joints(_read_root(path), path)[0])


def list_followers(path: str | PathLike[str]) -> dict[str, str]:
    """Joint of a URDF that mimics another → the joint that it follows, in the order of the file.

    Raises:
        InputError: no URDF.
    """
    return {name: _read_leader(name, joint) for name, joint in _read_joints(_read_root(path), path)[1].items()}


def _read_joints(
    root: ElementTree.Element, path: str | PathLike[str]
) -> tuple[dict[str, ElementTree.Element], dict[str, ElementTree.Element]]:
    """The joints that turn or slide by commands, and the joints that follow another."""
    joints: dict[str, ElementTree.Element] = {}
    followers: dict[str, ElementTree.Element] = {}
    for joint in root.findall("{*}joint"):  # {*}: with a namespace of its own, too
        name, kind = joint.get("name", ""), joint.get("type")
        if kind not in (*_MOVING, *_OTHERS):
            problem = f"joint {name!r} of {str(path)!r} has {'no type' if kind is None else f'type {kind[:40]!r}'}"
            raise InputError(problem, nearest(kind or "", (*_MOVING, *_OTHERS)))
        if kind in _OTHERS:
            continue
        if not name:
            raise InputError(f"a {kind} joint of {str(path)!r} has no name", 'a URDF says <joint name="HeadYaw" …>')
        if name in joints or name in followers:
            raise InputError(f"{str(path)!r} has two joints {name!r}", "each joint needs a name of its own")
        (joints if joint.find("{*}mimic") is None else followers)[name] = joint
    for name, joint in followers.items():
        leader = _read_leader(name, joint)
        if leader not in joints:
            problem = f"joint {name!r} mimics {leader!r}"
            raise InputError(
                problem, nearest(leader, joints) if leader not in followers else "which follows another joint itself"
            )
    return joints, followers


def _read_root(path: str | PathLike[str]) -> ElementTree.Element:
    data = read_regular(path, "a URDF", URDF_BYTES)

    def refuse_doctype(*arguments: object) -> None:
        raise InputError(f"{str(path)!r} has a document type", "remove <!DOCTYPE …>; a URDF needs none")

    parser = expat.ParserCreate()  # it finds a document type in any encoding
    parser.StartDoctypeDeclHandler = refuse_doctype
    try:
        parser.Parse(data, True)
        root = ElementTree.fromstring(data)
    except (expat.ExpatError, ElementTree.ParseError) as error:
        raise InputError(f"{str(path)!r} is no XML: {error}", "is it a .urdf, not a .xacro?") from None
    if (tag := root.tag.rpartition("}")[2]) != "robot":
        raise InputError(f"{str(path)!r} is no URDF: it begins with <{tag[:40]}>", "a URDF begins with <robot>")
    return root


def _read_leader(name: str, joint: ElementTree.Element) -> str:
    mimic = joint.find("{*}mimic")
    leader = None if mimic is None else mimic.get("joint")
    if not leader:
        raise InputError(f"joint {name!r} mimics a joint that has no name", 'a URDF says <mimic joint="gripper"/>')
    return leader


def _recognise(joints: Mapping[str, ElementTree.Element], axes: Mapping[str, Axis]) -> dict[str, str]:
    """Assignments of joints with the names of a known robot: its signs and offsets, or their opposites if the axis is opposite.

    A joint that turns about another axis than that of the robot is not recognised: its angle would mean something else.
    """
    table, assignments = {joint.name: joint for robot in ROBOTS.values() for joint in robot}, {}
    for name, element in joints.items():
        if name not in table:
            continue
        joint, axis = table[name], axes[name]
        if not joint.is_hand and (element.get("type") == "prismatic" or axis.letter not in ("", TURNS[name])):
            continue
        way = -1.0 if axis.is_turned_over and not joint.is_hand else 1.0
        assignments[name] = f"{'-' * (way * joint.sign < 0)}{joint.channel}{way * joint.offset:+.6f}"
    return assignments


def _narrow_leaders(
    joints: tuple[RobotJoint, ...], followers: Mapping[str, ElementTree.Element], limits: Mapping[str, Mapping[str, float]]
) -> tuple[RobotJoint, ...]:
    """Narrow the limits of joints to those of their followers: follower = multiplier × leader + offset."""
    own = {joint.name: joint for joint in joints}
    for name, element in followers.items():
        leader, mimic = own.get(_read_leader(name, element)), element.find("{*}mimic")
        if leader is None or mimic is None or (element.find("{*}limit") is None and element.get("type") != "continuous"):
            continue
        times = _read_number(name, mimic, "multiplier") if mimic.get("multiplier") else 1.0
        plus = _read_number(name, mimic, "offset") if mimic.get("offset") else 0.0
        if not times:
            continue
        lower, upper, velocity = _read_limits(name, element, {**_ANY, **limits.get(name, {})})
        ends = sorted(((lower - plus) / times, (upper - plus) / times))
        low, high = max(leader.lower, ends[0]), min(leader.upper, ends[1])
        if low > high:
            problem = f"joint {name!r} mimics {leader.name!r}, whose limits let it be nowhere"
            raise InputError(problem, f"{leader.name} {leader.lower:g} … {leader.upper:g}, {name} {lower:g} … {upper:g}")
        slower = min(leader.velocity, velocity / abs(times))
        push = leader.acceleration * slower / leader.velocity
        own[leader.name] = replace(leader, lower=low, upper=high, velocity=slower, acceleration=push)
    return tuple(own[joint.name] for joint in joints)


def _joint(name: str, element: ElementTree.Element, what: str, limits: Mapping[str, float]) -> RobotJoint:
    channel, sign, offset = _parse_channel(name, what)
    lower, upper, velocity = _read_limits(name, element, limits)
    joint = RobotJoint(name, channel, lower, upper, velocity, sign, offset)
    if element.get("type") == "prismatic" and not joint.is_hand:
        raise InputError(
            f"joint {name!r} slides and cannot take {channel!r}", "a prismatic joint takes left_hand or right_hand"
        )
    if element.get("type") == "continuous" and joint.is_hand:
        raise InputError(
            f"joint {name!r} turns without end and cannot take {channel!r}", "a hand needs limits to close and open"
        )
    return joint


def _parse_channel(name: str, what: str) -> tuple[str, float, float]:
    """Parse channel, sign and offset from a text such as ``-left_elbow+0.5``."""
    match = re.fullmatch(r"(-?)([a-z_]+)([+-].+)?", what.replace(" ", ""))
    try:
        offset = float(match[3] or 0) if match else None
    except ValueError:
        offset = None
    if match is None or offset is None:
        raise InputError(f"joint {name!r} takes {what!r}", "write left_elbow, or -left_elbow+0.5 in radians")
    return match[2], -1.0 if match[1] else 1.0, offset


def _read_limits(name: str, element: ElementTree.Element, extra: Mapping[str, float]) -> tuple[float, float, float]:
    """Lower, upper and velocity: the narrower of hard and soft limits; those of ``extra`` if the URDF has none."""
    limit, soft = element.find("{*}limit"), element.find("{*}safety_controller")
    turns_without_end = element.get("type") == "continuous"
    values = dict[str, float]()
    for key in ("lower", "upper", "velocity"):
        if turns_without_end and key != "velocity":
            values[key] = {"lower": -2 * np.pi, "upper": 2 * np.pi}[key]
            continue
        value = None if limit is None or limit.get(key) is None else _read_number(name, limit, key)
        if value is None or (key == "velocity" and value == 0):  # many exporters write 0 for an unknown speed
            if key not in extra:
                problem = f"joint {name!r} has no limits: {key} is {'missing' if value is None else 0}"
                hint = f'a URDF says <limit lower=… upper=… velocity=…/>; or a map: [limits."{name}"] and {key} = … below it'
                raise InputError(problem, hint)
            value = extra[key]
        values[key] = float(value)
    for key, narrower in (("lower", max), ("upper", min)):
        if soft is not None and soft.get(f"soft_{key}_limit") is not None:
            values[key] = narrower(values[key], _read_number(name, soft, f"soft_{key}_limit"))
    return values["lower"], values["upper"], values["velocity"]


def _read_number(name: str, element: ElementTree.Element, key: str) -> float:
    text = element.get(key, "")
    try:
        number = float(text)
    except ValueError:
        number = float("nan")
    if np.isnan(number):
        hint = "a number; xacro fills in what stands in ${…}"
        raise InputError(f"the URDF says {key}={text[:40]!r} of joint {name!r}", hint)
    return number
