"""``cospeech dialogue``: a character for each person of a conversation, which talks and listens."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument

from ..errors import InputError, say_count
from ..models import DEFAULT, PARTS, Model, load
from .dialogue_words import EACH, Offsets, Tiers, Transcripts, find_words, pick, pick_words
from .options import NAME, Debug, Fps, Parts, Quiet, ReportFile, Seed, Skeleton, Tail, number, option
from .progress import show_progress

if TYPE_CHECKING:
    from ..motion.motion import Motion
    from ..runtime.listening import DialogueRole
    from ..runtime.report import Reports
    from .persons import Person

__all__ = ["register"]

Sounds = Annotated[
    list[Path],
    Argument(
        metavar="SPEECH",
        help="Sound files of one conversation, with one person each, that begin at the same moment; or one stereo file with "
        "one person on each channel; or one recording of all, with --speakers.",
    ),
]
Speakers = Annotated[
    Path | None,
    option(
        "--speakers",
        metavar="FILE",
        help="Who speaks when in one recording of all: .rttm, .json of a recogniser that names speakers, .srt or .vtt with "
        "names. If it has words and you give no --transcript, its words are used, too.",
    ),
]
PersonNames = Annotated[
    list[str] | None,
    option("--person", metavar="NAME", help="Generate this person only, who hears all others. Repeat the option for several."),
]
Outputs = Annotated[
    list[str] | None,
    option(
        "--output",
        "-o",
        metavar="FILE",
        help=f"File to write, with {NAME} in it: out/{NAME}.vrma. {NAME} is the name of the sound file. If all persons are in "
        "one file, .left, .right or the name of the speaker comes behind it. Repeat the option for several formats. Without "
        "it, the program writes a .bvh and a .glb of each person into this folder; it replaces no file that is there. A video "
        f"without {NAME} in its name shows all persons: both.mp4.",
    ),
]
Models = Annotated[list[str] | None, option("--model", metavar="MODEL", help=f"See `cospeech generate`. {EACH}")]
Styles = Annotated[list[str] | None, option("--style", metavar="STYLE", help=f"See `cospeech generate`. {EACH}")]
Emotions = Annotated[list[str] | None, option("--emotion", metavar="NAME|FILE", help=f"See `cospeech generate`. {EACH}")]
Intensities = Annotated[
    list[float] | None, option("--intensity", metavar="NUMBER", parser=number, help=f"Size of the movements, 0 … 2. {EACH}")
]
Languages = Annotated[list[str] | None, option("--language", metavar="CODE", help=f"Language of the words. {EACH}")]
Avatars = Annotated[
    list[str] | None,
    option("--avatar", metavar="FILE", help=f"VRM, GLB or FBX character in place of our mannequin. {EACH}"),
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
_USUAL = (f"{NAME}.bvh", f"{NAME}.glb")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(dialogue)


def dialogue(
    speech: Sounds, output: Outputs = None, speakers: Speakers = None, person: PersonNames = None, model: Models = None,
    style: Styles = None, emotion: Emotions = None, intensity: Intensities = None, transcript: Transcripts = None,
    offset: Offsets = None, tier: Tiers = None, language: Languages = None, avatar: Avatars = None, angle: Angle = 0.0,
    seed: Seed = 0, parts: Parts = _ALL_PARTS, skeleton: Skeleton = "humanoid", fps: Fps = 30.0, tail: Tail = 0.0,
    report: ReportFile = None, quiet: Quiet = False, debug: Debug = False,
) -> None:  # fmt: skip
    """Generate characters that talk to each other.

    Each one gestures while it speaks. While another one speaks, it listens: it nods where the other one pauses or lowers the
    voice, smiles now and then, and looks at the other one. Sound of other persons in a microphone is left out.

    \b
    cospeech dialogue host.wav guest.wav -o "{name}.glb"
    cospeech dialogue call.wav -o "out/{name}.vrma" --style calm --style lively
    cospeech dialogue podcast.mp3 --speakers podcast.json -o "out/{name}.glb"
    cospeech dialogue host.wav guest.wav -o "{name}.bvh" --transcript "words/{name}.srt" --angle 30
    """
    from ..export.group_film import SIDE
    from ..files import check_destination
    from ..runtime.attention import find_row, find_seats
    from ..runtime.listening import ANGLE_RANGE
    from .main import show_outputs
    from .persons import choose_persons, describe_persons, hear_persons

    if not 0 <= angle <= ANGLE_RANGE[1]:
        raise InputError(f"an angle of {angle:g} degrees", f"0 … {ANGLE_RANGE[1]:g}; for more, turn the characters themselves")
    if report is not None:
        check_destination(report)
    _check_outputs(output)
    persons, is_mixed = hear_persons(speech, speakers), speakers is not None
    if angle and len(persons) != 2:
        raise InputError(f"an angle between {len(persons)} persons", "it is for two; turn the characters themselves")
    picks = choose_persons(persons, person or ())
    words = transcript if transcript or offset or tier else find_words(speakers)
    own = [
        {
            "model": pick("--model", model, k, persons, DEFAULT), "style": pick("--style", style, k, persons, None),
            "emotion": pick("--emotion", emotion, k, persons, "auto"),
            "intensity": pick("--intensity", intensity, k, persons, 1.0),
            "language": pick("--language", language, k, persons, ""),
            "avatar": pick("--avatar", avatar, k, persons, None) or None,
            "transcript": pick_words(words, offset, tier, k, persons, is_mixed=is_mixed), "seed": seed + k,
            "parts": [each.strip() for each in parts.split(",") if each.strip()], "skeleton": skeleton, "fps": fps,
            "tail": tail,
        }
        for k in range(len(persons))
    ]  # fmt: skip
    load_once, films = cache(load), [Path(text) for text in output or () if _is_film(text)]
    _check_films(films, len(picks), {own[k]["avatar"] for k in picks})
    output = [text for text in output if not _is_film(text)] if output else None
    files = {k: _outputs_of(persons[k].name, output) for k in picks if output != []}
    _check_use(files, films, skeleton, report)
    _check_apart(
        [*speech, *([speakers] if speakers else [])], [*films, *(path for each in files.values() for path in each)], own, report
    )
    _check_requests([own[k] for k in picks], load_once)
    if not quiet:
        typer.echo(describe_persons(persons), err=True)
    with show_progress("generating", quiet) as progress:
        seats = [[0.0, angle], [-angle, 0.0]] if len(persons) == 2 else find_seats(len(persons))
        result = _generate(persons, _make_roles(persons, seats, is_mixed=is_mixed), files, own, load_once, progress)
        for film in films:
            row = seats if len(persons) == 2 else find_row(len(persons), SIDE)
            _draw_film(film, picks, persons, _make_roles(persons, row, is_mixed=is_mixed), own, load_once, angle, progress)
    if report is not None:
        _write_report(report, result, films)
    if not quiet:
        show_outputs(result.speeches)
        for film in films:
            typer.echo(f"  {film}  {say_count(len(picks), 'person')} side by side")


def _check_requests(own: Sequence[dict[str, Any]], load_once: Callable[[str], Model]) -> None:
    """Check the model, style and emotion of all persons before the first person is generated, which may take minutes.

    Raises:
        InputError: a model is unknown, or cannot work with the options of its person.
    """
    from ..generate import check_request

    for options in own:
        request = {key: options[key] for key in ("style", "emotion", "intensity", "seed", "parts", "fps")}
        check_request(load_once(options["model"]), **request)


def _make_roles(persons: Sequence[Person], bearings: Sequence[Sequence[float]], *, is_mixed: bool) -> list[DialogueRole]:
    """The role of each person among the others; ``bearings[k][j]``: degrees to the left at which person k sees person j."""
    from ..runtime.listening import DialogueRole

    roles = []
    for k, person in enumerate(persons):
        rest = [j for j in range(len(persons)) if j != k]
        others, places = (persons[j].voice for j in rest), (bearings[k][j] for j in rest)
        roles.append(DialogueRole(person.voice, tuple(others), tuple(places), is_mixed))
    return roles


def _generate(
    persons: Sequence[Person], roles: Sequence[DialogueRole], files: dict[int, list[Path]], own: Sequence[dict[str, Any]],
    load_once: Callable[[str], Model], progress: Any,
) -> Reports:  # fmt: skip
    """Write the files of the chosen persons: all of them, or after an error none."""
    from ..files import all_or_none, make_folders
    from ..generate import generate_files
    from ..runtime.report import Reports

    all_paths, reports = [path for each in files.values() for path in each], []
    with make_folders({path.parent for path in all_paths}), all_or_none(all_paths) as place:
        for k, paths in files.items():
            person, temporary = persons[k], [place(path) for path in paths]
            tell = None if progress is None else _tell(progress, person.name)
            report = generate_files(
                person.voice.track.path,
                temporary,
                role=roles[k],
                progress=tell,
                instance=load_once(own[k]["model"]),
                **own[k],
            )
            reports.append(replace(report, speech=person.name, outputs=[str(path) for path in paths]))
    return Reports(speeches=reports, failed=[])


def _write_report(path: Path, result: Reports, films: Sequence[Path]) -> None:
    """Write the reports; a video of all persons is among the files of each person."""
    from ..files import atomic

    reports = [replace(each, outputs=[*each.outputs, *map(str, films)]) for each in result.speeches]
    with atomic(path) as file:
        file.write_text(replace(result, speeches=reports).to_json(), "utf-8", newline="\n")


def _tell(progress: Any, name: str) -> Any:
    return lambda amount, total: progress(amount, total, name)


def _draw_film(
    film: Path, picks: Sequence[int], persons: Sequence[Person], roles: Sequence[DialogueRole],
    own: Sequence[dict[str, Any]], load_once: Callable[[str], Model], angle: float, progress: Any,
) -> None:  # fmt: skip
    """Draw a video of the chosen persons side by side, with the sound of all."""
    from ..export.group_film import write_group_film
    from ..files import make_folders
    from ..generate import generate_motion
    from ..motion.frame_pieces import cut_alike

    motions = []
    for k in picks:
        options = {key: value for key, value in own[k].items() if key not in ("avatar", "skeleton")}
        options["model"] = load_once(own[k]["model"])
        motions.append(generate_motion(persons[k].voice.track.path, role=roles[k], **options))
    seconds, fps = float(roles[0].own.length) + own[0]["tail"], own[0]["fps"]

    def tell() -> Iterator[list[Motion]]:
        for pieces in cut_alike(motions):
            yield pieces
            if progress is not None:
                progress(pieces[0].start + pieces[0].duration, seconds, film.name)

    sounds = list(dict.fromkeys(person.voice.track.path for person in persons))
    with make_folders({film.parent}):
        write_group_film(film, tell(), fps=fps, sounds=sounds, avatars=[own[k]["avatar"] for k in picks], angle=angle)


def _check_use(files: dict[int, list[Path]], films: Sequence[Path], skeleton: str, report: Path | None) -> None:
    """Raise an InputError for an option about the files of each person, if only videos of all persons are written."""
    from ..export.checks import check_skeleton

    if files:
        return
    if report is not None:
        raise InputError(f"{str(report)!r} reports on the files of each person, and there are none", f"add -o '{_USUAL[0]}'")
    if skeleton != "humanoid":
        check_skeleton(skeleton, {film.suffix.lower() for film in films})


def _check_films(films: Sequence[Path], count: int, avatars: set[str | None]) -> None:
    """Check, before any motion is made, that videos of so many persons can be made.

    Raises:
        InputError: they cannot be made, or an avatar cannot be shown.
    """
    from ..export.checks import check_avatar
    from ..export.group_film import check_group_film
    from ..files import check_destination

    if not films:
        return
    check_group_film(count)
    for avatar in avatars - {None}:
        check_avatar(str(avatar), {film.suffix.lower() for film in films})
    for film in films:
        if film.parent.is_dir():
            check_destination(film)


def _is_film(text: str) -> bool:
    """Whether a file shows all persons."""
    return NAME not in text and Path(text).suffix.lower() == ".mp4" and not _is_folder(text)


def _check_outputs(output: Sequence[str] | None) -> None:
    """Raise an InputError if several persons would share a file, or a file has an unknown format."""
    from ..export import format_of

    for text in output or ():
        if NAME in text:
            format_of(text)
        elif not _is_folder(text) and not _is_film(text):
            suffix = Path(text).suffix or ".bvh"
            raise InputError(f"one file {text!r} for several persons", f"-o '{NAME}{suffix}', or a folder, -o out/")


def _is_folder(text: str) -> bool:
    return text.endswith(("/", os.sep)) or Path(text).is_dir()


def _outputs_of(name: str, output: Sequence[str] | None) -> list[Path]:
    """The files of one person.

    Raises:
        InputError: the user named none, and a file of the usual name exists.
    """
    paths = []
    for text in output or _USUAL:
        if NAME in text:
            paths.append(Path(text.replace(NAME, name)))
        else:
            paths += [Path(text) / pattern.replace(NAME, name) for pattern in _USUAL]
    existing = [] if output else [path for path in paths if path.exists()]
    if existing:
        raise InputError(
            f"{str(existing[0])!r} is there already", f"-o '{_USUAL[0]}' writes over it; -o out/ writes to another folder"
        )
    return paths


def _check_apart(sources: list[Path], targets: list[Path], own: Sequence[dict[str, Any]], report: Path | None) -> None:
    """Raise an InputError if two outputs are one file, or an output is a file that is read."""
    from ..export.checks import check_apart
    from ..export.target_skeleton import rig_files
    from ..runtime.styles.style import example_files

    targets += [] if report is None else [report]
    sources += [Path(options[key]) for options in own for key in ("transcript", "avatar", "emotion") if options[key]]
    sources += [path for options in own for path in (*rig_files(options["skeleton"]), *example_files(options["style"]))]
    check_apart(targets, sources)
