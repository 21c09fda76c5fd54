"""BEAT v0.2.1 (Liu et al. 2022) as it unpacks: ``<root>/<speaker number>/<take>.{bvh,json,wav,TextGrid,csv,txt}``.

120 fps BVH of 75 joints whose ``Frames:`` is often wrong (rows are counted), with the hips at the origin in the first frame;
60 fps face weights of 51 ARKit shapes; 16 kHz float WAV; words; semantic scores; emotion. A take without a BVH is dropped, a
side file that is not there is None, one that is damaged drops the take.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...files import describe_os_error
from ...motion.motion import Motion
from ..clip import Clip, Dropped
from ..reading import check_lengths, load_motion, load_sound, read_each, usable_folder, words_alone
from .annotations import read_emotions, read_semantics, take_of
from .write import write

__all__ = ["FACE_FPS", "FPS", "MISSING", "load_take", "read", "write"]

FPS = 120.0
FACE_FPS = 60.0
MISSING = {9: ("9_miranda_0_2_8",), 21: ("21_ayana_0_1_8",)}
"""Speaker → takes that are not in the published files (BEAT's own read-me)."""

_SUFFIXES = (".bvh", ".json", ".wav", ".textgrid", ".csv", ".txt")
_START = 1e-4  # metres; ours: hips that begin nearer to the origin are relative to the first frame


def read(raw: str | PathLike[str]) -> Iterator[Clip | Dropped]:
    """Clips of every speaker in order of number, takes in order of name; one at a time.

    Args:
        raw: the folder with the speakers' folders ``1`` … ``30``, or one or two above it.

    Returns:
        Clips on skeleton ``beat`` with the file's own offsets, hips over the origin at their T-pose height in frame 0. The
        emotion is the longest of the emotion file, else of the take's id; all of them are in ``extra["emotions"]``.

    Raises:
        InputError: no such folder, or no speaker's folder in it.
    """
    folders = _speakers(usable_folder(raw, "BEAT"))
    return _read(folders)


def _speakers(root: Path) -> list[Path]:
    for pattern in ("*", "*/*", "*/*/*"):
        folders = [path for path in root.glob(pattern) if path.is_dir() and path.name.isascii() and path.name.isdigit()]
        if folders:
            return sorted(folders, key=lambda path: (int(path.name), path.name))
    raise InputError(f"there is no speaker's folder in {str(root)!r}", "BEAT's are called 1 … 30")


def _read(folders: list[Path]) -> Iterator[Clip | Dropped]:
    for folder in folders:
        takes: dict[str, dict[str, Path]] = {}
        try:
            paths = sorted(folder.iterdir())
        except OSError as error:
            yield Dropped(folder.name, f"cannot list {str(folder)!r}: {describe_os_error(error)}")
            continue
        for path in paths:
            if path.suffix.lower() in _SUFFIXES and not path.name.startswith("._"):
                takes.setdefault(path.stem, {})[path.suffix.lower()] = path
        for name in MISSING.get(int(folder.name), ()):
            if name not in takes:
                yield Dropped(name, "it is missing from the published files of BEAT")
        yield from read_each(takes, lambda name, takes=takes: load_take(name, takes[name]))  # type: ignore[misc]


def load_take(name: str, files: dict[str, Path]) -> Clip:
    """One take from its files, suffix → path.

    Raises:
        InputError: no BVH, no take's name, or a damaged file; file and place are named.
    """
    take = take_of(name)
    if ".bvh" not in files:
        raise InputError(f"'{name}.bvh' is not there", "a take needs motion")
    emotions = read_emotions(files[".csv"]) if ".csv" in files else None
    semantics = read_semantics(files[".txt"]) if ".txt" in files else None
    face = _load_face(files[".json"]) if ".json" in files else None
    motion = _on_floor(load_motion(files[".bvh"], kind="beat", fps=FPS, units="cm", up="y"))
    speech = load_sound(files.get(".wav"), files.get(".textgrid"))
    alone = words_alone(files.get(".wav"), files.get(".textgrid"), motion)
    check_lengths(name, motion, speech)
    return Clip(
        name=name,
        speaker=take.speaker,
        corpus="beat",
        speech=speech,
        motion=motion,
        face=None if face is None else face.face,
        face_fps=None if face is None else face.fps,
        emotion=max(emotions, key=lambda row: row[2] - row[1])[0] if emotions else take.emotion,
        semantics=semantics,
        split=take.split,
        extra={"speaker_number": take.number} | ({"emotions": emotions} if emotions else {}) | alone,
    )


def _load_face(path: Path) -> Motion:
    """The face track of a file; the body in it is not the take's."""
    from ...export import arkit_json

    face = arkit_json.load(path)
    if abs(face.fps - FACE_FPS) > 0.01 * FACE_FPS:
        raise InputError(f"{path.name!r} runs at {face.fps:g} frames per second where BEAT's faces have {FACE_FPS:g}")
    return face


def _on_floor(motion: Motion) -> Motion:
    """Hips that begin at the origin are lifted to their height in the T-pose."""
    if np.abs(motion.root[0]).max() > _START:
        return motion
    return replace(motion, root=motion.root + motion.skeleton.offsets[0] * (0.0, 1.0, 0.0))
