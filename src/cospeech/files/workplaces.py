"""Hidden folders in which files are written before they get their names; folders of killed processes are removed.

A process holds a lock on a file in each of its folders. The system frees the lock when the process ends, however it ends. So a
process that gets the lock knows that the folder is not in use. Windows has no such locks, but does not remove a file that is
open: there, a process that can remove the file knows the same.
"""

from __future__ import annotations

import os
import platform
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

__all__ = ["ABANDONED", "PREFIX", "scratch", "sweep", "workplace"]

PREFIX = ".cospeech-"
ABANDONED = 86_400.0  # seconds without a write; ours: a day, where there are no locks, and for folders of other machines
_LOCK, _MARK = "lock", b"cospeech "  # the lock file, and its first bytes; the name of the machine follows
_AS_IT_IS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)  # follow no link, and wait for no device
_clean_folders: set[Path] = set()  # folders that this process has looked through: once each, they may be large


@contextmanager
def workplace(parent: Path) -> Iterator[Path]:
    """Yield a new hidden folder in ``parent``, and remove it at the end. First remove the folders of killed processes there.

    Raises:
        OSError: nothing can be made there.
    """
    if not parent.name.startswith(PREFIX) and parent not in _clean_folders:
        _clean_folders.add(parent)
        sweep(parent)
    place, lock = parent / f"{PREFIX}{secrets.token_hex(8)}", None  # named before it is made: no signal can come between
    try:
        place.mkdir(_mode())
        lock = _claim(place)
        yield place
    finally:
        if lock is not None:
            os.close(lock)
        shutil.rmtree(place, ignore_errors=True)


def scratch() -> Path:
    """The system's folder for temporary files: the parent of a `workplace` for files that get no other name."""
    return Path(tempfile.gettempdir())


def sweep(parent: Path) -> None:
    """Remove the workplaces in ``parent`` whose processes have ended. Those in use stay, and all that is not ours."""
    with suppress(OSError):
        for place in [path for path in parent.iterdir() if path.name.startswith(PREFIX)]:
            with suppress(OSError):
                _remove_abandoned(place)


def _mode() -> int:
    """The mode of a new folder: nobody else may enter it. On Windows it has the rights of its parent. There, Python makes a
    protected list of rights of 0o700, and files keep it when they are moved out: others could never read them.
    """
    return 0o777 if fcntl is None else 0o700


def _claim(place: Path) -> int:
    """Lock a folder, and give the open lock file. It gets its name when it is locked, so that nobody finds it free before."""
    new = place / (_LOCK if fcntl is None else "new")  # on Windows an open file is locked at once, and cannot be renamed
    lock = os.open(new, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    os.write(lock, _MARK + platform.node().encode())
    if fcntl is not None:
        with suppress(OSError):  # a file system without locks: the age decides
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        new.rename(place / _LOCK)
    return lock


def _remove_abandoned(place: Path) -> None:
    if not stat.S_ISDIR(place.lstat().st_mode):  # a link, say
        return
    try:
        lock = os.open(place / _LOCK, os.O_RDWR | _AS_IT_IS)
    except FileNotFoundError:  # its process was killed before it had a lock, or is about to make one
        if _is_old(place):
            place.rmdir()  # fails where anything is in it: that would not be ours
        return
    try:
        is_file = stat.S_ISREG(os.fstat(lock).st_mode)  # in folders of others it may be a pipe, and reading it would never end
        mark = os.read(lock, 1024) if is_file else b""
        if not mark.startswith(_MARK):
            return
        here = mark == _MARK + platform.node().encode()
        if fcntl is not None:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:  # its process runs
                return
            except OSError:
                here = False
            if here or _is_old(place):
                shutil.rmtree(place, ignore_errors=True)
    finally:
        os.close(lock)
    if fcntl is None and (here or _is_old(place)):
        (place / _LOCK).unlink()  # refused while its process runs
        shutil.rmtree(place, ignore_errors=True)


def _is_old(place: Path) -> bool:
    """Whether nothing was written in it for a day."""
    return time.time() - max(path.lstat().st_mtime for path in (place, *place.rglob("*"))) > ABANDONED
