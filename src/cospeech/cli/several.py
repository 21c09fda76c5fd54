"""Several files in one command: what is given as files, folders and patterns, by name; and motions, one after the other."""

from __future__ import annotations

import os
import unicodedata
import warnings
from collections.abc import Callable, Iterable, Sequence
from glob import glob
from pathlib import Path
from typing import NamedTuple

from ..errors import CospeechError, CospeechWarning, InputError, InternalError, say_count
from ..export import FORMATS, format_of
from ..export.checks import check_apart
from ..export.registry import reads_body, suffixes
from ..files import make_folders
from .options import NAME

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

_SHOWN = 3  # failures, files or names in one message
_SIGNS = "*?["  # of a pattern

LeftOut = dict[Path, str]
"""What is left out of a folder, and why."""
ListFolder = Callable[[Path, LeftOut], list[tuple[str, Path]]]
"""Gives names and files in a folder, and adds what is left out there."""


class FoundFiles(NamedTuple):
    """What was given to a command.

    Attributes:
        files: name → file, in order.
        left_out: files beside them that are not used, and why.
    """

    files: dict[str, Path]
    left_out: LeftOut


class MotionFile(NamedTuple):
    """A motion file, and what is written of it.

    Attributes:
        source: it is read.
        target: it is written.
        name: of ``source``, as `find_files` gives it; what `NAME` stands for.
        named: whether `NAME` was in the target: its folder is made where it is missing.
    """

    source: Path
    target: Path
    name: str
    named: bool


def find_files(given: Iterable[Path], list_folder: ListFolder, what: str, known: Iterable[str]) -> FoundFiles:
    """Files by their names. A file that is given twice counts once; a note tells what is left out.

    A name has no suffix. It is the path below the folder that was given, or below the one in which a pattern is looked up:
    of ``rec/*/talk.wav`` that is ``rec``.

    Args:
        given: files, folders, and patterns of either, with ``*``, ``?``, ``[`` or ``**``.
        list_folder: gives the files of a folder.
        what: the files are, in a word.
        known: their suffixes, for a hint.

    Raises:
        InputError: a folder holds no such file, nothing matches a pattern, or several files have one name.
    """
    found, seen = dict[str, list[Path]](), set[Path]()
    left_out: LeftOut = {}
    try:
        for each in given:
            named = _list_files(each, list_folder, left_out)
            if not named:
                raise InputError(f"no {what} file is in the folder {str(each)!r}", f"known: {' '.join(known)}")
            for name, path in named:
                place = Path(os.path.realpath(path.parent), path.name)  # a link to a file may be a file of its own
                if place not in seen:
                    seen.add(place)
                    found.setdefault(name, []).append(path)
    finally:
        _note_left_out(left_out)
    clashes = {name: paths for name, paths in found.items() if len({os.path.realpath(path) for path in paths}) > 1}
    if clashes:
        told = [f"{' and '.join(repr(str(p)) for p in paths[:2])} are both called {name!r}" for name, paths in clashes.items()]
        raise InputError(_show_some(told, "; "), _suggest_folder([path for paths in clashes.values() for path in paths]))
    return FoundFiles({name: paths[0] for name, paths in found.items()}, left_out)


def check_name(path: Path) -> Path:
    """The same file, if `NAME` can stand for its name.

    Raises:
        InputError: it is called nothing but dots and spaces, as ``...wav`` is. As the name of a folder, that leads out of the
            one that is written to.
    """
    if path.stem and not path.stem.strip(" ."):
        raise InputError(f"{path.name!r} has no name before its suffix", "rename it")
    return path


def _list_files(path: Path, list_folder: ListFolder, left_out: LeftOut) -> list[tuple[str, Path]]:
    """Names and files of what was given: a file, a folder, or a pattern that the shell has not looked up.

    Raises:
        InputError: nothing matches the pattern.
    """
    if path.is_dir():
        return list_folder(path, left_out)
    if path.exists() or not any(sign in str(path) for sign in _SIGNS):
        return [(check_name(path).stem, path)]
    root = next(folder for folder in path.parents if folder.is_dir())  # what is there may have such signs in its name
    below = path.relative_to(root)
    if ".." in below.parts:  # names of files would lead out of the folder that is written to
        raise InputError(f"'..' behind a sign of the pattern {str(path)!r}", "name the folder from its beginning")
    matches = [Path(text) for text in sorted(glob(str(below), root_dir=root, recursive=True))]  # noqa: PTH207  # as shells
    folders = [match for match in matches if (root / match).is_dir()]
    found = [(Path(each, name).as_posix(), file) for each in folders for name, file in list_folder(root / each, left_out)]
    alone = [match for match in matches if (root / match).is_file() and not {*match.parents} & {*folders}]
    found += [(check_name(match).with_suffix("").as_posix(), root / match) for match in alone]
    if not found:
        what = f"the folders {str(path)!r} hold no such file" if folders else f"no file is called {str(path)!r}"
        raise InputError(what, "is the pattern right?")
    return found


