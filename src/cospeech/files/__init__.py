"""Files: only real ones are opened, and never more is read than is due; no half of one is ever left behind.

Files are made in hidden folders before they get their names (`cospeech.files.workplaces`).

JSON and TOML are looked over before a library parses them: JSON takes thirty bytes of memory for one of text, and a TOML key
takes the square of its parts in time.
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
_STANDARD_INPUT = ("/dev/stdin", "/dev/fd/0", "/proc/self/fd/0")  # what systems call it; a decoder of ours has another one
_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+:/", re.IGNORECASE)  # https://; a path has lost a slash; C:/ is a drive
_REPLACES_OPEN = os.name != "nt"  # Windows lets no file take the name of one that a program has open


def describe_os_error(error: OSError) -> str:
    """A short reason: "No such file or directory", "Permission denied", …"""
    return error.strerror or type(error).__name__


def repair_text(text: str) -> str:
    """A text that can be written: in names of files, Python keeps bytes that are no UTF-8 as halves of characters.

    >>> repair_text("Zo\\udcc3\\udcab, Zo\\udceb")
    'Zoë, Zo�'
    """
    try:
        data = text.encode("utf-8", "surrogateescape")
    except UnicodeEncodeError:  # names of Windows may hold any half
        data = text.encode("utf-8", "replace")
    return data.decode("utf-8", "replace")


# opening --------------------------------------------------------------------------------------------------------------


def regular_file(path: str | PathLike[str], what: str = _SOUND_FILE) -> Path:
    """The path, made absolute, if a regular file with something in it is there.

    Args:
        path: as the user gave it.
        what: in words, for the hint.

    Raises:
        InputError: missing, a folder, a pipe or a device, empty, or it may not be read.
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
        InputError: as of `regular_file`, or it is larger; the limit is stated.
    """
    file = regular_file(path, what)
    try:
        size = file.stat().st_size
        if size > limit:
            shown = f"{limit >> 20} MiB" if limit >= 1 << 20 else f"{limit >> 10} KiB"
            raise InputError(f"{os.fsdecode(path)!r} is larger than {shown}: {size:,} bytes", f"is it {what}?")
        return file.open("rb")
    except OSError as error:
        raise InputError(f"cannot read {os.fsdecode(path)!r}: {describe_os_error(error)}", "may you read it?") from None


def read_regular(path: str | PathLike[str], what: str, limit: int) -> bytes:
    """The whole of a regular file of at most ``limit`` bytes (see `open_regular`)."""
    with open_regular(path, what, limit) as file:
        try:
            return file.read(os.fstat(file.fileno()).st_size)  # not the limit: so much memory would be taken at once
        except OSError as error:
            raise InputError(f"cannot read {os.fsdecode(path)!r}: {describe_os_error(error)}", "may you read it?") from None


# parsing --------------------------------------------------------------------------------------------------------------


def parse_json(text: str | bytes, name: str, most: int) -> Any:
    """A JSON document whose numbers are finite.

    Args:
        text: of the document.
        name: how messages call the file.
        most: how many values it may have, told by its commas and brackets.

    Raises:
        InputError: not JSON, nested too deeply, NaN or infinity in it, or more values.
    """
    if len(text) > most and _values(text) > most:
        raise InputError(f"{name} has more than {most:,} values", "cut it into pieces")

    def refuse(constant: str) -> NoReturn:
        raise InputError(f"{name} holds {constant}{_field_of(text, constant)}", "only finite numbers can be read")

    try:
        return json.loads(text, parse_constant=refuse)
    except InputError:
        raise
    except ValueError as error:  # JSONDecodeError, UnicodeDecodeError, integers of too many digits
        raise InputError(f"{name} is not JSON: {error}"[:200], "is it cut off?") from None
    except RecursionError:
        raise InputError(f"{name} is nested too deeply", "is it damaged?") from None


def _field_of(text: str | bytes, constant: str) -> str:
    """In which field a constant stands, for a message; nothing where that is not known."""
    read = text if isinstance(text, str) else text.decode("utf-8", "replace")
    found = re.search(rf'"(\w{{1,60}})"\s*:\s*(?:\[[^][{{}}"]*)?{constant}', read)
    return f" in {found[1]!r}" if found else ""


def _values(text: str | bytes) -> int:
    if isinstance(text, str):
        return sum(text.count(mark) for mark in ",[{")
    return sum(text.count(mark) for mark in b",[{")


def parse_toml(data: bytes, name: str, hint: str) -> dict[str, Any]:
    """A TOML document.

    Raises:
        InputError: not UTF-8, not TOML, or a line has more dots than any key or list needs.
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
    """Where a file to be written really lies: at the end of links, which stay links.

    Raises:
        InputError: a folder, a pipe, a device, a read-only file or one that is in use has that name, or no file can have it.
    """
    shown = os.fsdecode(path)
    try:
        mode = Path(shown).stat().st_mode
    except FileNotFoundError:
        mode = stat.S_IFREG | _MAY_WRITE
    except (OSError, ValueError) as error:  # ValueError: it holds a null character
        reason = describe_os_error(error) if isinstance(error, OSError) else str(error)
        raise InputError(f"cannot write {shown!r}: {reason}", "is the name right?") from None
    if stat.S_ISDIR(mode):
        raise InputError(f"cannot write {shown!r}: it is a folder", "name a file")
    if not stat.S_ISREG(mode):
        raise InputError(f"cannot write {shown!r}: it is a pipe or a device", "name a file")
    if not mode & _MAY_WRITE:  # a rename would not ask; the bits count for root, too, who could write
        raise InputError(f"cannot write {shown!r}: the file is read-only", "name another file, or make this one writable")
    destination = Path(os.path.realpath(shown))
    _check_free(destination, shown)
    return destination


