"""``cospeech robot``: it turns speech or a motion file into commands for the joints of a robot."""

from __future__ import annotations

from math import tau
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument

from ..errors import InputError, say_count
from ..models import DEFAULT
from .options import Debug, Emotion, Intensity, Language, Model, Quiet, Seed, Style, Transcript, number, option, rate
from .progress import show_progress
from .transcript_options import Offset, Tier, describe_transcript

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..motion.motion import Motion
    from ..motion.robot import RobotJoint
    from ..motion.rotations import Array

__all__ = ["register"]

Source = Annotated[Path, Argument(metavar="SPEECH|MOTION", help="Sound file, or motion file (talk.bvh).")]
Trajectory = Annotated[
    Path,
    Argument(metavar="FILE", help="File to write: .csv (a column for each joint), .json (the shape of ROS' JointTrajectory)."),
]
Robot = Annotated[str, option("--robot", metavar="NAME", help="nao, pepper, reachy, or the URDF of your robot: my_robot.urdf.")]
Channels = Annotated[
    Path | None,
    option(
        "--map",
        metavar="FILE",
        help='TOML file. Table [joints]: joint of the URDF = "left_elbow", or "-left_elbow+0.5"; "" leaves it out. Tables '
        "[limits.JOINT] of any robot: velocity, acceleration, lower, upper. Table [bones]: our names for the joints of MOTION "
        "(docs/guides/robots.md).",
    ),
]
Rest = Annotated[
    float | None,
    option(
        "--rest",
        metavar="SECONDS",
        parser=number,
        help="Seconds of idling after the motion, 0 … 60. The hands need 1.5 s to come down. Without the option: 1.5 after "
        "speech, 0 after a motion file.",
    ),
]
Rate = Annotated[float, option("--fps", metavar="NUMBER", parser=rate, help="Commands per second, 1 … 240.")]

_WIDE, _FAST = 25.2, 50.0
"""Radians from limit to limit, and radians per second: wider limits have no effect. [ours: ± two turns; twice NAO's fastest]"""
_TURN, _SEVERAL = 6.284, 3
"""Radians of a whole turn, and how many joints with a larger range are suspicious. [ours: NAO, Pepper and Reachy have none]"""
_FREE = 2 * tau  # range of a joint that turns without end, in radians, as `read_urdf` sets it
_OF_SPEECH = {
    "model": DEFAULT, "style": None, "emotion": "auto", "transcript": None, "language": "", "seed": 0, "intensity": 1.0
}  # fmt: skip
"""Options that only speech uses → their default values."""


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(robot)


def robot(
    source: Source, target: Trajectory, robot: Robot = "nao", channels: Channels = None, fps: Rate = 50.0, rest: Rest = None,
    model: Model = DEFAULT, style: Style = None, emotion: Emotion = "auto", transcript: Transcript = None,
    offset: Offset = 0.0, tier: Tier = "", language: Language = "", seed: Seed = 0, intensity: Intensity = 1.0,
    quiet: Quiet = False, debug: Debug = False,
) -> None:  # fmt: skip
    """Turn speech or a motion file into commands for a robot.

    Commands stay within the limits of position, speed and acceleration of its joints.

    \b
    cospeech robot talk.wav talk.csv --robot pepper
    cospeech robot talk.wav talk.csv --robot pepper --style calm --seed 3
    cospeech robot talk.bvh talk.json --robot nao --fps 100
    """
    from ..export import FORMATS
    from ..export.checks import check_apart
    from ..motion.robot import check_trajectory_file, save_trajectory
    from ..rules.options import FPS_RANGE, check_range
    from ..runtime.idle import LONGEST, TO_REST, append_idle

    check_range("fps", fps, FPS_RANGE)
    if rest is not None:
        check_range("rest", rest, (0.0, LONGEST), " seconds")
    check_trajectory_file(target)
    check_apart(
        [target],
        [source, *([Path(robot)] if _is_urdf(robot) else []), *(path for path in (channels, transcript, emotion) if path)],
    )
    table = {} if channels is None else _read_map(channels)
    joints = _find_joints(robot, table)
    options = {
        "model": model,
        "style": style,
        "emotion": emotion,
        "transcript": describe_transcript(transcript, offset, tier),
        "language": language,
        "seed": seed,
        "intensity": intensity,
    }
    kind = source.suffix.lower()
    is_motion = str(source) == "-" or source.is_dir() or (kind in FORMATS and kind != ".mp4")  # a video has speech
    bones = table.get("bones")
    if bones and not is_motion:
        raise InputError(f"[bones] of --map changes nothing for {str(source)!r}", "it is for a motion file")
    motion = _read_motion(source, options, bones) if is_motion else _generate_motion(source, options, fps, quiet)
    rest = rest if rest is not None else 0.0 if is_motion else TO_REST
    commands, outside = _make_commands(append_idle(motion.resample(fps), rest, seed=seed, intensity=intensity), joints)
    save_trajectory(target, commands, joints, fps=fps)
    if not quiet:
        counts = f"{say_count(len(commands), 'command')} for {say_count(len(joints), 'joint')}"
        typer.echo(f"{target}  {counts} at {fps:g} per second")
        if _is_urdf(robot):
            typer.echo("  " + ", ".join(f"{joint.name} = {_say_angle(joint)}" for joint in joints))
        _tell_what_stays(robot, source.name, table.get("joints", {}), joints, commands, outside)
    _tell_faults(source.name, joints, table.get("joints", {}), outside)


