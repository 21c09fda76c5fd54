"""A study made from folders of clips: blind names, no sound where none is wanted, motion files drawn as videos."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from ...convert import convert_file
from ...errors import InputError, describe_extra, nearest
from ...export.registry import suffixes
from ...files import workplace
from .plan import CLIPS, StudyClip, StudyPlan, save_plan
from .templates import CONSENT, TEMPLATES, THANKS

__all__ = ["VARIANTS", "make_study"]

VIDEOS = (".mp4", ".webm")
SOUNDS = (".wav", ".flac", ".ogg", ".mp3", ".aiff", ".m4a")
VARIANTS = ("full", "mute", "hands")
_VIEWS = {"full": "body", "mute": "body", "hands": "hands"}


def make_study(
    folders: Sequence[Path],
    study: Path,
    *,
    template: str = "preference",
    variant: str = "full",
    reference: str | None = None,
    transfer: Sequence[str] = (),
    speech: Path | None = None,
    stimuli_each: int | None = None,
    checks: int = 2,
    seed: int = 0,
    title: str = "Gestures and speech",
    progress: Callable[[float], None] | None = None,
) -> StudyPlan:
    """Make the folder of a study from clips of systems on the same speech.

    Args:
        folders: one of each system; its name is the system's. Clips with the same file name belong to the same speech. They
            are videos (.mp4, .webm), or motion files, which are drawn.
        study: the folder to make; it must not exist yet.
        template: a name of `TEMPLATES`.
        variant: ``full``; ``mute``: without sound; ``hands``: motion files are drawn with the camera on the hands.
        reference: the system with which each other one is paired.
        transfer: systems whose style should differ from the reference's.
        speech: folder with a sound file for each clip, for motion files.
        stimuli_each: how many speeches a rater sees; the template says where not given.
        checks: attention checks in a session.
        seed: of the orders and of the blind names.

    Raises:
        InputError: clips are missing, cannot be read, or do not suit the template.
    """
    if template not in TEMPLATES:
        raise InputError(f"unknown template {template!r}", nearest(template, TEMPLATES))
    if variant not in VARIANTS:
        raise InputError(f"unknown variant {variant!r}", nearest(variant, VARIANTS))
    if study.exists():
        raise InputError(f"{str(study)!r} exists already", "name a new folder; answers are never overwritten")
    kind, systems = TEMPLATES[template], _find_clips(folders)
    for name in [*([reference] if reference is not None else []), *transfer]:
        if name not in systems:
            raise InputError(f"no folder is named {name!r}", nearest(name, systems))
    if kind.needs_reference and reference is None:
        raise InputError(
            f"the template {template!r} compares with recordings", f"--reference NAME, one of {', '.join(systems)}"
        )
    stimuli = sorted(next(iter(systems.values())))
    clips = [_name_clip(seed, system, stimulus, systems[system][stimulus]) for system in systems for stimulus in stimuli]
    try:
        plan = StudyPlan.model_validate({
            "title": title, "template": template, "consent": CONSENT, "instructions": kind.instructions, "thanks": THANKS,
            "shows": kind.shows, "variant": variant, "questions": list(kind.questions), "systems": list(systems),
            "reference": reference, "transfer": list(transfer), "checks": checks, "fewest_checks": checks, "seed": seed,
            "stimuli_each": min(kind.stimuli_each if stimuli_each is None else stimuli_each, len(stimuli)), "clips": clips,
        })  # fmt: skip
    except ValueError as error:
        told = error.errors()[0]["msg"] if hasattr(error, "errors") else str(error)
        raise InputError(f"this makes no study: {told}") from None
    study.parent.mkdir(parents=True, exist_ok=True)
    with workplace(study.parent) as place:
        made = place / "study"
        (made / CLIPS).mkdir(parents=True)
        for k, clip in enumerate(plan.clips):
            _write_clip(systems[clip.system][clip.stimulus], made / CLIPS / clip.file, variant, speech)
            if progress is not None:
                progress((k + 1) / len(plan.clips))
        save_plan(plan, made)
        made.rename(study)
    return plan


def _find_clips(folders: Sequence[Path]) -> dict[str, dict[str, Path]]:
    """System → speech → file; all systems have the same speeches."""
    motions, found = suffixes(lambda entry: entry.readable), {}
    for folder in folders:
        name = folder.resolve().name
        if not folder.is_dir():
            raise InputError(f"there is no folder {str(folder)!r}", "one folder of clips for each system")
        if name in found:
            raise InputError(f"two folders are named {name!r}", "the name of a folder is that of its system")
        files = sorted(path for path in folder.iterdir() if path.suffix.lower() in {*VIDEOS, *motions} and path.is_file())
        videos = {path.stem for path in files if path.suffix.lower() in VIDEOS}
        chosen = [path for path in files if path.suffix.lower() in VIDEOS or path.stem not in videos]
        clips = {path.stem: path for path in chosen}
        if not clips:
            raise InputError(f"no clips in {str(folder)!r}", f"known: {' '.join([*VIDEOS, *sorted(motions)])}")
        if len(clips) < len(chosen):
            twice = next(path for path in chosen if clips[path.stem] != path)
            raise InputError(f"{str(folder)!r} has several files for {twice.stem!r}", "keep one of them")
        found[name] = clips
    first = next(iter(found), None)
    if first is None:
        raise InputError("no folder of clips", "one folder for each system")
    for name, clips in found.items():
        if odd := sorted({*clips} ^ {*found[first]}):
            raise InputError(f"{first!r} and {name!r} have different clips: {odd[0]!r}", "same file names for the same speech")
    return found


def _name_clip(seed: int, system: str, stimulus: str, source: Path) -> StudyClip:
    """A clip under a name that says nothing: the hash has the seed in it, which raters do not know."""
    text = "\0".join((str(seed), system, stimulus)).encode()
    name = hashlib.blake2b(text, digest_size=8).hexdigest()
    suffix = source.suffix.lower() if source.suffix.lower() in VIDEOS else ".mp4"
    return StudyClip(id=name, system=system, stimulus=stimulus, file=name + suffix)


def _write_clip(source: Path, target: Path, variant: str, speech: Path | None) -> None:
    if source.suffix.lower() in VIDEOS:
        if variant == "hands":
            raise InputError(f"{str(source)!r} is a video: the camera cannot be moved to the hands", "give motion files")
        copy_video(source, target, sound=variant != "mute")
        return
    voice = None if variant == "mute" else _find_speech(source, speech)
    convert_file(source, target, audio=voice, camera=_VIEWS[variant])


def _find_speech(source: Path, folder: Path | None) -> Path:
    """The sound file of a motion file: the same name, beside it or in the folder of the speech."""
    found = [(folder or source.parent) / f"{source.stem}{suffix}" for suffix in SOUNDS]
    if path := next((path for path in found if path.is_file()), None):
        return path
    raise InputError(f"no speech for {str(source)!r}", "--speech FOLDER with sound files of the same names, or --variant mute")


def copy_video(source: Path, target: Path, *, sound: bool) -> None:
    """A video without its title and other words, which could name the system, and without sound if none is wanted.

    Raises:
        InputError: PyAV is not installed, or the video cannot be read.
    """
    try:
        av: Any = import_module("av")
    except ModuleNotFoundError:
        raise InputError("videos need PyAV", describe_extra("av")) from None
    try:
        with av.open(str(source)) as read, av.open(str(target), "w", format=target.suffix[1:]) as written:
            streams = [*read.streams.video[:1], *(read.streams.audio[:1] if sound else ())]
            if not read.streams.video:
                raise InputError(f"{str(source)!r} shows nothing", "a video is needed")
            made = {stream.index: written.add_stream_from_template(stream) for stream in streams}
            for stream in made.values():
                stream.metadata.clear()
            for packet in read.demux(streams):
                if packet.dts is not None:
                    packet.stream = made[packet.stream.index]
                    written.mux(packet)
    except (av.FFmpegError, ValueError, OSError) as error:
        if isinstance(error, InputError):
            raise
        why = str(error).replace(str(target), target.name)
        raise InputError(f"cannot copy the video {str(source)!r}: {why}", "is it H.264 in .mp4, or VP9 in .webm?") from None
