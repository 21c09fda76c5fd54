"""Commands of a whole robot: as a stream, for a whole motion, and as files for controllers."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from numbers import Real
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, nearest
from ...files import atomic
from ..motion import Motion
from ..rotations import Array
from .angles import BodyAngles
from .joints import LIMITS, RobotJoint
from .limiter import JointLimiter
from .turns import TurnChooser

__all__ = ["RobotStream", "check_trajectory_file", "robot_trajectory", "save_trajectory"]

_SUFFIXES = (".csv", ".json")
_FASTEST = 10_000.0  # commands per second [ours: as of `Motion`]
_DIGITS = 9  # digits behind the point, radians [ours: at 240 commands per second, an acceleration is then right to 1e-4]
_TOLERANCE = 0.05  # radians by which a measured place, or a goal, may lie beyond a limit [ours]


class RobotStream:
    """Turns motion that comes in pieces into commands of a robot; the pieces together give those of the whole.

    Args:
        joints: of the robot, from `find_robot` or `read_urdf`.
        fps: of the motion and of the commands.
        start: joint → radians, the present place of the robot. From there it follows the motion within its limits. A joint
            without a start begins where the motion begins.

    Raises:
        InputError: no joints, a start of a joint that the robot does not have, one that is no number, or one that is not within
            the joint's limits.

    >>> from cospeech.motion.robot import find_robot
    >>> RobotStream(find_robot("nao"), fps=50, start={"HeadYaw": 0.4}).names[0]
    'HeadYaw'
    """

    def __init__(self, joints: Sequence[RobotJoint], *, fps: float, start: Mapping[str, float] | None = None) -> None:
        if not joints or not all(isinstance(joint, RobotJoint) for joint in joints):
            problem = f"joints that are {joints!r:.60}" if joints else "a robot without joints"
            raise InputError(problem, "find_robot('nao'), or read_urdf('my_robot.urdf')")
        _check_rate(fps)
        if start is not None and not isinstance(start, Mapping):
            raise InputError(f"a start that is {start!r:.60}", 'joint → radians, such as {"HeadYaw": 0.4}')
        self.joints, self.fps, self._angles = tuple(joints), fps, BodyAngles()
        limits = [[getattr(joint, name) for joint in joints] for name in LIMITS]
        start = start or {}
        for name in start:
            if name not in self.names:
                raise InputError(f"a start of joint {name!r}", nearest(name, self.names))
            if not isinstance(start[name], Real) or not np.isfinite(start[name]):
                raise InputError(f"a start of joint {name!r} at {start[name]!r}", "radians")
            joint = joints[self.names.index(name)]
            if not joint.lower - _TOLERANCE <= start[name] <= joint.upper + _TOLERANCE:
                ends = f"its limits are {joint.lower:.2f} … {joint.upper:.2f} radians"
                raise InputError(f"a start of joint {name!r} at {start[name]:g} radians", ends)
        first = np.array([start.get(name, np.nan) for name in self.names], float)
        self._limiter = JointLimiter(*(np.array(values) for values in limits), fps=fps, start=first)
        turning = np.array([not joint.is_hand for joint in joints])
        self._turns = TurnChooser(np.array(limits[0]), np.array(limits[1]), turning)
        self._ends = np.array(limits[:2]) + np.array([[-_TOLERANCE], [_TOLERANCE]])
        self._outside, self._has_commands, self._is_over = np.ones(len(joints), bool), False, False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the columns."""
        return tuple(joint.name for joint in self.joints)

    @property
    def outside(self) -> tuple[str, ...]:
        """Names of the joints whose goal has been beyond a limit in every frame so far."""
        return tuple(name for name, always in zip(self.names, self._outside, strict=True) if always and self._has_commands)

    def push(self, motion: Motion) -> Array:
        """(T, J) commands of the next frames, radians.

        Raises:
            InputError: not a motion, a motion of another rate, or the stream is finished.
        """
        self._check_open()
        if not isinstance(motion, Motion):
            raise InputError(f"{type(motion).__name__} for a robot", "a Motion, as a session gives it")
        if motion.fps != self.fps:
            raise InputError(f"motion of {motion.fps:g} frames per second for a robot of {self.fps:g}", "motion.resample(fps)")
        angles = self._angles.push(motion)
        goals = self._turns.push(np.stack([joint.command(angles) for joint in self.joints], 1))
        self._outside &= ((goals < self._ends[0]) | (goals > self._ends[1])).all(0)
        self._has_commands |= len(goals) > 0
        return self._limiter.push(goals)

    def rewind(self, count: int) -> None:
        """Take back the last commands that the robot did not get, because `LiveSession.interrupt` took back their frames.

        The next commands go on from the command before them, within the limits.

        Args:
            count: number of commands, within the last 60 s.

        Raises:
            InputError: there were not so many commands, they are too old, or the stream is finished.
        """
        self._check_open()
        self._turns.go_on_from(self._limiter.rewind(count))
        self._angles = BodyAngles()

    def finish(self) -> Array:
        """(T, J) commands that stop the joints as soon as they can brake; none if all stand still. The stream is finished then.

        With the usual acceleration this takes an eighth of a second at most.

        Raises:
            InputError: the stream is finished already.
        """
        self._check_open()
        self._is_over = True
        return self._limiter.finish()

    def _check_open(self) -> None:
        if self._is_over:
            raise InputError("the stream of commands is finished", "open another RobotStream; start= says where the robot is")


