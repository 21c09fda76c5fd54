"""Motion files of a folder, found by the names of clips."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from ..errors import InputError
from ..motion.motion import Motion

__all__ = ["SUFFIXES", "RecordingPart", "load_motions"]

SUFFIXES = (".bvh", ".npz")
"""Suffixes of the files that are looked for; where both are there for one take of a clip, the first counts."""
_MOST_NAMES = 3  # names in a message

_Takes = dict[int, Path]


class RecordingPart(NamedTuple):
    """What a store calls ``LJ001@50``: a recording, the frame with which the part begins, and how many frames it has."""

    recording: str
    start: int
    frames: int


def load_motions(
    folder: str | PathLike[str], names: Sequence[str], parts: Mapping[str, RecordingPart] | None = None, fps: float = 30.0
) -> dict[str, list[Motion]]:
    """Motions of a folder by clip name: ``NAME.bvh`` or ``NAME.npz``, and further takes as ``NAME.2.bvh`` and so on.

    A clip called ``me/LJ001`` is ``me/LJ001.bvh`` in the folder or in folders below it; or ``LJ001.bvh``, where no other clip
    or file is called so. The other way round, ``me/LJ001.bvh`` may hold a clip called ``LJ001``.

    Args:
        folder: of the files.
        names: of the clips.
        parts: clips that are parts of recordings; where one has no file of its own, it is cut from that of the recording.
        fps: frames per second of the parts.

    Raises:
        InputError: the folder does not exist, a clip has no file or more than one, or one cannot be read.
    """
    place, parts = Path(folder), parts or {}
    if not place.is_dir():
        raise InputError(f"there is no folder {str(folder)!r}", "name the folder of a system's motions")
    every = {*names, *(part.recording for part in parts.values())}
    files = _files(place, sorted(every))
    if not files:
        raise InputError(f"no motion is in the folder {str(folder)!r}", f"{' or '.join(SUFFIXES)} files, named as the clips")
    by_end, names_by_end = _by_end(files), _by_end(every)

    def match(name: str) -> list[str]:
        return _match(name, by_end[_end(name)], names_by_end[_end(name)])

    clip_files = {name: match(name) for name in names}
    whole = {name: parts[name] for name in names if name in parts and not clip_files[name]}
    clip_files |= {name: match(part.recording) for name, part in whole.items()}
    _check_complete(str(folder), clip_files, files)
    at_rate = cache(lambda path: Motion.load(path).resample(fps))  # one recording has many parts

    def load(name: str) -> list[Motion]:
        takes = [path for _, path in sorted(files[clip_files[name][0]].items())]
        if name not in whole:
            return [Motion.load(path) for path in takes]
        _, start, frames = whole[name]
        return [at_rate(path)[start : start + frames] for path in takes]

    return {name: load(name) for name in names}


def _files(place: Path, names: Sequence[str]) -> dict[str, _Takes]:
    """Path below the folder, without suffix and number → its takes; of the folder and those below it, but no hidden ones."""
    takes: dict[str, _Takes] = defaultdict(dict)
    decimal_names = [name for name in names if name.rpartition(".")[2].isdecimal()]
    paths = [path for path in sorted(place.rglob("*")) if path.suffix.lower() in SUFFIXES and path.is_file()]
    for path in sorted(paths, key=lambda path: SUFFIXES.index(path.suffix.lower())):
        below = path.relative_to(place)
        if any(part.startswith(".") for part in below.parts):
            continue
        name = below.with_suffix("").as_posix()
        stem, _, number = name.rpartition(".")
        take = number.isdecimal() and bool(stem) and not any(_ends(name, n) or _ends(n, name) for n in decimal_names)
        takes[stem if take else name].setdefault(int(number) if take else 0, path)
    return takes


def _end(name: str) -> str:
    """The last part of a path."""
    return name.rpartition("/")[2]


def _by_end(names: Iterable[str]) -> dict[str, list[str]]:
    """Last part → the paths that end so."""
    groups: dict[str, list[str]] = defaultdict(list)
    for name in names:
        groups[_end(name)].append(name)
    return groups


def _ends(long: str, short: str) -> bool:
    """Whether a path is the end of another one, whole parts each."""
    return long == short or long.endswith(f"/{short}")


def _match(name: str, files: Sequence[str], names: Sequence[str]) -> list[str]:
    """The files of a clip, among those whose last part is the clip's: first by the whole name, else deeper in the folder, else
    by the end of the name, if no other clip could mean the same file.
    """
    if name in files:
        return [name]
    deeper = [file for file in files if _ends(file, name)]
    ends = [file for file in files if _ends(name, file) and sum(_ends(other, file) for other in names) == 1]
    return deeper or ends


def _check_complete(folder: str, clip_files: dict[str, list[str]], files: dict[str, _Takes]) -> None:
    """Every clip has one file."""
    several = {name: matches for name, matches in clip_files.items() if len(matches) > 1}
    for name, matches in several.items():
        listing = _some([str(files[match][min(files[match])].relative_to(folder)) for match in matches])
        raise InputError(f"several files in {folder!r} could be clip {name!r}: {listing}", f"call it {name}{SUFFIXES[0]}")
    missing = [name for name, matches in clip_files.items() if not matches]
    if missing:
        problem = (
            f"no motion for {len(missing)} of {len(clip_files)} clips in {folder!r}: {_some([repr(name) for name in missing])}"
        )
        there = _some([str(next(iter(takes.values())).relative_to(folder)) for takes in files.values()])
        raise InputError(problem, f"{' or '.join(missing[0] + suffix for suffix in SUFFIXES)}; there is {there}")


def _some(names: Sequence[str]) -> str:
    """The first names, and how many more there are."""
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return f"{', '.join(names[:_MOST_NAMES])}{more}"
