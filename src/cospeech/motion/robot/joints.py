"""One joint of a robot: the angle that it takes, and its limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

import numpy as np

from ...errors import InputError, nearest
from ..rotations import Array
from .angles import CHANNELS

__all__ = ["LIMITS", "RobotJoint", "check_limits", "narrow_joints"]

LIMITS = ("lower", "upper", "velocity", "acceleration")
_PUSH = 8.0  # per second: a joint reaches its full speed in an eighth of a second [ours; makers do not publish it]


@dataclass(frozen=True)
class RobotJoint:
    """One joint of a robot.

    Raises:
        InputError: no such channel, impossible limits, or a hand with an offset.
    """

    name: str
    channel: str
    """The angle that it takes, one of `CHANNELS`."""
    lower: float
    """Radians; metres for a gripper that slides."""
    upper: float
    velocity: float
    """Radians (or metres) per second, at most."""
    sign: float = 1.0
    """For a hand, +1: open is ``upper``; -1: open is ``lower``."""
    offset: float = 0.0
    """Radians: command = sign × angle + offset."""
    acceleration: float = 0.0
    """Radians (or metres) per second², at most; 0 becomes 8 × velocity: full speed in an eighth of a second."""

    def __post_init__(self) -> None:
        if self.channel not in CHANNELS:
            raise InputError(f"joint {self.name!r} takes {self.channel!r}", nearest(self.channel, CHANNELS))
        if not self.acceleration:
            object.__setattr__(self, "acceleration", _PUSH * self.velocity)
        numbers = [self.lower, self.upper, self.velocity, self.acceleration, self.offset]
        if not (np.isfinite(numbers).all() and self.lower <= self.upper and self.velocity > 0 and self.acceleration > 0):
            raise InputError(
                f"joint {self.name!r} has limits {self.lower} … {self.upper}, speed {self.velocity}, "
                f"acceleration {self.acceleration}, offset {self.offset}",
                "finite numbers; lower ≤ upper, and a speed and an acceleration above 0",
            )
        if self.is_hand and self.offset:
            raise InputError(f"joint {self.name!r} is a hand with an offset", "its limits say where it is closed and open")

    @property
    def is_hand(self) -> bool:
        """Whether it opens and closes."""
        return self.channel.endswith("_hand")

    def command(self, angles: Mapping[str, Array]) -> Array:
        """(T,) goals of the joint, before its limits are applied; a hand goes from one of its limits to the other.

        Args:
            angles: channel → (T,), as of `BodyAngles`.
        """
        angle = angles[self.channel]
        if not self.is_hand:
            return self.sign * angle + self.offset
        closed_at, open_at = (self.lower, self.upper) if self.sign > 0 else (self.upper, self.lower)
        return closed_at + angle * (open_at - closed_at)


def narrow_joints(joints: Sequence[RobotJoint], limits: Mapping[str, Mapping[str, float]]) -> tuple[RobotJoint, ...]:
    """The same joints with other limits.

    Args:
        joints: of a robot.
        limits: joint → some of `LIMITS`. Position and speed may only become narrower. Acceleration may have any value; if only
            a speed is given, full speed is reached in the same time as before.

    Raises:
        InputError: no such joint or limit, a limit that is no number, or one that is wider than the robot's.

    >>> from cospeech.motion.robot import find_robot
    >>> narrow_joints(find_robot("nao"), {"HeadYaw": {"velocity": 2.0, "acceleration": 5.0}})[0].acceleration
    5.0
    """
    names = [joint.name for joint in joints]
    for name in limits:
        if name not in names:
            raise InputError(f"limits of joint {name!r}, which is not moved", nearest(name, names))
    return tuple(_narrow(joint, limits[joint.name]) if joint.name in limits else joint for joint in joints)


def check_limits(name: str, limits: Mapping[str, float]) -> None:
    """Check that limits of a joint are some of `LIMITS`, and numbers.

    Raises:
        InputError: they are not, or a speed or an acceleration is not above 0.
    """
    for key, value in limits.items():
        if key not in LIMITS:
            raise InputError(f"joint {name!r} has a limit {key!r}", nearest(key, LIMITS))
        if isinstance(value, bool) or not isinstance(value, Real) or not np.isfinite(value):
            raise InputError(f"joint {name!r} has {key} = {str(value)[:40]!r}", "a number")
        if key in ("velocity", "acceleration") and value <= 0:
            raise InputError(f"joint {name!r} has {key} = {value:g}", "above 0")


def _narrow(joint: RobotJoint, limits: Mapping[str, float]) -> RobotJoint:
    check_limits(joint.name, limits)
    for key, value in limits.items():
        own = getattr(joint, key)
        if key != "acceleration" and (value < own if key == "lower" else value > own):
            raise InputError(f"joint {joint.name!r} has {key} = {value:g}, the robot {own:g}", "limits may only be narrowed")
    faster = joint.acceleration / joint.velocity * limits.get("velocity", joint.velocity)
    values: dict[str, Any] = {"acceleration": faster, **limits}
    return replace(joint, **values)
