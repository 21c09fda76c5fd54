"""Writing files so that no half of one is ever left behind."""

from __future__ import annotations

import os
import shutil
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


@contextmanager
def atomic(path: str | PathLike[str]) -> Iterator[Path]:
    """Yield the path of an empty temporary file beside ``path``; it takes the name of ``path`` if the block succeeds.

    On any exception, Ctrl-C included, the temporary file is removed and ``path`` stays as it was.

    Raises:
        InputError: the folder does not exist or cannot be written.
    """
    target = Path(path)
    try:
        if target.is_dir():
            raise InputError(f"cannot write {str(target)!r}: it is a folder", "name a file")
        handle, name = tempfile.mkstemp(prefix=f".{target.name[:40]}.", suffix=target.suffix[-20:], dir=target.parent or ".")
    except OSError as error:
        raise InputError(f"cannot write {str(target)!r}: {describe_os_error(error)}", "does the folder exist?") from None
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
    """
    folders: dict[Path, Path] = {}
    staged: dict[Path, Path] = {}

    def place(target: Path) -> Path:
        staged[target] = folders[target.parent] / target.name
        return staged[target]

    try:
        for target in targets:
            if target.is_dir():
                raise InputError(f"cannot write {str(target)!r}: it is a folder", "name a file")
            if target.parent not in folders:
                try:
                    folders[target.parent] = Path(tempfile.mkdtemp(prefix=".cospeech-", dir=target.parent))
                except OSError as error:
                    problem = f"cannot write {str(target)!r}: {describe_os_error(error)}"
                    raise InputError(problem, "does the folder exist?") from None
        yield place
        for target, path in staged.items():
            path.replace(target)
    finally:
        for folder in folders.values():
            shutil.rmtree(folder, ignore_errors=True)
