"""Several files in one command: it finds the files of folders and patterns, names them, and converts motions one by one."""

from __future__ import annotations

import os
import unicodedata
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from glob import glob
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from ..audio.transcript_file import TranscriptFile
from ..errors import CospeechError, CospeechWarning, InputError, InternalError, say_count
from ..export import FORMATS, format_of
from ..export.checks import check_apart
from ..export.registry import reads_body, suffixes
from ..files import make_folders
from .options import NAME
from .unexpected import ends_work, explain

__all__ = [
    "NAME",
    "FoundFiles",
    "ListFolder",
    "MotionFile",
    "check_name",
    "convert_each",
    "describe_failures",
    "find_files",
    "find_motions",
    "put_name",
]

_MOST_ITEMS = 3  # failures, files or names in one message
_SIGNS = "*?["  # of a pattern

LeftOut = dict[Path, str]
"""File or folder that is left out → the reason."""
ListFolder = Callable[[Path, LeftOut], list[tuple[str, Path]]]
"""Returns (name, file) pairs of a folder, and adds to `LeftOut` what it leaves out."""


class FoundFiles(NamedTuple):
    """The files that a command works on.

    Attributes:
        files: name → file, in order.
        left_out: files beside them that are not used → the reason.
    """

    files: dict[str, Path]
    left_out: LeftOut


class MotionFile(NamedTuple):
    """A motion file, and the file to write from it.

    Attributes:
        source: the file to read.
        target: the file to write.
        name: name of ``source`` from `find_files`; it replaces `NAME`.
        has_placeholder: whether the target was given with `NAME` in it; then its folder is made if it is missing.
    """

    source: Path
    target: Path
    name: str
    has_placeholder: bool


def find_files(inputs: Iterable[Path], list_folder: ListFolder, what: str, endings: Iterable[str]) -> FoundFiles:
    """Find files, and give each a name. A file that is given twice counts once; notes tell what is left out.

    A name is a path without suffix. It is relative to the folder that was given, or to the folder before the first sign of a
    pattern: ``rec`` for ``rec/*/talk.wav``.

    Args:
        inputs: files, folders, and patterns of both, with ``*``, ``?``, ``[`` or ``**``.
        list_folder: lists the files of a folder.
        what: kind of the files, one word for messages.
        endings: their suffixes, for a hint.

    Raises:
        InputError: a folder holds no such file, nothing matches a pattern, or several files have the same name.
    """
    files, places = dict[str, list[Path]](), set[Path]()
    left_out: LeftOut = {}
    try:
        for each in inputs:
            name_paths = _list_files(each, list_folder, left_out)
            if not name_paths:
                raise InputError(f"no {what} file is in the folder {str(each)!r}", f"known: {' '.join(endings)}")
            for name, path in name_paths:
                place = Path(os.path.realpath(path.parent), path.name)  # a link to a file may be a file of its own
                if place not in places:
                    places.add(place)
                    files.setdefault(name, []).append(path)
    finally:
        _note_left_out(left_out)
    clashes = {name: paths for name, paths in files.items() if len({os.path.realpath(path) for path in paths}) > 1}
    if clashes:
        texts = [f"{' and '.join(repr(str(p)) for p in paths[:2])} are both called {name!r}" for name, paths in clashes.items()]
        raise InputError(_show_some(texts, "; "), _suggest_folder([path for paths in clashes.values() for path in paths]))
    return FoundFiles({name: paths[0] for name, paths in files.items()}, left_out)


def check_name(path: Path) -> Path:
    """Check that the name of a file can replace `NAME`, and return the file.

    Raises:
        InputError: the name has only dots and spaces, as that of ``...wav``. As the name of a folder, it would lead out of the
            folder for the outputs.
    """
    if path.stem and not path.stem.strip(" ."):
        raise InputError(f"{path.name!r} has no name before its suffix", "rename it")
    return path


def _list_files(path: Path, list_folder: ListFolder, left_out: LeftOut) -> list[tuple[str, Path]]:
    """Names and files of one argument: a file, a folder, or a pattern that the shell has not expanded.

    Raises:
        InputError: nothing matches the pattern.
    """
    if path.is_dir():
        return list_folder(path, left_out)
    if path.exists() or not any(sign in str(path) for sign in _SIGNS):
        return [(check_name(path).stem, path)]
    root = next(folder for folder in path.parents if folder.is_dir())  # names of existing folders may have such signs, too
    below = path.relative_to(root)
    if ".." in below.parts:  # names of files would lead out of the folder for the outputs
        raise InputError(f"'..' behind a sign of the pattern {str(path)!r}", "name the folder from its beginning")
    matches = [Path(text) for text in sorted(glob(str(below), root_dir=root, recursive=True))]  # noqa: PTH207  # as shells
    folders = [match for match in matches if (root / match).is_dir()]
    name_paths = [(Path(each, name).as_posix(), file) for each in folders for name, file in list_folder(root / each, left_out)]
    alone = [match for match in matches if (root / match).is_file() and not {*match.parents} & {*folders}]
    name_paths += [(check_name(match).with_suffix("").as_posix(), root / match) for match in alone]
    if not name_paths:
        what = f"the folders {str(path)!r} hold no such file" if folders else f"no file is called {str(path)!r}"
        raise InputError(what, "is the pattern right?")
    return name_paths


