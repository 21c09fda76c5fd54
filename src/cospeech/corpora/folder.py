"""Any folder of sound files, searched to the bottom: how users bring a style of their own.

Beside ``talk.wav`` may lie its motion, ``talk.{bvh,glb,fbx,vrma,npz}``, its words, ``talk.srt`` or another of `WORDS`, and
its face, ``talk.json`` in BEAT's layout or ``talk.csv`` of Live Link Face. The first folder below the given one names the
speaker; without one the folder does. ``emotions.csv`` in the given folder may tell emotions: a recording, or a folder of them,
and its emotion, in each line.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path

from ..audio.emotions import EMOTIONS
from ..errors import InputError, nearest
from ..export.registry import reads_body, suffixes
from ..files import describe_os_error
from .clip import Clip, Dropped
from .reading import check_lengths, load_motion, load_sound, read_each, read_rows, usable_folder

__all__ = ["EMOTIONS_FILE", "SOUND", "VIDEO", "WORDS", "group_files", "read", "sounds"]

VIDEO = (".mp4", ".m4v", ".mov", ".webm", ".mkv", ".avi", ".3gp", ".wmv", ".flv", ".ogv")
"""The suffixes of `SOUND` that may be a video; a video beside a sound of the same name is no speech of its own."""
SOUND = (
    ".wav", ".flac", ".ogg", ".oga", ".opus", ".mp3", ".aiff", ".aif", ".aifc", ".caf", ".w64", ".au", ".m4a", ".m4b", ".aac",
    ".mka", ".amr", ".wma", ".wv", ".ape", *VIDEO,
)  # fmt: skip
"""[ours: suffixes that recorders, phones and cameras give to what `cospeech.audio._decode` opens]"""
_OTHER_MEDIA = (".mpg", ".mpeg", ".mts", ".m2ts", ".vob", ".ac3", ".dts")
"""[ours: suffixes of cameras and discs that the decoder does not open; they are reported, and not passed over silently]"""
_FACES = {".json": (b'"names"', b'"frames"'), ".csv": (b"Timecode", b"BlendShapeCount")}
"""Suffix of a file of faces → texts that are at its beginning."""
WORDS = (".textgrid", ".tsv", ".srt", ".vtt", ".sbv", ".ttml", ".dfxp", ".lrc", ".json", ".txt")
EMOTIONS_FILE = "emotions.csv"
"""Beside the folders of the speakers."""
_PEEK = 1 << 16  # bytes; ours: the names of a face file stand in its first 2 kB


def read(raw: str | PathLike[str]) -> Iterator[Clip | Dropped]:
    """Clips in order of path, one at a time; the name is the path below the folder, without suffix.

    Where several files could be a clip's sound, motion or words, the first suffix of `SOUND`, of the formats, of `WORDS`
    counts. A second sound of one name is reported as dropped, and so is motion without a sound of its name, a link to a
    folder, and media that cannot be read. Hidden files and folders are passed over.

    Raises:
        InputError: no such folder, no sound file in it, or emotions that cannot be read.
    """
    root = usable_folder(raw, "a corpus")
    left_out: list[Dropped] = []
    if next(sounds(root, left_out), None) is None:
        hint = f"{left_out[0].name}: {left_out[0].reason}" if left_out else f"known: {' '.join(SOUND)}"
        raise InputError(f"there is no sound file in {str(root)!r}", hint)
    return _read(root, _read_emotions(root / EMOTIONS_FILE))


def _read_emotions(path: Path) -> dict[str, str]:
    """Name of a recording or folder → its emotion; nothing where there is no such file.

    Raises:
        InputError: a line is no name and emotion, or there is no such emotion.
    """
    emotions: dict[str, str] = {}
    for number, row in enumerate(read_rows(path) if path.exists() else (), 1):
        if not any(map(str.strip, row)) or (number == 1 and [cell.strip().lower() for cell in row] == ["name", "emotion"]):
            continue
        if len(row) != 2:
            raise InputError(f"{path.name}, line {number}: {','.join(row)[:60]!r}", "a name and an emotion: Ana/monday,anger")
        name, emotion = row[0].strip().strip("/"), row[1].strip().lower()
        if emotion not in EMOTIONS:
            raise InputError(f"{path.name}, line {number}: no emotion is called {emotion!r:.40}", nearest(emotion, EMOTIONS))
        emotions[name] = emotion
    return emotions


def sounds(root: Path, left_out: list[Dropped] | None = None) -> Iterator[tuple[str, Path]]:
    """Name and file of every sound, in the order of `read`; two sounds may have one name. Nothing is opened.

    Args:
        root: the folder.
        left_out: media that cannot be read are added to it, and what `group_files` adds.
    """
    left_out = [] if left_out is None else left_out
    for name, files in group_files(root, left_out):
        among = _sounds_among(files)
        left_out += [] if among else _other_media(name, files)
        yield from ((name, path) for path in among)


def _other_media(name: str, files: Mapping[str, Sequence[Path]]) -> list[Dropped]:
    """Of one name, the media that cannot be read."""
    others = [path for suffix in _OTHER_MEDIA for path in files.get(suffix, ())]
    return [Dropped(f"{name}{path.suffix}", "media of this kind cannot be read; save it as WAV") for path in others]


def _sounds_among(files: Mapping[str, Sequence[Path]]) -> list[Path]:
    """The sounds of one name, in the order of `SOUND`."""
    return [path for suffix in SOUND for path in files.get(suffix, ())]


def _motion_among(files: Mapping[str, Sequence[Path]]) -> Path | None:
    """The motion of one name: of several, that of the first suffix in the order of the formats."""
    return next((files[suffix][0] for suffix in suffixes(reads_body) if suffix in files), None)


def group_files(root: Path, left_out: list[Dropped]) -> Iterator[tuple[str, dict[str, list[Path]]]]:
    """Name → its files by suffix, folder by folder. Hidden files and folders are passed over; links to folders not followed.

    A suffix has several files where they differ in small and capital letters: ``a.wav`` and ``a.WAV``.

    Args:
        root: the folder.
        left_out: links to folders are added to it, and folders that cannot be listed.
    """

    def note(error: OSError) -> None:
        left_out.append(Dropped(os.path.relpath(str(error.filename), root), f"cannot list it: {describe_os_error(error)}"))

    for place, folders, names in os.walk(root, onerror=note):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        links = [path for name in folders if (path := Path(place, name)).is_symlink()]
        left_out += [Dropped(path.relative_to(root).as_posix(), "a link to a folder; links are not followed") for path in links]
        groups: dict[str, dict[str, list[Path]]] = {}
        for name in sorted(names):
            path = Path(place, name)
            if not name.startswith("."):
                groups.setdefault(path.stem, {}).setdefault(path.suffix.lower(), []).append(path)
        for stem, files in groups.items():
            yield Path(place, stem).relative_to(root).as_posix(), files


def _read(root: Path, emotions: Mapping[str, str]) -> Iterator[Clip | Dropped]:
    left_out: list[Dropped] = []
    orphans = {*emotions}
    for name, files in group_files(root, left_out):
        if not (among := _sounds_among(files)):
            yield from _other_media(name, files)
            if (motion := _motion_among(files)) is not None:
                yield Dropped(f"{name}{motion.suffix}", "no sound of this name is beside it")
            continue
        first, *others = among
        for other in others:
            yield Dropped(f"{name}{other.suffix}", f"{first.name!r} is the sound of this name already")
        parts = name.split("/")
        speaker = parts[0] if len(parts) > 1 else root.resolve().name or "speaker"
        places = ["/".join(parts[:k]) for k in range(len(parts), 0, -1)]  # the recording, and the folders around it
        orphans -= {*places}
        emotion = next((emotions[place] for place in places if place in emotions), None)
        yield from read_each([name], lambda name, f=files, s=speaker, e=emotion, at=first: _clip(name, s, at, f, e))  # type: ignore[misc]
    yield from (Dropped(name, f"{EMOTIONS_FILE} names it, and there is no such recording") for name in sorted(orphans))
    yield from left_out


def _clip(name: str, speaker: str, sound: Path, files: dict[str, list[Path]], emotion: str | None) -> Clip:
    path = _motion_among(files)
    face = next((files[suffix][0] for suffix in _FACES if suffix in files and _is_face(files[suffix][0])), None)
    words = next((files[s][0] for s in WORDS if s in files and files[s][0] != face), None)
    motion = None if path is None else load_motion(path)
    weights = None if face is None else load_motion(face)
    speech = load_sound(sound, words)
    check_lengths(name, motion, speech)
    return Clip(
        name=name,
        speaker=speaker,
        corpus="folder",
        speech=speech,
        motion=motion,
        face=None if weights is None else weights.face,
        face_fps=None if weights is None else weights.fps,
        emotion=emotion,
    )


def _is_face(path: Path) -> bool:
    """Whether a file holds face weights, and not words or anything else."""
    from ..export.reading import open_file

    with open_file(path) as file:
        head = file.read(_PEEK)
    return all(mark in head for mark in _FACES[path.suffix.lower()])
