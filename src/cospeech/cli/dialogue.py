"""``cospeech dialogue``: two people in conversation, each a character that talks and listens."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument

from ..errors import InputError
from ..models import DEFAULT, PARTS
from .options import Debug, Fps, Parts, Quiet, ReportFile, Seed, Skeleton, Tail, number, option
from .progress import show_progress
from .several import NAME

if TYPE_CHECKING:
    from ..audio.conversation import VoiceTrack

__all__ = ["register"]

Sounds = Annotated[
    list[Path],
    Argument(
        metavar="SPEECH",
        help="Two sound files of one conversation, with one person each, that begin at the same moment; or one stereo file "
        "with one person on each channel.",
    ),
]
Outputs = Annotated[
    list[str] | None,
    option(
        "--output",
        "-o",
        metavar="FILE",
        help=f"File to write, with {NAME} in it: out/{NAME}.vrma. {NAME} is the name of the sound file; of a stereo file, that "
        "name with .left and .right. Repeat the option for several formats. Without it, the program writes a .bvh and a .glb "
        "of each person into this folder, but over no file that is there.",
    ),
]
_EACH = "Give it once for both, or twice: first for the first person."
Models = Annotated[list[str] | None, option("--model", metavar="MODEL", help=f"See `cospeech generate`. {_EACH}")]
Styles = Annotated[list[str] | None, option("--style", metavar="STYLE", help=f"See `cospeech generate`. {_EACH}")]
Emotions = Annotated[list[str] | None, option("--emotion", metavar="NAME|FILE", help=f"See `cospeech generate`. {_EACH}")]
Intensities = Annotated[
    list[float] | None, option("--intensity", metavar="NUMBER", parser=number, help=f"Size of the movements, 0 … 2. {_EACH}")
]
Transcripts = Annotated[
    list[str] | None,
    option("--transcript", metavar="FILE", help=f"Words of each person, or one name with {NAME} in it: words/{NAME}.srt."),
]
Languages = Annotated[list[str] | None, option("--language", metavar="CODE", help=f"Language of the words. {_EACH}")]
Avatars = Annotated[
    list[str] | None,
    option("--avatar", metavar="FILE", help=f"VRM, GLB or FBX character in place of our mannequin. {_EACH}"),
]
Angle = Annotated[
    float,
    option(
        "--angle",
        metavar="DEGREES",
        parser=number,
        help="0: they face each other. 30: each is turned 30 degrees away from the other one, as on a stage; the first person "
        "has the second one on the left. 0 … 60.",
    ),
]

_ALL_PARTS = ",".join(PARTS)
_SIDES = ("left", "right")
_MOST_ANGLE = 60.0  # degrees, see `cospeech.runtime.listening.ANGLE_RANGE`
_USUAL = (f"{NAME}.bvh", f"{NAME}.glb")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(dialogue)


def dialogue(
    speech: Sounds, output: Outputs = None, model: Models = None, style: Styles = None, emotion: Emotions = None,
    intensity: Intensities = None, transcript: Transcripts = None, language: Languages = None, avatar: Avatars = None,
    angle: Angle = 0.0, seed: Seed = 0, parts: Parts = _ALL_PARTS, skeleton: Skeleton = "humanoid", fps: Fps = 30.0,
    tail: Tail = 0.0, report: ReportFile = None, quiet: Quiet = False, debug: Debug = False,
) -> None:  # fmt: skip
    """Generate two characters that talk to each other.

    Each one gestures while it speaks. While the other one speaks, it listens: it nods where the other one pauses or lowers the
    voice, smiles now and then, and looks at the other one. Sound of the other person in a microphone is left out.

    \b
    cospeech dialogue host.wav guest.wav -o '{name}.glb'
    cospeech dialogue call.wav -o 'out/{name}.vrma' --style calm --style lively
    cospeech dialogue host.wav guest.wav -o '{name}.bvh' --transcript 'words/{name}.srt' --angle 30
    """
    from ..audio.conversation import hear_conversation
    from ..export import format_of
    from ..files import all_or_none, atomic, check_destination, make_folders
    from ..generate import generate_files
    from ..runtime.listening import DialogueRole
    from ..runtime.report import Reports
    from .main import show_outputs

    if not 0 <= angle <= _MOST_ANGLE:
        raise InputError(f"an angle of {angle:g} degrees", f"0 … {_MOST_ANGLE:g}; for more, turn the characters themselves")
    tracks, names = _find_tracks(speech)
    files = [_outputs_of(name, output) for name in names]
    own = [
        {
            "model": _pick("--model", model, k, DEFAULT), "style": _pick("--style", style, k, None),
            "emotion": _pick("--emotion", emotion, k, "auto"), "intensity": _pick("--intensity", intensity, k, 1.0),
            "language": _pick("--language", language, k, ""), "avatar": _pick("--avatar", avatar, k, None) or None,
            "transcript": _pick_transcript(transcript, names, k),
        }
        for k in range(2)
    ]  # fmt: skip
    _check_apart(tracks, files, own, report)
    for path in (path for each in files for path in each):
        format_of(path)
    if report is not None:
        check_destination(report)
    shared: dict[str, Any] = {
        "parts": [part.strip() for part in parts.split(",") if part.strip()], "skeleton": skeleton, "fps": fps, "tail": tail
    }  # fmt: skip
    with show_progress("generating", quiet) as progress:
        heard = hear_conversation(*tracks).speakers
        every, made = [path for each in files for path in each], []
        with make_folders({path.parent for path in every}), all_or_none(every) as place:
            for k, track in enumerate(tracks):
                role = DialogueRole(heard[k], heard[1 - k], angle if k == 0 else -angle)
                tell = None if progress is None else _tell(progress, names[k])
                staged = [place(path) for path in files[k]]
                found = generate_files(track.path, staged, seed=seed + k, role=role, progress=tell, **shared, **own[k])
                made.append(replace(found, speech=names[k], outputs=[str(path) for path in files[k]]))
        result = Reports(speeches=made, failed=[])
    if report is not None:
        with atomic(report) as path:
            path.write_text(result.to_json(), "utf-8")
    if not quiet:
        show_outputs(result.speeches)


def _tell(progress: Any, name: str) -> Any:
    return lambda done, total: progress(done, total, name)


def _find_tracks(speech: Sequence[Path]) -> tuple[list[VoiceTrack], list[str]]:
    """Where both voices are, and what the persons are called.

    Raises:
        InputError: there are not two voices.
    """
    from ..audio.conversation import VoiceTrack
    from ..audio.speech import SpeechSource

    if len(speech) > 2:
        raise InputError(f"{len(speech)} sound files", "two, with one person each, or one stereo file")
    if len(speech) == 2:
        names = [path.stem for path in speech]
        if names[0] == names[1]:
            parents = [path.absolute().parent.name for path in speech]
            names = [f"{parent}.{name}" for parent, name in zip(parents, names, strict=True)]
        if names[0] == names[1]:
            raise InputError(f"both sound files are called {speech[0].name!r}", "files of different names")
        return [VoiceTrack(path) for path in speech], names
    with SpeechSource(speech[0]) as source:
        channels = source.channels
    if channels != 2:
        hint = "two sound files with one person each, or one stereo file with one person on each channel"
        raise InputError(f"{str(speech[0])!r} has {'one channel' if channels == 1 else f'{channels} channels'}", hint)
    return [VoiceTrack(speech[0], channel) for channel in range(2)], [f"{speech[0].stem}.{side}" for side in _SIDES]


def _outputs_of(name: str, output: Sequence[str] | None) -> list[Path]:
    """The files of one person.

    Raises:
        InputError: a file that would be that of both, or, where none was named, one that is there.
    """
    found = []
    for text in output or _USUAL:
        if text.endswith("/") or (NAME not in text and Path(text).is_dir()):
            found += [Path(text) / pattern.replace(NAME, name) for pattern in _USUAL]
        elif NAME in text:
            found.append(Path(text.replace(NAME, name)))
        else:
            suffix = Path(text).suffix or ".bvh"
            raise InputError(f"one file {text!r} for two persons", f"-o '{NAME}{suffix}', or a folder, -o out/")
    there = [] if output else [path for path in found if path.exists()]
    if there:
        raise InputError(
            f"{str(there[0])!r} is there already", f"-o '{_USUAL[0]}' writes over it; -o out/ writes to another folder"
        )
    return found


def _pick(flag: str, values: Sequence[Any] | None, person: int, usual: Any) -> Any:
    """What an option says about a person, 0 or 1.

    Raises:
        InputError: it is given more than twice.
    """
    if not values:
        return usual
    if len(values) > 2:
        raise InputError(f"{flag} is given {len(values)} times", "once for both persons, or twice")
    return values[min(person, len(values) - 1)]


def _pick_transcript(values: Sequence[str] | None, names: Sequence[str], person: int) -> str | None:
    """As `_pick`: one file is that of one person, and names have `NAME` in them, perhaps."""
    if values and len(values) == 1 and NAME not in values[0]:
        raise InputError(f"one transcript {values[0]!r} for two persons", f"one of each, or words/{NAME}.srt")
    found = _pick("--transcript", values, person, None)
    return found.replace(NAME, names[person]) if found else None


def _check_apart(
    tracks: Sequence[VoiceTrack], files: Sequence[Sequence[Path]], own: Sequence[dict[str, Any]], report: Path | None
) -> None:
    """No file is written over another one, or over one that is read."""
    from ..export.checks import check_apart

    written = [path for each in files for path in each] + ([] if report is None else [report])
    read = [Path(track.path) for track in tracks]
    read += [Path(options[key]) for options in own for key in ("transcript", "avatar", "style", "emotion") if options[key]]
    check_apart(written, read)