def _note_left_out(left_out: LeftOut) -> None:
    for why in dict.fromkeys(left_out.values()):
        paths = [str(path) for path in left_out if left_out[path] == why]
        warnings.warn(f"left out: {_show_some(paths, ', ')} ({why})", CospeechWarning, stacklevel=4)


def _show_some(texts: Sequence[str], between: str) -> str:
    more = [f"and {len(texts) - _MOST_ITEMS} more"] if len(texts) > _MOST_ITEMS else []
    return between.join([*texts[:_MOST_ITEMS], *more])


def _suggest_folder(paths: Sequence[Path]) -> str:
    """A hint for files of the same name: the folder above them, if their paths below it are different."""
    try:
        above = Path(os.path.commonpath([path.absolute() for path in paths]))
    except ValueError:  # on several drives
        above = Path(paths[0].anchor)
    names = {path.absolute().relative_to(above).with_suffix("") for path in paths} if above != Path(above.anchor) else set()
    if len(names) < len(paths):
        return "name one of them, or rename it"
    folder = above if paths[0].is_absolute() else os.path.relpath(above)
    return f"name the folder above them, {str(folder)!r}: names then begin with the folders below it; or rename them"


def put_name(file: str | PathLike[str], name: str) -> str | PathLike[str]:
    """The file to read for a name: ``file`` with the name in place of `NAME`.

    Systems write accents in two ways: as one letter (é), or as a letter and a sign, as macOS once did. Both ways are tried.
    """
    if isinstance(file, TranscriptFile):
        return replace(file, path=put_name(file.path, name), tier=file.tier.replace(NAME, name))
    text = os.fspath(file)
    ways = (name, unicodedata.normalize("NFC", name), unicodedata.normalize("NFD", name))
    paths = [text.replace(NAME, way) for way in ways]
    return next((path for path in paths if os.path.lexists(path)), paths[0])


def find_motions(inputs: Sequence[Path], target: Path) -> list[MotionFile]:
    """Find motion files, and the file to write for each.

    Args:
        inputs: files, patterns, and folders. A folder stands for the motion files in it and in the folders below it.
        target: the file to write; `NAME` in it stands for the name of a motion.

    Raises:
        InputError: as of `find_files`; or several motions share a target, or a target is one of the motions.
    """
    files, left_out = find_files(inputs, _list_motions, "motion", suffixes(reads_body))
    several, text = len(files) > 1, str(target)
    if several and NAME not in text:
        problem = f"one file {text!r}" if target.suffix else f"no format in {text!r}"
        hint = f"'{NAME}{target.suffix}'" if target.suffix else f"'{target / NAME}.glb'"
        raise InputError(f"{problem} for {len(files)} motions", f"{hint} writes one for each")
    motions = [MotionFile(path, Path(text.replace(NAME, name)), name, NAME in text) for name, path in files.items()]
    if several or left_out:
        format_of(target)
        check_apart([each.target for each in motions], [*files.values(), *left_out])
    return motions


def _list_motions(folder: Path, left_out: LeftOut) -> list[tuple[str, Path]]:
    """Motion files of a folder. If several have the same name, the one that holds most parts of a character is taken."""
    from ..corpora.clip import Dropped
    from ..corpora.folder import group_files

    order = sorted(suffixes(reads_body), key=lambda suffix: -len(FORMATS[suffix].holds))  # equal ones in the order of FORMATS
    name_paths: list[tuple[str, Path]] = []
    omissions: list[Dropped] = []
    for name, files in group_files(folder, omissions):
        motions = [path for suffix in order for path in files.get(suffix, ())]
        name_paths += [(name, path) for path in motions[:1]]
        left_out |= dict.fromkeys(motions[1:], f"of files of one name the first is taken: {' '.join(order)}")
    left_out |= {folder / item.name: item.reason for item in omissions}
    return name_paths


def convert_each(motions: Sequence[MotionFile], convert: Callable[[MotionFile], None]) -> None:
    """Convert motion files one after the other. An error in one of several does not stop the others, unless it ends all work.

    Raises:
        InputError: some could not be converted; the message names them.
    """
    failures = list[tuple[str, str, bool]]()
    for each in motions:
        try:
            with make_folders({each.target.parent} if each.has_placeholder else ()):
                convert(each)
        except Exception as error:
            if len(motions) == 1 or ends_work(error):
                raise
            own = explain(error, "convert")
            failures.append((str(each.source), str(own), isinstance(own, InternalError)))
    if failures:
        hint = "the others are done" if len(failures) < len(motions) else ""
        raise describe_failures(failures, say_count(len(motions), "motion"), hint)


def describe_failures(failures: Sequence[tuple[str, str, bool]], every: str, hint: str) -> CospeechError:
    """The error of a command that failed for some of several files.

    Args:
        failures: for each, the file, its error, and whether the fault is ours and not the file's.
        every: how many files there were, in words.
        hint: of the error.
    """
    text = _show_some([f"{path}: {error}" for path, error, _ in failures], "; ")
    kind = InternalError if all(ours for _, _, ours in failures) else InputError
    return kind(f"{len(failures)} of {every} failed: {text}", hint)
