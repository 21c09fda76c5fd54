"""``cospeech convert`` and ``cospeech render``: motion files to other motion files, and to pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from ..errors import InputError, say_count
from .last_output import LastOutputCommand
from .options import Avatar, Clip, Debug, Drawn, Map, Motions, NewFps, Picture, Quiet, Retarget, View, number, option, seconds

__all__ = ["register"]

From = Annotated[
    float | None,
    option(
        "--from", metavar="TIME", parser=seconds, help="Leave out what comes before this time of MOTION: 40 (seconds), 37:10."
    ),
]
To = Annotated[float | None, option("--to", metavar="TIME", parser=seconds, help="Leave out what comes from this time on.")]
Join = Annotated[
    list[Path] | None,
    option("--join", metavar="FILE", help="Motion that goes on after MOTION. Repeat the option for several."),
]
Mirror = Annotated[bool, Option("--mirror", help="Exchange left and right.")]
Loop = Annotated[bool, Option("--loop", help="Lead the end into the beginning, so that the motion can be repeated.")]
OtherFace = Annotated[
    Path | None,
    option("--face", metavar="FILE", help="Motion (.json, .csv, .glb, .vrma) whose face replaces MOTION's."),
]
Blend = Annotated[
    float | None,
    option(
        "--blend",
        metavar="SECONDS",
        parser=number,
        help="Length of the transitions of --join and --loop, 0 … 10. Without it: 0.4, or more if the poses are far apart.",
    ),
]


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.command(cls=LastOutputCommand)(convert)
    app.command(cls=LastOutputCommand)(render)


def convert(
    sources: Motions,
    target: Annotated[
        Path,
        Argument(
            metavar="FILE",
            help="File to write, here or after -o. The suffix chooses the format. {name} stands for the name of the motion: "
            "out/{name}.glb.",
        ),
    ],
    skeleton: Retarget = None,
    fps: NewFps = None,
    names: Map = None,
    avatar: Avatar = None,
    clip: Clip = None,
    start: From = None,
    end: To = None,
    continuations: Join = None,
    mirror: Mirror = False,
    loop: Loop = False,
    face: OtherFace = None,
    blend: Blend = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Convert motion files to another format, and edit them.

    Edits happen in this order: --join, --from and --to, --face, --mirror, --loop, --skeleton, --fps.

    \b
    cospeech convert talk.bvh talk.vrma
    cospeech convert talk.bvh for_mixamo.bvh --skeleton mixamo
    cospeech convert talk.glb middle.glb --from 0.5 --to 1.5 --loop
    cospeech convert talk.glb both.glb --join other.glb --blend 0.6
    cospeech convert takes/*.bvh "out/{name}.glb"
    """
    from ..convert import Edits, convert_file
    from ..export import format_of
    from .several import MotionFile, convert_each, find_motions

    edits = Edits(
        continuations=tuple(continuations or ()), start=start, end=end, face=face, mirror=mirror, loop=loop, blend=blend
    )

    def write(file: MotionFile) -> None:
        motion = convert_file(
            file.source, file.target, skeleton=skeleton, fps=fps, names=names, avatar=avatar, clip=clip, edits=edits
        )
        if not quiet:
            frames = say_count(len(motion), "frame")
            typer.echo(f"{file.target}  {frames} at {motion.fps:g} fps  ({format_of(file.target).opens})")

    convert_each(find_motions(sources, target), write)


def render(
    sources: Motions,
    target: Picture,
    audio: Drawn = None,
    camera: View = None,
    avatar: Avatar = None,
    names: Map = None,
    clip: Clip = None,
    start: From = None,
    end: To = None,
    quiet: Quiet = False,
    debug: Debug = False,
) -> None:
    """Draw motion files as videos, .gif or strips of frames.

    \b
    cospeech render talk.glb talk.mp4 --audio talk.wav
    cospeech render talk.glb part.mp4 --audio talk.wav --from 40 --to 50
    cospeech render takes/*.glb "out/{name}.mp4" --audio "talks/{name}.wav"
    """
    from ..convert import Edits, convert_file
    from ..export import FORMATS, format_of
    from ..export.registry import suffixes
    from .several import MotionFile, convert_each, find_motions, put_name

    suffix = target.suffix.lower()
    if suffix not in FORMATS or not FORMATS[suffix].picture:
        pictures = " ".join(sorted(suffixes(lambda entry: entry.picture)))
        raise InputError(f"{str(target)!r} is not a picture", f"known: {pictures}; for others use `cospeech convert`")
    edits = Edits(start=start, end=end)

    def draw(file: MotionFile) -> None:
        sound = None if audio is None else Path(put_name(str(audio), file.name))
        convert_file(file.source, file.target, audio=sound, camera=camera, avatar=avatar, names=names, clip=clip, edits=edits)
        if not quiet:
            typer.echo(f"{file.target}  ({format_of(file.target).opens})")

    convert_each(find_motions(sources, target), draw)
