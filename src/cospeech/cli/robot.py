"""``cospeech robot``: speech, or a motion file, as commands for the joints of a robot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument

from ..errors import InputError
from ..models import DEFAULT
from .options import Debug, Emotion, Intensity, Model, Quiet, Seed, Style, Transcript, number, option
from .progress import show_progress

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..motion.motion import Motion

__all__ = ["register"]

Source = Annotated[Path, Argument(metavar="SPEECH|MOTION", help="Sound file, or motion file (talk.bvh).")]
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

_OF_SPEECH = {"model": DEFAULT, "style": None, "emotion": "auto", "transcript": None, "seed": 0, "intensity": 1.0}
"""Options that change nothing for a motion file, and what they are where not given."""


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(robot)


def robot(
    source: Source, target: Trajectory, robot: Robot = "nao", channels: Channels = None, fps: Rate = 50.0,
    model: Model = DEFAULT, style: Style = None, emotion: Emotion = "auto", transcript: Transcript = None, seed: Seed = 0,
    intensity: Intensity = 1.0, quiet: Quiet = False, debug: Debug = False,
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
    from ..motion.robot import check_trajectory_file, find_robot, list_joints, read_urdf, robot_trajectory, save_trajectory
    from ..rules.options import FPS_RANGE, check_range

    check_range("fps", fps, FPS_RANGE)
    check_trajectory_file(target)
    suffix = Path(robot).suffix.lower()
    is_urdf = suffix in (".urdf", ".xml")
    if suffix == ".xacro":
        raise InputError(f"{robot!r} is no URDF yet", f"xacro {robot} > {Path(robot).stem.removesuffix('.urdf')}.urdf makes it")
    given = [path for path in (channels, transcript) if path]
    check_apart([target], [source, *([Path(robot)] if is_urdf else []), *given])
    if channels is not None and not is_urdf:
        raise InputError(f"--map changes nothing for {robot!r}", "it is for a URDF")
    table = None if channels is None else _read_map(channels)
    joints = read_urdf(robot, table) if is_urdf else find_robot(robot)
    options = {
        "model": model,
        "style": style,
        "emotion": emotion,
        "transcript": transcript,
        "seed": seed,
        "intensity": intensity,
    }
    kind = source.suffix.lower()
    is_motion = str(source) == "-" or source.is_dir() or (kind in FORMATS and kind != ".mp4")  # a video has speech
    motion = _read_motion(source, options) if is_motion else _generate_motion(source, options, fps, quiet)
    commands = robot_trajectory(motion.resample(fps), joints)
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


def _read_motion(path: Path, options: Mapping[str, Any]) -> Motion:
    """Of a motion file, where the options of speech change nothing."""
    from ..export import load

    for name, value in options.items():
        if value != _OF_SPEECH[name]:
            raise InputError(f"--{name} changes nothing for {str(path)!r}", "it is for a sound file")
    return load(path)


def _generate_motion(path: Path, options: Mapping[str, Any], fps: float, quiet: bool) -> Motion:
    """Of a sound file: body and hands."""
    from ..export import load
    from ..files import scratch, workplace
    from ..generate import generate_files

    with workplace(scratch()) as folder, show_progress("generating", quiet) as progress:
        made = folder / "motion.npz"
        generate_files(path, [made], fps=fps, parts=("body", "hands"), progress=progress, **options)
        return load(made)


def _read_map(path: Path) -> dict[str, str]:
    """Joint → what it takes, of a map."""
    from ..files import parse_toml, read_regular

    table = parse_toml(read_regular(path, "a map", 1 << 20), path.name, "[joints]").get("joints")
    if not isinstance(table, dict) or not all(isinstance(value, str) for value in table.values()):
        raise InputError(f"{path.name!r} has no table [joints] of texts", 'write [joints] and arm_1 = "left_shoulder_pitch"')
    return table
