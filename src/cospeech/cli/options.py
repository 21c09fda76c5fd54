"""Arguments and options of the command line, each with its help text."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Argument, Option

from ..errors import InputError
from ..export.registry import FORMATS
from ..motion.named_numbers import read_seconds

__all__ = [
    "NAME",
    "Audio", "Avatar", "Clip", "Continue", "Debug", "Drawn", "Emotion", "Face", "FaceGain", "Folder", "Fps", "Intensity",
    "Jobs", "Json", "Language", "Map", "Model", "Motions", "NewFps", "Output", "Parts", "Picture", "Port", "Quiet",
    "ReportFile", "Resume", "Retarget", "RigMap", "Seed", "Skeleton", "Speaker", "Style", "Tail", "Takes", "Temperature",
    "Transcribe", "Transcript",
    "View", "check_idle", "number", "option", "rate", "seconds", "whole",
]  # fmt: skip


NAME = "{name}"
"""Placeholder in names of files, for the name of a speech, of a motion or of a person."""
_READABLE = [suffix for suffix, entry in FORMATS.ours.items() if entry.readable]


def option(*flags: str, help: str, metavar: str | None = None, parser: Callable[[str], Any] | None = None) -> Any:
    return Option(*flags, help=help, metavar=metavar, parser=parser)


def number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not a number") from None


def seconds(text: str, full_text: str = "") -> float:
    """A time: 2230, 37:10, 0:37:10.5 or 37m10s. ``full_text``: what an error names, if it is not the text."""
    try:
        return read_seconds(text, f"{full_text or text!r} is not a number of seconds", "")
    except InputError as error:
        raise typer.BadParameter(f"{error.problem}, such as 2230, or a time, such as 37:10 or 37m10s") from None


def rate(text: str | float) -> float:
    """Frames per second: 29.97, or the fraction 30000/1001. A default value is a number already."""
    above, slash, below = str(text).partition("/")
    try:
        return float(above) / float(below) if slash else float(above)
    except (ValueError, ZeroDivisionError):
        raise typer.BadParameter(f"{text!r} is not a number") from None


def whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not a whole number") from None


def check_idle(context: typer.Context, names: Collection[str], where: str) -> None:
    """Check that none of these options is given, because they would change nothing.

    Args:
        context: of the command.
        names: of its parameters.
        where: the reason, as the message says it behind the option: ``beside a sound file``.

    Raises:
        InputError: one is given.
    """
    for parameter in context.command.params:
        if parameter.name in names and str(context.get_parameter_source(parameter.name)).endswith("COMMANDLINE"):
            raise InputError(f"{parameter.opts[0]} {where}", "it would change nothing; leave it out")


Audio = Annotated[
    list[str],
    Argument(
        metavar="SPEECH",
        help="Sound files (WAV, FLAC, OGG, MP3, AIFF; with the extra `av` also M4A, AAC, WebM and video, such as MP4 and MOV), "
        "folders of sound files, patterns ('talks/*.wav', 'talks/**/*.wav'), or - for standard input. A folder includes the "
        "folders in it; {name} then has their names in it.",
    ),
]
Motions = Annotated[
    list[Path],
    Argument(
        metavar="MOTION",
        help=f"Motion file to read: {' '.join(_READABLE)}. Or several, folders of them, or patterns ('takes/*.bvh'). "
        "A folder includes the folders in it. If files have the same name and different suffixes, only one is read, with its "
        "face if it has one.",
    ),
]
Output = Annotated[
    list[str] | None,
    option(
        "--output",
        "-o",
        metavar="FILE",
        help="File to write. The suffix chooses the format. Repeat the option for several files. For several speeches, "
        "name a folder, out/, or write {name} for the name of the speech: out/{name}.vrma. Without this option, the program "
        "writes a .bvh and a .glb with the name of the speech into this folder; it replaces no file that is there.",
    ),
]
Model = Annotated[
    str,
    option(
        "--model",
        metavar="MODEL",
        help="A name that `cospeech list models` prints, a bundle (NAME.cospeech), or the folder of a run.",
    ),
]
Style = Annotated[
    str | None,
    option(
        "--style",
        metavar="STYLE",
        help="A name that `cospeech list styles` prints, or a mixture: calm:0.7,lively:0.3. Some trained models also take "
        "an example of motion: clip.bvh. Each model has a default style.",
    ),
]
Emotion = Annotated[
    str,
    option(
        "--emotion",
        metavar="NAME|FILE",
        help="auto (follows the voice), neutral, happiness, anger, sadness, contempt, surprise, fear or disgust; "
        "or a .csv file with the emotion over time.",
    ),
]
Speaker = Annotated[
    str | None, option("--speaker", metavar="NAME", help="Name of a speaker. For `rules`, speakers are styles.")
]
Transcript = Annotated[
    str | None,
    option(
        "--transcript",
        metavar="FILE",
        help="Words of the speech: .srt, .vtt, .sbv, .ttml, .lrc, .TextGrid, .eaf, .tsv, .csv, .json, or .txt without times. "
        "For several speeches, write {name} for the name of the speech: words/{name}.srt.",
    ),
]
Language = Annotated[
    str,
    option(
        "--language",
        metavar="CODE",
        help="Language of the words: de, fr, ja and so on. Without it, the program finds the language of a transcript; it "
        "reads live words in Latin letters as English.",
    ),
]
Transcribe = Annotated[
    bool, option("--transcribe", help="Recognise the words with faster-whisper (extra `asr`) instead of reading a transcript.")
]
Seed = Annotated[
    int,
    option(
        "--seed",
        metavar="NUMBER",
        parser=whole,
        help="Seed of the random choices. The same seed gives the same files. Another seed gives another motion.",
    ),
]
Takes = Annotated[
    int, option("--takes", metavar="NUMBER", parser=whole, help="Number of takes, written as talk.1.bvh, talk.2.bvh …")
]
Temperature = Annotated[
    float,
    option("--temperature", metavar="NUMBER", parser=number, help="Size of the random variation, 0 (least) … 2 (most)."),
]
Intensity = Annotated[float, option("--intensity", metavar="NUMBER", parser=number, help="Size of the movements, 0 … 2.")]
FaceGain = Annotated[
    str,
    option(
        "--face-gain",
        metavar="GAINS",
        help="Strength of the mouth, 0 … 2, or of channels with ARKit's names: 1.2,jawOpen:0.8,mouthSmile:0.5.",
    ),
]
Face = Annotated[
    str | None,
    option(
        "--face",
        metavar="FILE",
        help="Motion of a face (.json, .csv, .glb). It replaces the model's own face, and body and hands follow it. "
        "Only some models take it, such as chain-of-generation.",
    ),
]
Continue = Annotated[
    str | None,
    option(
        "--continue",
        metavar="FILE",
        help="Motion file to continue from, so that two clips join. Only some models take it, such as chain-of-generation.",
    ),
]
Parts = Annotated[
    str,
    option(
        "--parts",
        metavar="LIST",
        help="Parts that move, separated by commas; the rest stays neutral. Arms belong to the body, fingers to the hands.",
    ),
]
_RIG = "a name (`cospeech list skeletons`) or your rig: a .bvh, .glb, .vrm or .fbx file."
Skeleton = Annotated[str, option("--skeleton", metavar="NAME|FILE", help=f"Skeleton of .bvh files: {_RIG}")]
Retarget = Annotated[str | None, option("--skeleton", metavar="NAME|FILE", help=f"Retarget to this skeleton: {_RIG}")]
Map = Annotated[
    Path | None,
    option(
        "--map",
        metavar="FILE",
        help="TOML file that gives our names to the joints of MOTION, of the avatar or of the rig.",
    ),
]
RigMap = Annotated[
    Path | None,
    option(
        "--map",
        metavar="FILE",
        help="TOML file that gives our names to the joints of the rig (--skeleton) or of the avatar.",
    ),
]
Tail = Annotated[
    float,
    option(
        "--tail",
        metavar="SECONDS",
        parser=number,
        help="Add silence after the speech, 0 … 60 seconds, in which the hands come down. 3 seconds are enough.",
    ),
]
Fps = Annotated[float, option("--fps", metavar="NUMBER", parser=rate, help="Frames per second, 1 … 240: 24, or 30000/1001.")]
NewFps = Annotated[
    float | None, option("--fps", metavar="NUMBER", parser=rate, help="Resample to this many frames per second.")
]
Avatar = Annotated[
    Path | None,
    option(
        "--avatar",
        metavar="FILE",
        help="Your character, instead of our mannequin: VRM, GLB or FBX for .glb files and pictures, FBX for .fbx files.",
    ),
]
Clip = Annotated[
    str | None,
    option("--clip", metavar="NAME|NUMBER", help="Which animation of a .glb file that has several: name, or number from 0."),
]
Picture = Annotated[
    Path,
    Argument(
        metavar="PICTURE", help="Picture to write, here or after -o: .mp4 (video), .gif (animation) or .png (strip of frames)."
    ),
]
View = Annotated[
    str | None, option("--camera", metavar="NAME", help="body (the default of videos), full (of .png), face or hands.")
]
Drawn = Annotated[
    Path | None,
    option(
        "--audio",
        metavar="SPEECH",
        help="Speech that plays with the video (.mp4) or is drawn below (.png). It may have {name} in it.",
    ),
]
ReportFile = Annotated[
    Path | None, option("--report", metavar="FILE", help="Write a report as JSON: model, style, emotion, files, speed.")
]
Folder = Annotated[Path, option("--to", metavar="FOLDER", help="Folder for the files. It is made if it is missing.")]
Jobs = Annotated[
    int, option("--jobs", metavar="NUMBER", parser=whole, help="How many speeches are generated at the same time, 1 … 64.")
]
Resume = Annotated[
    bool,
    Option(
        "--resume",
        help="Leave out speeches whose files are all there, and newer than the speech: after an interruption, run the same "
        "command with --resume. It does not notice other options than before.",
    ),
]
Json = Annotated[bool, option("--json", help="Print JSON, for programs.")]
Port = Annotated[int, option("--port", metavar="NUMBER", parser=whole, help="Port, 0 for any that is free.")]
Debug = Annotated[bool, option("--debug", help="Show the traceback of an error.")]
Quiet = Annotated[bool, option("--quiet", "-q", help="Print no progress bar and no list of files.")]
