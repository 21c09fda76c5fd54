"""Several motion files in one command: what ``cospeech convert`` and ``cospeech render`` do with each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from ..errors import CospeechError, InputError, InternalError, say_count
from ..export import format_of
from ..export.checks import check_apart
from ..export.registry import reads_body, suffixes
from ..files import make_folders

__all__ = ["NAME", "MotionFile", "convert_each", "describe_failures", "find_motions", "match_pattern"]

NAME = "{name}"
"""Stands for the name of a speech or of a motion in the name of a file."""
_SHOWN = 3  # failures in one message


class MotionFile(NamedTuple):
    """A motion file, and what is written of it.

    Attributes:
        source: it is read.
        target: it is written.
        name: of ``source``, without suffix; what `NAME` stands for.
        named: whether `NAME` was in the target: its folder is made where it is missing.
    """

    source: Path
    target: Path
    name: str
    named: bool


def match_pattern(path: Path) -> list[Path] | None:
    """Files whose names match a pattern with ``*``, ``?`` or ``[``; None if the path is none, or a file of this very name.

    Raises:
        InputError: no file matches.
    """
    if path.exists() or not any(sign in path.name for sign in "*?["):
        return None
    found = [each for each in sorted(path.parent.glob(path.name)) if each.is_file()]
    if not found:
        raise InputError(f"no file is called {str(path)!r}", "is the pattern right?")
    return found


def find_motions(given: Sequence[Path], target: Path) -> list[MotionFile]:
    """Motion files, and the file to write of each.

    Args:
        given: files, patterns, and folders whose motion files are taken.
        target: the file to write; `NAME` in it stands for the name of a motion.

    Raises:
        InputError: a folder holds no motion, several motions would be written to one file, or one would overwrite another.
    """
    sources = list(dict.fromkeys(path for each in given for path in _list_files(each)))
    several, text = len(sources) > 1, str(target)
    if several and NAME not in text:
        problem = f"one file {text!r}" if target.suffix else f"no format in {text!r}"
        hint = f"'{NAME}{target.suffix}'" if target.suffix else f"'{target / NAME}.glb'"
        raise InputError(f"{problem} for {len(sources)} motions", f"{hint} writes one for each")
    found = [MotionFile(path, Path(text.replace(NAME, path.stem)), path.stem, NAME in text) for path in sources]
    if several:
        names: dict[str, Path] = {}
        for path, _, name, _ in found:
            if names.setdefault(name, path) != path:
                both = f"{str(names[name])!r} and {str(path)!r}"
                raise InputError(f"{both} are both called {name!r}", "name one of them, or rename it")
        format_of(target)
        check_apart([each.target for each in found], [*sources])
    return found


def _list_files(path: Path) -> list[Path]:
    """A file; the files of a pattern; the motion files of a folder."""
    if not path.is_dir():
        return match_pattern(path) or [path]
    readable = suffixes(reads_body)
    found = [each for each in sorted(path.iterdir()) if each.suffix.lower() in readable and each.is_file()]
    if not found:
        raise InputError(f"no motion file is in the folder {str(path)!r}", f"known: {' '.join(readable)}")
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
    told = [f"{path}: {error}" for path, error, _ in failed[:_SHOWN]]
    told += [f"and {len(failed) - _SHOWN} more"] if len(failed) > _SHOWN else []
    kind = InternalError if all(ours for _, _, ours in failed) else InputError
    return kind(f"{len(failed)} of {every} failed: {'; '.join(told)}", hint)