def robot_trajectory(motion: Motion, joints: Sequence[RobotJoint]) -> Array:
    """(T, J) commands of a whole motion, radians.

    It begins and ends at standstill. If a joint still moves at the end of the motion, the commands are longer than the motion
    by the time to brake, an eighth of a second at most with the usual acceleration.
    """
    stream = RobotStream(joints, fps=motion.fps)
    return np.concatenate([stream.push(motion), stream.finish()])


def check_trajectory_file(path: str | PathLike[str]) -> str:
    """The suffix of a file for `save_trajectory`.

    Raises:
        InputError: no such file can be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _SUFFIXES:
        raise InputError(f"a trajectory as {suffix or 'a file without suffix'}", f"known: {' '.join(_SUFFIXES)}")
    return suffix


def save_trajectory(path: str | PathLike[str], commands: Array, joints: Sequence[RobotJoint], *, fps: float) -> None:
    """Write commands: ``.csv`` with a column for each joint, or ``.json`` in the shape of ROS' JointTrajectory.

    The velocities of the ``.json`` are those of the positions. The first is 0, as a trajectory begins at rest. Numbers have
    nine digits behind the point, and stay within the limits of the joints.

    Args:
        path: the suffix picks the format.
        commands: (T, J) radians.
        joints: J of them.
        fps: commands per second.

    Raises:
        InputError: another suffix, commands that are not (T, J) finite numbers, a rate that is not above 0, or a file that
            cannot be written.
    """
    suffix, names = check_trajectory_file(path), [joint.name for joint in joints]
    commands = np.asarray(commands, float)
    if commands.ndim != 2 or commands.shape[1] != len(joints) or not np.isfinite(commands).all():
        raise InputError(
            f"commands of shape {commands.shape}", f"finite numbers, (commands, {len(joints)}): one for each joint"
        )
    _check_rate(fps)
    speeds = np.gradient(commands, 1 / fps, axis=0) if len(commands) > 1 else np.zeros_like(commands)
    speeds[:1] = 0.0
    places = _round_within(commands, joints)
    with atomic(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        if suffix == ".csv":
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(["time", *names])
            rows.writerows([f"{k / fps:.6f}", *(f"{value:.{_DIGITS}f}" for value in row)] for k, row in enumerate(places))
            return
        points = []
        for k, (row, speed) in enumerate(zip(places.tolist(), speeds.round(_DIGITS).tolist(), strict=True)):
            nanoseconds = round(k / fps * 1e9)
            when = {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
            points.append({"positions": row, "velocities": speed, "time_from_start": when})
        json.dump({"joint_names": names, "points": points}, file)


def _check_rate(fps: Any) -> None:
    if isinstance(fps, bool) or not isinstance(fps, Real) or not 0 < float(fps) <= _FASTEST:
        raise InputError(f"fps is {fps!r:.40}", "commands per second, such as 50")


def _round_within(commands: Array, joints: Sequence[RobotJoint]) -> Array:
    """Round commands to `_DIGITS` digits behind the point; commands within the limits stay within them."""
    unit = 10.0**-_DIGITS
    lower, upper = (np.array([getattr(joint, name) for joint in joints]) for name in LIMITS[:2])
    result = commands.round(_DIGITS)
    result = np.where((result < lower) & (commands >= lower), (commands + unit).round(_DIGITS), result)
    return np.where((result > upper) & (commands <= upper), (commands - unit).round(_DIGITS), result)