def _note_left_out(left_out: LeftOut) -> None:
    for why in dict.fromkeys(left_out.values()):
        paths = [str(path) for path in left_out if left_out[path] == why]
        warnings.warn(f"left out: {_show_some(paths, ', ')} ({why})", CospeechWarning, stacklevel=4)


def _show_some(texts: Sequence[str], between: str) -> str:
    more = [f"and {len(texts) - _SHOWN} more"] if len(texts) > _SHOWN else []
    return between.join([*texts[:_SHOWN], *more])


def _suggest_folder(paths: Sequence[Path]) -> str:
    """A hint for files of one name: the folder above them, where they have different names below it."""
    try:
        above = Path(os.path.commonpath([path.absolute() for path in paths]))
    except ValueError:  # on several drives
        above = Path(paths[0].anchor)
    names = {path.absolute().relative_to(above).with_suffix("") for path in paths} if above != Path(above.anchor) else set()
    if len(names) < len(paths):
        return "name one of them, or rename it"
    shown = above if paths[0].is_absolute() else os.path.relpath(above)
    return f"name the folder above them, {str(shown)!r}: names then begin with the folders below it; or rename them"


def put_name(text: str, name: str) -> str:
    """The file that is read where `NAME` stands for a name.

    Systems write accents in two ways: as a letter of its own (é), or as a letter and a sign, as macOS once did. A file is found
    in either way.
    """
    ways = (name, unicodedata.normalize("NFC", name), unicodedata.normalize("NFD", name))
    paths = [text.replace(NAME, way) for way in ways]
    return next((path for path in paths if os.path.lexists(path)), paths[0])


def find_motions(given: Sequence[Path], target: Path) -> list[MotionFile]:
    """Motion files, and the file to write of each.

    Args:
        given: files, patterns, and folders whose motion files are taken, those in folders below too.
        target: the file to write; `NAME` in it stands for the name of a motion.

    Raises:
        InputError: as of `find_files`; or several motions would be written to one file, or over a motion.
    """
    found, left_out = find_files(given, _list_motions, "motion", suffixes(reads_body))
    several, text = len(found) > 1, str(target)
    if several and NAME not in text:
        problem = f"one file {text!r}" if target.suffix else f"no format in {text!r}"
        hint = f"'{NAME}{target.suffix}'" if target.suffix else f"'{target / NAME}.glb'"
        raise InputError(f"{problem} for {len(found)} motions", f"{hint} writes one for each")
    motions = [MotionFile(path, Path(text.replace(NAME, name)), name, NAME in text) for name, path in found.items()]
    if several or left_out:
        format_of(target)
        check_apart([each.target for each in motions], [*found.values(), *left_out])
    return motions


def _list_motions(folder: Path, left_out: LeftOut) -> list[tuple[str, Path]]:
    """Motion files of a folder; of one name, that which holds most parts of a character."""
    from ..corpora.clip import Dropped
    from ..corpora.folder import group_files

    order = sorted(suffixes(reads_body), key=lambda suffix: -len(FORMATS[suffix].holds))  # of equals, as the formats
    found: list[tuple[str, Path]] = []
    dropped: list[Dropped] = []
    for name, files in group_files(folder, dropped):
        motions = [path for suffix in order for path in files.get(suffix, ())]
        found += [(name, path) for path in motions[:1]]
        left_out |= dict.fromkeys(motions[1:], f"of files of one name the first is taken: {' '.join(order)}")
    left_out |= {folder / item.name: item.reason for item in dropped}
    return found


def convert_each(motions: Sequence[MotionFile], convert: Callable[[MotionFile], None]) -> None:
    """Convert motion files one after the other; what is wrong with one of several does not keep back the others.

    Raises:
        InputError: some could not be converted; the message names them.
    """
    failed = list[tuple[str, str, bool]]()
    for each in motions:
        try:
            with make_folders({each.target.parent} if each.named else ()):
                convert(each)
        except CospeechError as error:
            if len(motions) == 1:
                raise
            failed.append((str(each.source), str(error), isinstance(error, InternalError)))
    if failed:
        hint = "the others are done" if len(failed) < len(motions) else ""
        raise describe_failures(failed, say_count(len(motions), "motion"), hint)


def describe_failures(failed: Sequence[tuple[str, str, bool]], every: str, hint: str) -> CospeechError:
    """The error of a command by which nothing came of some of several files.

    Args:
        failed: of each: the file, the error, and whether we failed although the file was fine.
        every: how many files there were, in words.
        hint: of the error.
    """
    told = _show_some([f"{path}: {error}" for path, error, _ in failed], "; ")
    kind = InternalError if all(ours for _, _, ours in failed) else InputError
    return kind(f"{len(failed)} of {every} failed: {told}", hint)
