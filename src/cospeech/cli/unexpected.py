"""Messages for unexpected exceptions: whose code raised the exception, or which resource ran out."""

from __future__ import annotations

import errno
import os
import sysconfig
import traceback
from importlib.metadata import entry_points
from pathlib import Path
from types import CodeType

from ..errors import CospeechError, InputError, InternalError, is_broken_pipe
from ..export.plugins import USED
from .standard_streams import STANDARD_OUTPUT

__all__ = ["ends_work", "explain"]

_PACKAGE = Path(__file__).resolve().parents[1]
_LIBRARIES = tuple(Path(sysconfig.get_path(name)).resolve() for name in ("stdlib", "platstdlib"))
_PACKAGE_FOLDERS = ("site-packages", "dist-packages")  # where installers put packages; the latter is Debian's name
_GROUPS = ("cospeech.formats", "cospeech.models")


def explain(error: Exception, command: str) -> CospeechError:
    """The error to print for an exception: for one of ours, itself.

    Args:
        error: with its traceback.
        command: the name of the command, such as "train".

    Returns:
        For an unexpected exception, an `InputError` if it comes from a file of the user, such as a model of their own; else an
        `InternalError`.
    """
    if isinstance(error, CospeechError):
        return error
    if isinstance(error, OSError):
        return _explain_os_error(error)
    what = f"{type(error).__name__}: {error}".removesuffix(": ")
    if _is_memory(error):
        hint = "a smaller train.batch needs less" if command == "train" else "close other programs, or give shorter pieces"
        return InternalError(f"too little memory: {what}", hint)
    if place := _find_own_code(error):
        return InputError(f"{place}: {what}", "the error comes from this file, not from cospeech; --debug shows the whole way")
    whose = f"this is a bug of ours, or of {' or '.join(USED)}" if USED else "this is a bug of ours"
    return InternalError(what, f"{whose}; --debug shows where")


def ends_work(error: Exception) -> bool:
    """Whether an error is not that of one file alone.

    It is a full disk, a reader of our output that has left, or what a library has made of Ctrl-C or of a signal.
    """
    if isinstance(error, OSError) and (error.errno == errno.ENOSPC or is_broken_pipe(error)):
        return True
    cause: BaseException | None = None if isinstance(error, CospeechError) else error
    while cause is not None and isinstance(cause, Exception):
        cause = cause.__cause__ or cause.__context__
    return cause is not None


def _explain_os_error(error: OSError) -> CospeechError:
    """The error to print for an `OSError`, such as a name that is too long, or a full disk."""
    reason, name = error.strerror or str(error), error.filename
    if name == STANDARD_OUTPUT:
        return InternalError(f"cannot write {name}: {reason}", "files that were made before are complete")
    where = f"{os.fsdecode(name)!r}: " if isinstance(name, str | bytes) else ""  # an error of an open file has no name
    if error.errno == errno.ENAMETOOLONG:
        return InputError(f"{where}{reason}", "choose a shorter one")
    return InternalError(f"{where}{reason}", "is there room on the disk, and in memory?")


def _is_memory(error: Exception) -> bool:
    """Whether memory ran out: in Python or NumPy, on a graphics card, or in PyTorch's allocator (a RuntimeError)."""
    return isinstance(error, MemoryError) or type(error).__name__ == "OutOfMemoryError" or "can't allocate memory" in str(error)


def _find_own_code(error: Exception) -> str:
    """File and line of the user's code that raised the error; empty if our code is the innermost one that is no library."""
    plugins = {entry.value.partition(":")[0].partition(".")[0] for group in _GROUPS for entry in entry_points(group=group)}
    for frame, line in reversed([*traceback.walk_tb(error.__traceback__)]):
        path = _file(frame.f_code)
        if path is None:
            continue
        if path.is_relative_to(_PACKAGE):
            return ""
        is_installed = any(part in _PACKAGE_FOLDERS for part in path.parts) or any(
            path.is_relative_to(place) for place in _LIBRARIES
        )
        if not is_installed or frame.f_globals.get("__name__", "").partition(".")[0] in plugins:
            return f"{str(path)!r}, line {line}"
    return ""


def _file(code: CodeType) -> Path | None:
    """The file of a code object; None if it has no file, as Python's frozen modules have none."""
    return None if code.co_filename.startswith("<") else Path(code.co_filename).resolve()