def _check_free(destination: Path, shown: str) -> None:
    """Whether a file that is there can be replaced.

    Raises:
        InputError: another program has it open, on a system where that keeps its name taken.
    """
    if not _REPLACES_OPEN and destination.exists():
        with _explain_refusal(shown):
            destination.rename(destination)  # needs the same right as to replace it, and changes nothing


@contextmanager
def _explain_refusal(shown: str) -> Iterator[None]:
    try:
        yield
    except PermissionError as error:
        hint = "does another program have it open? close it there, or name another file"
        raise InputError(f"cannot write {shown!r}: {describe_os_error(error)}", hint) from None


def check_destination(path: str | PathLike[str]) -> None:
    """Whether a file can be written there, before there is one: `atomic` would find out when the work is done.

    Raises:
        InputError: as of `atomic`.
    """
    with ExitStack() as stack:
        _workplace(stack, _destination(path).parent, path)


@contextmanager
def atomic(path: str | PathLike[str]) -> Iterator[Path]:
    """Yield the path of an empty temporary file on the file system of ``path``; it takes its name if the block succeeds.

    On any exception, Ctrl-C included, the temporary file is removed and ``path`` stays as it was. Where ``path`` is a link,
    the file that it points to is written.

    Raises:
        InputError: the folder does not exist or cannot be written, or no file can be written there.
    """
    target = _destination(path)
    with ExitStack() as stack:
        temporary = _workplace(stack, target.parent, path) / f"0{Path(path).suffix[-20:]}"
        temporary.touch()
        rights = stat.S_IMODE(temporary.stat().st_mode)  # those of a new file here; a writer may put another one in its place
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
    """Whether the file that an error names is one of a folder: writers have files of their own beside the one they make."""
    return isinstance(name, str | bytes) and folder in Path(os.fsdecode(name)).parents


def _is_stuck(path: Path) -> bool:
    """Whether a file can take no more: an error of writing to an open file does not say which file it was."""
    with suppress(OSError), path.open("ab") as file:
        return file.write(bytes(1 << 16)) == 0
    return True


@contextmanager
def all_or_none(targets: Iterable[Path]) -> Iterator[Callable[[Path], Path]]:
    """Yield a function from a target to where it is written meanwhile; all targets appear when the block succeeds.

    Files wait in a folder beside their target, so that the last step is a rename on one file system.

    Raises:
        InputError: a folder does not exist or cannot be written, or no file can be written there.
    """
    folders: dict[Path, Path] = {}
    destinations: dict[Path, Path] = {}
    staged: dict[Path, Path] = {}

    def place(target: Path) -> Path:
        name = f"{len(staged)}{target.suffix[-20:]}"  # not the target's: two links may have the same
        staged[target] = folders[destinations[target].parent] / name
        return staged[target]

    with ExitStack() as stack:
        for target in targets:
            destination = destinations[target] = _destination(target)
            if destination.parent not in folders:
                folders[destination.parent] = _workplace(stack, destination.parent, target)
        try:
            yield place
        except OSError as error:
            for target, path in staged.items():
                if str(path) == error.filename:
                    raise OSError(error.errno, describe_os_error(error), str(target)) from error
            raise
        for target in staged:  # one may have been opened meanwhile: then none appears
            _check_free(destinations[target], str(target))
        for target, path in staged.items():
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
    """Folders that are there meanwhile, and afterwards unless it fails.

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
