"""Writing files so that no half of one is ever left behind."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from os import PathLike
from pathlib import Path

from .errors import InputError
from .workplace import workplace

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
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        temporary.replace(target)


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
        yield place
        for target, path in staged.items():
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
        raise InputError(problem, "does the folder exist?") from None
