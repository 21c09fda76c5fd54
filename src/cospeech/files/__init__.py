"""Open and write files: only regular files are opened, reading stops at a limit, and a file is written whole or not at all.

A new file is written in a hidden folder, and gets its name at the end (`cospeech.files.workplaces`).

JSON and TOML are checked before a library parses them. JSON takes thirty bytes of memory for each byte of text. The time for a
TOML key grows with the square of its parts.
"""

from __future__ import annotations

import errno
import json
import os
import re
import stat
import tomllib
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

from ..errors import InputError
from ..limits import TOML_DOTS
from .workplaces import ABANDONED, PREFIX, scratch, sweep, workplace

__all__ = [
    "ABANDONED", "PREFIX", "all_or_none", "atomic", "check_destination", "describe_os_error", "make_folders", "open_regular",
    "parse_json", "parse_toml", "read_regular", "regular_file", "repair_text", "scratch", "sweep", "workplace",
]  # fmt: skip

_SOUND_FILE = "a sound file"
_MAY_WRITE = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH
_FORBIDDEN = (errno.EACCES, errno.EPERM, errno.EROFS)
_STANDARD_INPUT = ("/dev/stdin", "/dev/fd/0", "/proc/self/fd/0")  # names of ours; a decoder has another one
_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+:/", re.IGNORECASE)  # https://, of which a path has one slash; C:/ is a drive
_REPLACES_OPEN = os.name != "nt"  # Windows lets no file take the name of one that a program has open


def describe_os_error(error: OSError) -> str:
    """A short reason: "No such file or directory", "Permission denied", …"""
    return error.strerror or type(error).__name__


def repair_text(text: str) -> str:
    """Make a text that can be written: in names of files, Python keeps bytes that are not UTF-8 as half characters
    (surrogates).

    >>> repair_text("Zo\\udcc3\\udcab, Zo\\udceb")
    'Zoë, Zo�'
    """
    try:
        data = text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:  # names of Windows may hold any surrogate
        data = text.encode("utf-8", "replace")
    return data.decode("utf-8", "replace")


# opening --------------------------------------------------------------------------------------------------------------


def regular_file(path: str | PathLike[str], what: str = _SOUND_FILE) -> Path:
    """The absolute path of a regular file that is not empty.

    Args:
        path: as the user gave it.
        what: in words, for the hint.

    Raises:
        InputError: it is missing, a folder, a pipe, a device or empty, or it may not be read.
    """
    name = os.fsdecode(path)
    if name in _STANDARD_INPUT and what == _SOUND_FILE:
        raise InputError(f"cannot read {name!r}: it is standard input", "name it -, as in `cospeech generate - -o talk.bvh`")
    try:
        about = Path(name).stat()
    except (OSError, ValueError) as error:
        reason = describe_os_error(error) if isinstance(error, OSError) else str(error)
        if _ADDRESS.match(name):
            raise InputError(f"cannot read {name!r}: it is an address", "download the file, and name it") from None
        raise InputError(f"cannot read {name!r}: {reason}", "is the name right?") from None
    if stat.S_ISDIR(about.st_mode):
        raise InputError(f"cannot read {name!r}: it is a folder", f"name {what}")
    if not stat.S_ISREG(about.st_mode):
        raise InputError(f"cannot read {name!r}: it is a pipe or a device", "save it to a file first")
    if about.st_size == 0:
        raise InputError(f"{name!r} is empty", "was it saved, recorded or downloaded to its end?")
    if not os.access(name, os.R_OK):
        raise InputError(f"cannot read {name!r}: Permission denied", "may you read it?")
    return Path(name).absolute()


def open_regular(path: str | PathLike[str], what: str, limit: int) -> BinaryIO:
    """A regular file of at most ``limit`` bytes, open for reading.

    Raises:
        InputError: as of `regular_file`, or the file is larger; the message states the limit.
    """
    file = regular_file(path, what)
    try:
        size = file.stat().st_size
        if size > limit:
            size_limit = f"{limit >> 20} MiB" if limit >= 1 << 20 else f"{limit >> 10} KiB"
            raise InputError(f"{os.fsdecode(path)!r} is larger than {size_limit}: {size:,} bytes", f"is it {what}?")
        return file.open("rb")
    except OSError as error:
        raise InputError(f"cannot read {os.fsdecode(path)!r}: {describe_os_error(error)}", "may you read it?") from None


def read_regular(path: str | PathLike[str], what: str, limit: int) -> bytes:
    """The whole of a regular file of at most ``limit`` bytes (see `open_regular`)."""
    with open_regular(path, what, limit) as file:
        try:
            return file.read(os.fstat(file.fileno()).st_size)  # not the limit: read() would take so much memory at once
        except OSError as error:
            raise InputError(f"cannot read {os.fsdecode(path)!r}: {describe_os_error(error)}", "may you read it?") from None


