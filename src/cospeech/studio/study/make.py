"""Make a study from folders of clips: it gives blind names, removes sound if wanted, and renders motion files as videos."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...audio.speech import open_speech
from ...errors import InputError, nearest
from ...export.registry import suffixes
from ...files import workplace
from ...rules.options import FPS_RANGE, check_range
from .plan import CLIPS, StudyClip, StudyPlan, save_plan
from .stimuli import FACES, FPS, StudyScene, find_speech, render_scenes
from .templates import CONSENT, TEMPLATES, THANKS
from .videos import VIDEOS, check_alike, copy_video, look_at_video

__all__ = ["VARIANTS", "make_study"]

VARIANTS = ("full", "mute", "hands")
_VIEWS = {"full": "body", "mute": "body", "hands": "hands"}
OTHER_SPEECH = ", other speech"
"""Suffix of the name of a system: the same system with the motion of another speech."""


class _Source(NamedTuple):
    """A clip and the file that it is made from."""

    clip: StudyClip
    path: Path


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
    seed: int | None = None,
    title: str = "Gestures and speech",
    completion: str = "",
    faces: str = "auto",
    fps: float = FPS,
    allow_differences: bool = False,
    progress: Callable[[float, float | None], None] | None = None,
) -> StudyPlan:
    """Make the folder of a study from clips of systems on the same speech.

    Args:
        folders: one for each system, with the name of the system. Clips with the same file name belong to the same speech. They
            are videos (.mp4, .webm), or motion files, which are rendered (`cospeech.studio.study.stimuli`).
        study: the folder to make; it must not exist yet.
        template: a name of `TEMPLATES`.
        variant: ``full``; ``mute``: without sound; ``hands``: motion files are rendered with the camera on the hands.
        reference: the system with which each other system is paired.
        transfer: systems whose style should differ from the reference's.
        speech: folder with a sound file for each clip, for motion files.
        stimuli_each: number of speeches that a rater sees; the default is that of the template.
        checks: attention checks in a session.
        seed: of the orders and of the blind names. The default is a random one, so that nobody can work out the names.
        completion: address to which raters go at the end.
        faces: of motion files: ``show``, ``hide``, or ``auto``, which hides all faces if a clip has none.
        fps: pictures per second of motion files.
        allow_differences: accept videos that differ in kind, size, rate, sound or length, with a warning.
        progress: called after each clip with the number of clips that are done, and of all clips.

    Raises:
        InputError: clips are missing, cannot be read, do not suit the template, or differ in something other than motion.
    """
    _check_names(template=(template, TEMPLATES), variant=(variant, VARIANTS), faces=(faces, FACES))
    check_range("fps", fps, FPS_RANGE)
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
    muted, seed = variant == "mute", secrets.randbits(62) if seed is None else seed
    voices = {} if muted else _find_voices(systems, speech)
    sources = _name_clips(seed, systems, _mismatch(systems, voices) if kind.mismatches else {})
    try:
        plan = StudyPlan.model_validate({
            "title": title, "template": template, "consent": CONSENT, "instructions": kind.instructions, "thanks": THANKS,
            "completion": completion, "shows": kind.shows, "variant": variant, "questions": list(kind.questions),
            "systems": list(dict.fromkeys(source.clip.system for source in sources)), "reference": reference,
            "transfer": list(transfer), "checks": checks, "fewest_checks": checks, "seed": seed,
            "mismatched": {f"{name}{OTHER_SPEECH}": name for name in systems} if kind.mismatches else {},
            "stimuli_each": min(kind.stimuli_each if stimuli_each is None else stimuli_each, len(next(iter(systems.values())))),
            "clips": [source.clip for source in sources],
        })  # fmt: skip
    except ValueError as error:
        text = error.errors()[0]["msg"] if hasattr(error, "errors") else str(error)
        raise InputError(f"this makes no study: {text}") from None
    videos = [source for source in sources if _is_video(source.path)]
    if videos:
        _check_videos(videos, variant, allow_differences)
    study.parent.mkdir(parents=True, exist_ok=True)
    with workplace(study.parent) as place:
        new_study = place / "study"
        (new_study / CLIPS).mkdir(parents=True)
        _write_clips(sources, new_study / CLIPS, voices, variant, faces=faces, fps=fps, progress=progress)
        if videos and len(videos) < len(sources):
            _check_videos(sources, variant, allow_differences, new_study / CLIPS)
        save_plan(plan, new_study)
        new_study.rename(study)
    return plan


def _write_clips(
    sources: Sequence[_Source],
    folder: Path,
    voices: Mapping[str, Path],
    variant: str,
    *,
    faces: str,
    fps: float,
    progress: Callable[[float, float | None], None] | None,
) -> None:
    """Render motion files, and copy videos."""
    tick = _count(progress, len(sources))
    scenes = [StudyScene(path, clip.stimulus, folder / clip.file) for clip, path in sources if not _is_video(path)]
    if scenes:
        render_scenes(scenes, voices, camera=_VIEWS[variant], faces=faces, fps=fps, progress=tick)
    for clip, path in sources:
        if _is_video(path):
            copy_video(path, folder / clip.file, sound=variant != "mute")
            tick()


def _check_names(**choices: tuple[str, Sequence[str] | Mapping[str, object]]) -> None:
    for what, (name, names) in choices.items():
        if name not in names:
            raise InputError(f"unknown {what} {name!r}", nearest(name, [*names]))


def _count(progress: Callable[[float, float | None], None] | None, total: int) -> Callable[[], None]:
    """A function to call after each clip; it reports progress."""
    count = 0

    def tell() -> None:
        nonlocal count
        count += 1
        if progress is not None:
            progress(count, total)

    return tell


def _is_video(path: Path) -> bool:
    return path.suffix.lower() in VIDEOS


def _find_voices(systems: Mapping[str, Mapping[str, Path]], folder: Path | None) -> dict[str, Path]:
    """Speech → sound file, for all speeches of motion files; they are found before the first clip is rendered."""
    voices: dict[str, Path] = {}
    for clips in systems.values():
        voices |= {
            name: find_speech(path, folder) for name, path in clips.items() if not _is_video(path) and name not in voices
        }
    return voices


def _mismatch(systems: Mapping[str, Mapping[str, Path]], voices: Mapping[str, Path]) -> dict[str, str]:
    """Speech → another speech of nearly the same length, whose motion is played to it; each one is used once.

    Raises:
        InputError: a clip is a video, or there is only one speech.
    """
    if video := next((path for clips in systems.values() for path in clips.values() if _is_video(path)), None):
        raise InputError(f"{str(video)!r} is a video: its speech cannot be exchanged", "give motion files")
    if not voices:
        raise InputError("speech is asked for, and there is none", "--variant full or hands")
    if len(voices) < 2:
        raise InputError("one speech cannot be exchanged with another", "two speeches or more")
    seconds = {}
    for name, path in voices.items():
        with open_speech(path) as source:
            seconds[name] = float(source.seconds or 0)
    order = sorted(voices, key=lambda name: (seconds[name], name))
    others: dict[str, str] = {}
    for k in range(0, len(order), 2):  # neighbours are exchanged; if the number is odd, the last three are rotated
        group = order[k:] if len(order) - k == 3 else order[k : k + 2]
        if k > len(order) - 2:
            break
        others |= dict(zip(group, np.roll(group, -1).tolist(), strict=True))
    return others


def _name_clips(seed: int, systems: Mapping[str, Mapping[str, Path]], others: Mapping[str, str]) -> list[_Source]:
    """All clips; for each system, those with the motion of another speech come last."""
    sources = []
    for system, clips in systems.items():
        sources += [_Source(_name_clip(seed, system, name, clips[name]), clips[name]) for name in sorted(clips)]
        other = f"{system}{OTHER_SPEECH}"
        sources += [_Source(_name_clip(seed, other, name, clips[others[name]]), clips[others[name]]) for name in sorted(others)]
    return sources


def _check_videos(sources: Sequence[_Source], variant: str, allow: bool, folder: Path | None = None) -> None:
    """Check that the videos can be shown, and are alike; with ``folder``, the videos of the new study in it."""
    if variant == "hands":
        problem = f"{str(sources[0].path)!r} is a video: the camera cannot be moved to the hands"
        raise InputError(problem, "give motion files")
    facts = {}
    for clip, path in sources:
        video = path if folder is None else folder / clip.file
        facts[path] = clip.stimulus, look_at_video(video, muted=variant == "mute")
    check_alike(facts, allow=allow)


def _find_clips(folders: Sequence[Path]) -> dict[str, dict[str, Path]]:
    """Find system → speech → file; all systems must have the same speeches."""
    motions, systems = suffixes(lambda entry: entry.readable), {}
    for folder in folders:
        name = folder.resolve().name
        if not folder.is_dir():
            raise InputError(f"there is no folder {str(folder)!r}", "one folder of clips for each system")
        if name in systems:
            raise InputError(f"two folders are named {name!r}", "the name of a folder is that of its system")
        visible = [path for path in folder.iterdir() if not path.name.startswith(".")]  # macOS' shadow files: ._talk.mp4
        files = sorted(path for path in visible if path.suffix.lower() in {*VIDEOS, *motions} and path.is_file())
        videos = {path.stem for path in files if path.suffix.lower() in VIDEOS}
        clip_files = [path for path in files if path.suffix.lower() in VIDEOS or path.stem not in videos]
        clips = {path.stem: path for path in clip_files}
        if not clips:
            raise InputError(f"no clips in {str(folder)!r}", f"known: {' '.join([*VIDEOS, *sorted(motions)])}")
        if len(clips) < len(clip_files):
            duplicate = next(path for path in clip_files if clips[path.stem] != path)
            raise InputError(f"{str(folder)!r} has several files for {duplicate.stem!r}", "keep one of them")
        systems[name] = clips
    first = next(iter(systems), None)
    if first is None:
        raise InputError("no folder of clips", "one folder for each system")
    for name, clips in systems.items():
        if odd := sorted({*clips} ^ {*systems[first]}):
            raise InputError(f"{first!r} and {name!r} have different clips: {odd[0]!r}", "same file names for the same speech")
    return systems


def _name_clip(seed: int, system: str, stimulus: str, source: Path) -> StudyClip:
    """A clip with a name that means nothing without the seed."""
    text = "\0".join((str(seed), system, stimulus)).encode()
    name = hashlib.blake2b(text, digest_size=8).hexdigest()
    suffix = source.suffix.lower() if source.suffix.lower() in VIDEOS else ".mp4"
    return StudyClip(id=name, system=system, stimulus=stimulus, file=name + suffix)