def _is_urdf(robot: str) -> bool:
    """Whether a robot is named by the file of its URDF.

    Raises:
        InputError: it is a .xacro file, which is no URDF yet.
    """
    suffix = Path(robot).suffix.lower()
    if suffix == ".xacro":
        raise InputError(f"{robot!r} is no URDF yet", f"xacro {robot} > {Path(robot).stem.removesuffix('.urdf')}.urdf makes it")
    return suffix in (".urdf", ".xml")


def _find_joints(robot: str, table: Mapping[str, Any]) -> tuple[RobotJoint, ...]:
    """The joints of a robot; the map may change their channels and limits."""
    from ..motion.robot import find_robot, narrow_joints, read_urdf

    if "joints" in table and not _is_urdf(robot):
        raise InputError(
            f"[joints] of --map changes nothing for {robot!r}", "it is for a URDF; [limits.JOINT] is for any robot"
        )
    limits = table.get("limits", {})
    joints = read_urdf(robot, table.get("joints"), limits) if _is_urdf(robot) else find_robot(robot)
    return narrow_joints(joints, limits)


def _make_commands(motion: Motion, joints: Sequence[RobotJoint]) -> tuple[Array, tuple[str, ...]]:
    """Commands of shape (T, J), and names of the joints whose limits the motion exceeds in all frames."""
    import numpy as np

    from ..motion.robot import RobotStream

    stream = RobotStream(joints, fps=motion.fps)
    return np.concatenate([stream.push(motion), stream.finish()]), stream.outside


def _tell_faults(name: str, joints: Sequence[RobotJoint], channels: Mapping[str, str], outside: Sequence[str]) -> None:
    """Print on standard error, also with --quiet, what may be wrong with a URDF or a map."""
    for text in (*_check_ranges(joints), *_check_channels(joints, channels)):
        typer.echo(text, err=True)
    if outside:
        typer.echo(f"outside the limits all the time in {name}: {', '.join(outside)}", err=True)


def _tell_what_stays(
    robot: str, name: str, channels: Mapping[str, str], joints: Sequence[RobotJoint], commands: Array, outside: Sequence[str]
) -> None:
    """Print on standard error which joints do not move, and why."""
    from ..motion.robot import list_followers, list_joints

    followers = list_followers(robot) if _is_urdf(robot) else {}
    for leader in dict.fromkeys(followers.values()):
        typer.echo(f"follows {leader}: {', '.join(name for name in followers if followers[name] == leader)}", err=True)
    omissions = {joint for joint, what in channels.items() if not what}
    others = set(list_joints(robot)) - {joint.name for joint in joints} - omissions if _is_urdf(robot) else set()
    if others:
        typer.echo(f"not moved: {', '.join(sorted(others))} (--map FILE.toml says what they take)", err=True)
    still = [
        joint.name
        for joint, course in zip(joints, commands.T, strict=True)
        if joint.name not in outside and (course == course[0]).all()
    ]
    if still:
        typer.echo(f"without movement in {name}: {', '.join(still)}", err=True)


