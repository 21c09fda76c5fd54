"""Read the axes of the joints of a URDF, in the frame of its base, with all joints at 0."""

from __future__ import annotations

from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

from ...errors import InputError
from ..rotations import Array, euler_to_quat, quat_to_matrix

__all__ = ["Axis", "read_axes"]

_ALONG = (
    0.9  # cosine to x, y or z from which an axis is that one [ours: 26°; exporters leave noise, and robots tilt some joints]
)


class Axis(NamedTuple):
    """The axis of a joint."""

    letter: str
    """x (forward), y (left) or z (up); empty if the axis is oblique, or the URDF gives none."""
    is_turned_over: bool
    """Whether it points the other way; False for an oblique axis."""


def read_axes(root: ElementTree.Element, types: tuple[str, ...]) -> dict[str, Axis]:
    """Read joint → its axis. The origins along the chain turn the frame of a joint.

    Args:
        root: ``<robot>``.
        types: types of joints that have an axis.

    Raises:
        InputError: an axis or an origin that is not three numbers, an axis of length 0, or links in a circle.
    """
    joints = root.findall("{*}joint")
    above = {link: joint for joint in joints if (link := _link_of(joint, "child"))}
    moving = {joint.get("name", ""): joint for joint in joints if joint.get("type") in types}
    turns: dict[str, Array] = {}
    return {name: _axis_of(name, joint, _turn_of(joint, above, turns)) for name, joint in moving.items()}


def _axis_of(name: str, joint: ElementTree.Element, frame: Array) -> Axis:
    if joint.find("{*}axis") is None:
        return Axis("", False)
    vector = _numbers(name, joint.find("{*}axis"), "xyz", "1 0 0", 'write <axis xyz="0 0 1"/>')
    length = float(np.linalg.norm(vector))
    if not length:
        raise InputError(f"joint {name!r} has an axis of no length", 'write <axis xyz="0 0 1"/>')
    axis = frame @ vector / length
    k = int(np.abs(axis).argmax())
    return Axis("xyz"[k], bool(axis[k] < 0)) if abs(axis[k]) >= _ALONG else Axis("", False)


def _turn_of(joint: ElementTree.Element, above: dict[str, ElementTree.Element], turns: dict[str, Array]) -> Array:
    """(3, 3) from the frame of a joint to that of the base.

    Args:
        joint: the joint.
        above: link → the joint that carries it.
        turns: link → (3, 3) of its frame; links on the way are added, so that a long chain is followed only once.
    """
    way, link = [joint], _link_of(joint, "parent")
    while link not in turns and (upper := above.get(link)) is not None:
        if len(way) > len(above):
            raise InputError(
                f"the links above joint {joint.get('name', '')!r} go in a circle", "each link of a URDF has one parent"
            )
        way.append(upper)
        link = _link_of(upper, "parent")
    turn = turns.get(link, np.eye(3))
    for each in reversed(way):
        rpy = _numbers(each.get("name", ""), each.find("{*}origin"), "rpy", "0 0 0", 'write <origin rpy="0 0 1.5708"/>')
        turn = turn @ quat_to_matrix(euler_to_quat(rpy[None, ::-1], "ZYX"))[0]  # about the fixed x, then y, then z
        if above.get(child := _link_of(each, "child")) is each:
            turns[child] = turn
    return turn


def _link_of(joint: ElementTree.Element, end: str) -> str:
    link = joint.find(f"{{*}}{end}")
    return "" if link is None else link.get("link", "")


def _numbers(name: str, element: ElementTree.Element | None, key: str, usual: str, hint: str) -> Array:
    """(3,) numbers of an attribute."""
    text = usual if element is None else element.get(key, usual)
    try:
        values = np.array([float(part) for part in text.split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) != 3 or not np.isfinite(values).all():
        raise InputError(f"joint {name!r} has {key}={text[:40]!r}, which is no three numbers", hint)
    return values
