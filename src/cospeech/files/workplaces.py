"""Hidden folders in which files are made before they get their names; what killed processes leave is removed.

A process holds a lock on a file in each of its folders. The system takes the lock away when the process ends, however it ends,
so whoever can take it knows that nobody works there. Windows has no such locks, but keeps a file that is open from being
removed: there, whoever can remove the file knows the same.
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
ABANDONED = 86_400.0  # seconds without a write; ours: a day, where no lock tells, and for folders of other machines
_LOCK, _MARK = "lock", b"cospeech "  # the file, and what it begins with; then comes the name of the machine
_AS_IT_IS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)  # no link is followed, and no device waited for
_swept: set[Path] = set()  # folders that this process has looked through: once each, they may be large


@contextmanager
def workplace(parent: Path) -> Iterator[Path]:
    """Yield a new hidden folder in ``parent``; it is removed at the end, and before it what killed processes left there.

    Raises:
        OSError: nothing can be made there.
    """
    if not parent.name.startswith(PREFIX) and parent not in _swept:
        _swept.add(parent)
        sweep(parent)
    place, lock = parent / f"{PREFIX}{secrets.token_hex(8)}", None  # named before it is there: no signal comes in between
    try:
        place.mkdir(_mode())
        lock = _claim(place)
        yield place
    finally:
        if lock is not None:
            os.close(lock)
        shutil.rmtree(place, ignore_errors=True)


def scratch() -> Path:
    """Where files lie that get no name: the system's folder for temporary ones, as the parent of a `workplace`."""
    return Path(tempfile.gettempdir())


def sweep(parent: Path) -> None:
    """Remove the workplaces in ``parent`` whose processes have ended; those of running ones stay, and what is not ours."""
    with suppress(OSError):
        for place in [path for path in parent.iterdir() if path.name.startswith(PREFIX)]:
            with suppress(OSError):
                _remove_abandoned(place)


def _mode() -> int:
    """Who may enter a new folder: nobody else. On Windows whoever may enter the folder around it, because Python makes a
    protected list of rights of 0o700 there, which files keep when they are moved out: others could never read them.
    """
    return 0o777 if fcntl is None else 0o700


def _claim(place: Path) -> int:
    """The lock of a folder, as an open file; it gets its name when it is held, so that nobody finds it free before."""
    new = place / (_LOCK if fcntl is None else "new")  # on Windows it is held as soon as it is there, and cannot be renamed
    lock = os.open(new, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    os.write(lock, _MARK + platform.node().encode())
    if fcntl is not None:
        with suppress(OSError):  # a file system without locks: age tells
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        new.rename(place / _LOCK)
    return lock


def _remove_abandoned(place: Path) -> None:
    if not stat.S_ISDIR(place.lstat().st_mode):  # a link, say
        return
    try:
        lock = os.open(place / _LOCK, os.O_RDWR | _AS_IT_IS)
    except FileNotFoundError:  # it was killed before it had a lock, or is about to make it
        if _is_old(place):
            place.rmdir()  # not with anything in it: that would not be ours
        return
    try:
        is_file = stat.S_ISREG(os.fstat(lock).st_mode)  # of others' folders it may be a pipe, from which nothing ever comes
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
