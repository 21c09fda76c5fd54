"""``cospeech robot``: a motion file as commands for the joints of a robot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument

from ..errors import InputError
from .options import Debug, Motion, Quiet, number, option

__all__ = ["register"]

Trajectory = Annotated[
    Path,
    Argument(metavar="FILE", help="File to write: .csv (a column for each joint), .json (the shape of ROS' JointTrajectory)."),
]
Robot = Annotated[str, option("--robot", metavar="NAME", help="nao, pepper, reachy, or the URDF of yours: my_robot.urdf.")]
Channels = Annotated[
    Path | None,
    option(
        "--map",
        metavar="FILE",
        help='TOML file with a table [joints]: joint of the URDF = "left_elbow", or "-left_elbow+0.5"; "" leaves it out.',
    ),
]
Rate = Annotated[float, option("--fps", metavar="NUMBER", parser=number, help="Commands per second, 1 … 240.")]


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(robot)


def robot(
    source: Motion,
    target: Trajectory,
    robot: Robot = "nao",
    channels: Channels = None,
    fps: Rate = 50.0,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Turn a motion file into commands for a robot.

    Commands stay within the limits of position, speed and acceleration of its joints.

    \b
    cospeech robot talk.bvh talk.csv --robot pepper
    cospeech robot talk.bvh talk.json --robot nao --fps 100
    """
    from ..export import load
    from ..export.checks import check_apart
    from ..motion.robot import find_robot, list_joints, read_urdf, robot_trajectory, save_trajectory
    from ..rules.options import FPS_RANGE, check_range

    check_range("fps", fps, FPS_RANGE)
    suffix = Path(robot).suffix.lower()
    is_urdf = suffix in (".urdf", ".xml")
    if suffix == ".xacro":
        raise InputError(f"{robot!r} is no URDF yet", f"xacro {robot} > {Path(robot).stem.removesuffix('.urdf')}.urdf makes it")
    check_apart([target], [source, *([Path(robot)] if is_urdf else []), *([channels] if channels else [])])
    if channels is not None and not is_urdf:
        raise InputError(f"--map changes nothing for {robot!r}", "it is for a URDF")
    table = None if channels is None else _read_map(channels)
    joints = read_urdf(robot, table) if is_urdf else find_robot(robot)
    commands = robot_trajectory(load(source).resample(fps), joints)
    save_trajectory(target, commands, joints, fps=fps)
    if not quiet:
        count = "1 joint" if len(joints) == 1 else f"{len(joints)} joints"
        typer.echo(f"{target}  {len(commands)} commands for {count} at {fps:g} per second")
        others = sorted(set(list_joints(robot)) - {joint.name for joint in joints}) if is_urdf else []
        if others:
            typer.echo(f"not moved: {', '.join(others)} (--map FILE.toml says what they take)", err=True)
        still = [joint.name for joint, course in zip(joints, commands.T, strict=True) if (course == course[0]).all()]
        if still:
            typer.echo(f"without movement in {source.name}: {', '.join(still)}", err=True)


def _read_map(path: Path) -> dict[str, str]:
    """Joint → what it takes, of a map."""
    from ..files import parse_toml, read_regular

    table = parse_toml(read_regular(path, "a map", 1 << 20), path.name, "[joints]").get("joints")
    if not isinstance(table, dict) or not all(isinstance(value, str) for value in table.values()):
        raise InputError(f"{path.name!r} has no table [joints] of texts", 'write [joints] and arm_1 = "left_shoulder_pitch"')
    return table