# parsing --------------------------------------------------------------------------------------------------------------


def parse_json(text: str | bytes, name: str, most: int) -> Any:
    """Parse a JSON document whose numbers are finite.

    Args:
        text: of the document.
        name: how messages call the file.
        most: how many values it may have; commas and brackets are counted.

    Raises:
        InputError: it is not JSON, is nested too deeply, holds NaN or infinity, or has more values.
    """
    if len(text) > most and _values(text) > most:
        raise InputError(f"{name} has more than {most:,} values", "cut it into pieces")

    def refuse(constant: str) -> NoReturn:
        raise InputError(f"{name} holds {constant}{_field_of(text, constant)}", "only finite numbers can be read")

    def read_large(number: str) -> float:
        return float(number) if isfinite(float(number)) else refuse(number[:20])

    is_large = _LARGE.search(text) if isinstance(text, str) else _LARGE_BYTES.search(text)
    try:
        return json.loads(text, parse_constant=refuse, parse_float=read_large if is_large else None)
    except InputError:
        raise
    except ValueError as error:  # JSONDecodeError, UnicodeDecodeError, integers of too many digits
        raise InputError(f"{name} is not JSON: {error}"[:200], "is it cut off?") from None
    except RecursionError:
        raise InputError(f"{name} is nested too deeply", "is it damaged?") from None


_LARGE = re.compile(r"[eE]\+?\d{3}|\d{300}")
"""What is in a JSON document whose numbers may be beyond all floats; a hook for every number would slow all others."""
_LARGE_BYTES = re.compile(_LARGE.pattern.encode())


def _field_of(text: str | bytes, constant: str) -> str:
    """The field that holds a constant, for a message; empty where it is not known."""
    read = text if isinstance(text, str) else text.decode("utf-8", "replace")
    match = re.search(rf'"(\w{{1,60}})"\s*:\s*(?:\[[^][{{}}"]*)?{re.escape(constant)}', read)
    return f" in {match[1]!r}" if match else ""


def _values(text: str | bytes) -> int:
    if isinstance(text, str):
        return sum(text.count(mark) for mark in ",[{")
    return sum(text.count(mark) for mark in b",[{")


def parse_toml(data: bytes, name: str, hint: str) -> dict[str, Any]:
    """Parse a TOML document.

    Raises:
        InputError: it is not UTF-8 or not TOML, or a line has more dots than any key or list needs.
    """
    try:
        text = data.decode("utf-8")
        for number, line in enumerate(text.split("\n"), 1):
            if line.count(".") > TOML_DOTS:
                raise InputError(f"{name}: line {number} has more than {TOML_DOTS} dots", "is it damaged?")
        return tomllib.loads(text)
    except InputError:
        raise
    except (ValueError, RecursionError) as error:  # TOML and UTF-8 errors are ValueErrors
        raise InputError(f"{name} is not TOML: {(str(error) or 'nested too deeply').splitlines()[0]}"[:200], hint) from None


# writing --------------------------------------------------------------------------------------------------------------


def _destination(path: str | PathLike[str]) -> Path:
    """The real path of a file that is to be written: links are followed, and stay links.

    Raises:
        InputError: the path is a folder, a pipe, a device, a read-only file or a file in use, or no file can have that name.
    """
    name = os.fsdecode(path)
    try:
        mode = Path(name).stat().st_mode
    except FileNotFoundError:
        mode = stat.S_IFREG | _MAY_WRITE
    except (OSError, ValueError) as error:  # ValueError: it holds a null character
        reason = describe_os_error(error) if isinstance(error, OSError) else str(error)
        raise InputError(f"cannot write {name!r}: {reason}", "is the name right?") from None
    if stat.S_ISDIR(mode):
        raise InputError(f"cannot write {name!r}: it is a folder", "name a file")
    if not stat.S_ISREG(mode):
        raise InputError(f"cannot write {name!r}: it is a pipe or a device", "name a file")
    if not mode & _MAY_WRITE:  # a rename ignores these bits; they count for root, too, who could write
        raise InputError(f"cannot write {name!r}: the file is read-only", "name another file, or make this one writable")
    destination = Path(os.path.realpath(name))
    _check_free(destination, name)
    return destination


def _check_free(destination: Path, name: str) -> None:
    """Check that a file can be replaced, if there is one.

    Raises:
        InputError: another program has it open, and the system replaces no open file.
    """
    if not _REPLACES_OPEN and destination.exists():
        with _explain_refusal(name):
            destination.rename(destination)  # needs the same right as to replace it, and changes nothing


