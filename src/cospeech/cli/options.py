"""Arguments and options of the command line, each with the words that ``--help`` has for it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from typer import Argument, Option

from ..export.registry import FORMATS

__all__ = [
    "Audio", "Avatar", "Continue", "Debug", "Drawn", "Emotion", "Face", "FaceGain", "Folder", "Fps", "Intensity", "Json", "Map",
    "Model", "Motion", "NewFps", "Output", "Parts", "Quiet", "ReportFile", "Retarget", "Seed", "Skeleton", "Speaker", "Style",
    "Takes", "Temperature", "Transcribe", "Transcript", "View", "number", "option", "whole",
]  # fmt: skip


_READABLE = [suffix for suffix, entry in FORMATS.ours.items() if entry.readable]


def option(*flags: str, help: str, metavar: str | None = None, parser: Callable[[str], Any] | None = None) -> Any:
    return Option(*flags, help=help, metavar=metavar, parser=parser)


def number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not a number") from None


def whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not a whole number") from None


Audio = Annotated[
    list[str],
    Argument(
        metavar="SPEECH",
        help="Sound files: WAV, FLAC, OGG, MP3, AIFF; with the extra `av` also M4A, WebM, video. "
        "Or folders of them; or - for standard input.",
    ),
]
Motion = Annotated[Path, Argument(metavar="MOTION", help=f"Motion file to read: {' '.join(_READABLE)}.")]
Output = Annotated[
    list[str] | None,
    option(
        "--output",
        "-o",
        metavar="FILE",
        help="File to write, the suffix picks the format; may be given several times. Of several speeches: out/ or "
        "out/{name}.vrma. Without it: SPEECH's name with .bvh and with .glb, in this folder.",
    ),
]
Model = Annotated[str, option("--model", metavar="MODEL", help="Of `cospeech list models`; or a NAME.cospeech, or a run.")]
Style = Annotated[
    str | None,
    option(
        "--style",
        metavar="STYLE",
        help="See `cospeech list styles`; mixed: calm:0.7,lively:0.3. Trained models follow a motion, too: clip.bvh.",
    ),
]
Emotion = Annotated[
    str,
    option(
        "--emotion",
        metavar="NAME|FILE",
        help="auto (larger and quicker where the voice is aroused), neutral, happiness, anger, sadness, contempt, surprise, "
        "fear or disgust; or a .csv of how it changes.",
    ),
]
Speaker = Annotated[str | None, option("--speaker", metavar="NAME", help="A speaker by name; for `rules` the same as a style.")]
Transcript = Annotated[
    str | None,
    option(
        "--transcript",
        metavar="FILE",
        help="What is said: .TextGrid .tsv .srt .json, or .txt without times; of several speeches: {name}.srt.",
    ),
]
Transcribe = Annotated[
    bool, option("--transcribe", help="Hear the words with faster-whisper (cospeech[asr]) instead of reading them.")
]
Seed = Annotated[
    int,
    option("--seed", metavar="NUMBER", parser=whole, help="Another seed, another performance; the same seed, the same bytes."),
]
Takes = Annotated[int, option("--takes", metavar="NUMBER", parser=whole, help="Write so many takes: talk.1.bvh, talk.2.bvh …")]
Temperature = Annotated[
    float, option("--temperature", metavar="NUMBER", parser=number, help="How far choices stray from the likeliest, 0 … 2.")
]
Intensity = Annotated[float, option("--intensity", metavar="NUMBER", parser=number, help="Size of the motion, 0 … 2.")]
FaceGain = Annotated[
    str,
    option(
        "--face-gain",
        metavar="GAINS",
        help="How strong the mouth is, 0 … 2, or channels are: 1.2,jawOpen:0.8,mouthSmile:0.5 (names of ARKit).",
    ),
]
Face = Annotated[
    str | None, option("--face", metavar="FILE", help="A face that moves body and hands, for chains: .json .csv .glb.")
]
Continue = Annotated[
    str | None, option("--continue", metavar="FILE", help="Motion that it goes on from, for chains, so that clips join.")
]
Parts = Annotated[str, option("--parts", metavar="LIST", help="What moves.")]
Skeleton = Annotated[str, option("--skeleton", metavar="NAME", help="Of .bvh files; see `cospeech list skeletons`.")]
Retarget = Annotated[str | None, option("--skeleton", metavar="NAME", help="Retarget; see `cospeech list skeletons`.")]
Map = Annotated[
    Path | None,
    option("--map", metavar="FILE", help="TOML: which joint of MOTION is which of ours, where that is not recognised."),
]
Fps = Annotated[float, option("--fps", metavar="NUMBER", parser=number, help="Frames per second, 1 … 240.")]
NewFps = Annotated[float | None, option("--fps", metavar="NUMBER", parser=number, help="Resample to this rate.")]
Avatar = Annotated[Path | None, option("--avatar", metavar="FILE", help="In .glb: this VRM or GLB character for ours.")]
View = Annotated[str | None, option("--camera", metavar="NAME", help="body (the default), full, face or hands.")]
Drawn = Annotated[Path | None, option("--audio", metavar="SPEECH", help="Speech to hear (.mp4) or to draw (.png).")]
ReportFile = Annotated[Path | None, option("--report", metavar="FILE", help="Write facts of the run as JSON.")]
Folder = Annotated[Path, option("--to", metavar="FOLDER", help="Where the files go; made where it is missing.")]
Json = Annotated[bool, option("--json", help="As JSON, for programs.")]
Debug = Annotated[bool, option("--debug", help="Show the traceback of an error.")]
Quiet = Annotated[bool, option("--quiet", "-q", help="No progress bar, no list of files.")]
