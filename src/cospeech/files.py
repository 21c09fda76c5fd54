"""Writing files so that no half of one is ever left behind."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path

from .errors import InputError

__all__ = ["all_or_none", "atomic", "describe_os_error"]


def describe_os_error(error: OSError) -> str:
    """A short reason: "No such file or directory", "Permission denied", …"""
    return error.strerror or type(error).__name__


def _destination(path: str | PathLike[str]) -> Path:
    """Where a file to be written really lies: at the end of links, which stay links.

    Raises:
        InputError: a folder, a pipe or a device has that name, or no file can have it.
    """
    shown = os.fsdecode(path)
    try:
        mode = Path(shown).stat().st_mode
    except FileNotFoundError:
        mode = stat.S_IFREG
    except (OSError, ValueError) as error:  # ValueError: it holds a null character
        reason = describe_os_error(error) if isinstance(error, OSError) else str(error)
        raise InputError(f"cannot write {shown!r}: {reason}", "is the name right?") from None
    if stat.S_ISDIR(mode):
        raise InputError(f"cannot write {shown!r}: it is a folder", "name a file")
    if not stat.S_ISREG(mode):
        raise InputError(f"cannot write {shown!r}: it is a pipe or a device", "name a file")
    return Path(os.path.realpath(shown))


@contextmanager
def atomic(path: str | PathLike[str]) -> Iterator[Path]:
    """Yield the path of an empty temporary file beside ``path``; it takes the name of ``path`` if the block succeeds.

    On any exception, Ctrl-C included, the temporary file is removed and ``path`` stays as it was. Where ``path`` is a link,
    the file that it points to is written.

    Raises:
        InputError: the folder does not exist or cannot be written, or no file can be written there.
    """
    target = _destination(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name[:40]}.", suffix=Path(path).suffix[-20:], dir=target.parent)
    except OSError as error:
        problem = f"cannot write {os.fsdecode(path)!r}: {describe_os_error(error)}"
        raise InputError(problem, "does the folder exist?") from None
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        temporary.replace(target)
    except BaseException:
        with suppress(OSError):
            temporary.unlink()
        raise


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

    try:
        for target in targets:
            destination = destinations[target] = _destination(target)
            if destination.parent not in folders:
                try:
                    made = tempfile.mkdtemp(prefix=".cospeech-", dir=destination.parent)
                except OSError as error:
                    problem = f"cannot write {str(target)!r}: {describe_os_error(error)}"
                    raise InputError(problem, "does the folder exist?") from None
                folders[destination.parent] = Path(made)
        yield place
        for target, path in staged.items():
            path.replace(destinations[target])
    finally:
        for folder in folders.values():
            shutil.rmtree(folder, ignore_errors=True)