def _check_ranges(joints: Sequence[RobotJoint]) -> list[str]:
    """Messages about limits that are too wide to have an effect. One joint may exceed a whole turn; several hardly do."""
    turning = [joint for joint in joints if not joint.is_hand]
    wide = [joint.name for joint in turning if (span := joint.upper - joint.lower) > _TURN and abs(span - _FREE) > 0.01]
    loose = [
        joint.name
        for joint in turning
        if joint.upper - joint.lower > _WIDE or joint.velocity > _FAST or (len(wide) >= _SEVERAL and joint.name in wide)
    ]
    return [f"limits that do not limit: {', '.join(loose)} (a URDF counts in radians, not in degrees)"] if loose else []


def _check_channels(joints: Sequence[RobotJoint], channels: Mapping[str, str]) -> list[str]:
    """Messages about angles that several joints take, and about offsets of more than a whole turn."""
    messages, takers = [], dict[str, list[str]]()
    for joint in joints:
        takers.setdefault(joint.channel, []).append(joint.name)
    messages += [f"several joints take {what}: {', '.join(names)}" for what, names in takers.items() if len(names) > 1]
    far = [joint.name for joint in joints if joint.name in channels and abs(joint.offset) > _TURN]
    return messages + ([f"offsets of more than a turn: {', '.join(far)} (are they in radians?)"] if far else [])


def _say_angle(joint: RobotJoint) -> str:
    """The angle that a joint takes, written as in a map."""
    offset = f"{joint.offset:+.4g}" if joint.offset else ""
    return f"{'-' * (joint.sign < 0)}{joint.channel}{offset}"


def _read_motion(path: Path, options: Mapping[str, Any], bones: Mapping[str, str] | None) -> Motion:
    """Read the motion of a motion file; raise an InputError for an option that only speech uses."""
    from ..convert import read_as_humanoid

    for name, value in options.items():
        if value != _OF_SPEECH[name]:
            raise InputError(f"--{name} changes nothing for {str(path)!r}", "it is for a sound file")
    return read_as_humanoid(path, bones)


def _generate_motion(path: Path, options: Mapping[str, Any], fps: float, quiet: bool) -> Motion:
    """Generate the motion of body and hands for a sound file."""
    from ..export import load
    from ..files import scratch, workplace
    from ..generate import generate_files

    with workplace(scratch()) as folder, show_progress("generating", quiet) as progress:
        file = folder / "motion.npz"
        generate_files(path, [file], fps=fps, parts=("body", "hands"), progress=progress, **options)
        return load(file)


def _read_map(path: Path) -> dict[str, Any]:
    """The tables of a map: ``joints``, joint → what it takes; ``limits``, joint → limits; ``bones``, our name → joint."""
    from ..errors import nearest
    from ..files import parse_toml, read_regular
    from ..motion.bone_mapping import load_map

    table = parse_toml(read_regular(path, "a map", 1 << 20), path.name, "[joints]")
    for name, rows in table.items():
        if name == "bones":
            table[name] = load_map(path)
            continue
        if name not in _TABLES:
            raise InputError(f"{path.name!r} has a table [{name[:40]}]", nearest(name, (*_TABLES, "bones")))
        inner, problem, hint = _TABLES[name]
        if not isinstance(rows, dict) or not all(isinstance(value, inner) for value in rows.values()):
            raise InputError(f"{path.name!r} has a table [{name}] that holds not only {problem}", hint)
    if not table:
        hint = 'such as [joints] arm_1 = "left_elbow"'
        raise InputError(f"{path.name!r} has no table [joints] or [limits.JOINT] or [bones]", hint)
    return table


_TABLES = {
    "joints": (str, "texts", 'arm_1 = "left_shoulder_pitch"'),
    "limits": (dict, "tables", "write [limits.arm_1] and velocity = 1.5 below it"),
}
"""Table of a map → the type of its values, the name of the type in messages, and a hint."""