@contextmanager
def _explain_refusal(name: str) -> Iterator[None]:
    try:
        yield
    except PermissionError as error:
        hint = "does another program have it open? close it there, or name another file"
        raise InputError(f"cannot write {name!r}: {describe_os_error(error)}", hint) from None


def check_destination(path: str | PathLike[str]) -> None:
    """Check that a file can be written there, before the work begins; `atomic` would find out after it.

    Raises:
        InputError: as of `atomic`.
    """
    with ExitStack() as stack:
        _workplace(stack, _destination(path).parent, path)


@contextmanager
def atomic(path: str | PathLike[str]) -> Iterator[Path]:
    """Yield the path of an empty temporary file beside ``path``; the file gets the name ``path`` if the block succeeds.

    On any exception, Ctrl-C included, the temporary file is removed and ``path`` stays as it was. Where ``path`` is a link,
    the file that it points to is written.

    Raises:
        InputError: the folder does not exist or cannot be written, or no file can be written there.
    """
    target = _destination(path)
    with ExitStack() as stack:
        temporary = _workplace(stack, target.parent, path) / f"0{Path(path).suffix[-20:]}"
        temporary.touch()
        rights = stat.S_IMODE(temporary.stat().st_mode)  # those of a new file here; a writer may replace the file
        try:
            yield temporary
        except OSError as error:
            if _is_in(error.filename, temporary.parent) or (not error.filename and _is_stuck(temporary)):
                raise OSError(error.errno, describe_os_error(error), os.fsdecode(path)) from error
            raise
        temporary.chmod(rights)
        with _explain_refusal(os.fsdecode(path)):
            temporary.replace(target)


def _is_in(name: object, folder: Path) -> bool:
    """Whether the file that an error names lies in a folder; writers have other files beside the temporary one."""
    return isinstance(name, str | bytes) and folder in Path(os.fsdecode(name)).parents


def _is_stuck(path: Path) -> bool:
    """Whether a file can grow no more, as on a full disk; an error of writing to an open file does not name the file."""
    with suppress(OSError), path.open("ab") as file:
        return file.write(bytes(1 << 16)) == 0
    return True


@contextmanager
def all_or_none(targets: Iterable[Path]) -> Iterator[Callable[[Path], Path]]:
    """Yield a function that gives the temporary path of a target; all targets appear when the block succeeds.

    Files wait in a folder beside their target, so that the last step is a rename on one file system.

    Raises:
        InputError: a folder does not exist or cannot be written, or no file can be written there.
    """
    folders: dict[Path, Path] = {}
    destinations: dict[Path, Path] = {}
    temporaries: dict[Path, Path] = {}

    def place(target: Path) -> Path:
        name = f"{len(temporaries)}{target.suffix[-20:]}"  # not the target's name: two links may have the same one
        temporaries[target] = folders[destinations[target].parent] / name
        return temporaries[target]

    with ExitStack() as stack:
        for target in targets:
            destination = destinations[target] = _destination(target)
            if destination.parent not in folders:
                folders[destination.parent] = _workplace(stack, destination.parent, target)
        try:
            yield place
        except OSError as error:
            for target, path in temporaries.items():
                if str(path) == error.filename:
                    raise OSError(error.errno, describe_os_error(error), str(target)) from error
            raise
        for target in temporaries:  # if another program has opened one meanwhile, none appears
            _check_free(destinations[target], str(target))
        for target, path in temporaries.items():
            with _explain_refusal(str(target)):
                path.replace(destinations[target])


def _workplace(stack: ExitStack, folder: Path, target: str | PathLike[str]) -> Path:
    """A `workplace` in the folder of a target, open as long as the stack is.

    Raises:
        InputError: the folder does not exist or cannot be written.
    """
    try:
        return stack.enter_context(workplace(folder))
    except OSError as error:
        problem = f"cannot write {os.fsdecode(target)!r}: {describe_os_error(error)}"
        hint = "does the folder exist?"
        if folder.is_dir():
            hint = "may you write into this folder?" if error.errno in _FORBIDDEN else ""
        raise InputError(problem, hint) from None


# folders --------------------------------------------------------------------------------------------------------------


@contextmanager
def make_folders(folders: Iterable[Path]) -> Iterator[None]:
    """Make folders for the block; new ones stay if it succeeds, and are removed if it fails.

    Raises:
        InputError: one cannot be made.
    """
    missing = [path for folder in folders for path in (folder, *folder.parents) if not path.exists()]
    try:
        for folder in folders:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputError(f"cannot make {str(folder)!r}: {describe_os_error(error)}", "is the name right?") from None
        yield
    except BaseException:
        for folder in missing:
            with suppress(OSError):  # something else is in it
                folder.rmdir()
        raise
