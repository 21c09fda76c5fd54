"""Which Python child processes run."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

__all__ = ["find_interpreter"]

_NAMES = ("python", "pypy", "graalpy", "mayapy", "hython")
"""Beginnings of the names of programs that are a Python."""


def find_interpreter() -> str | None:
    """Path of a Python that can run as a child process; None if there is none.

    ``sys.executable`` is not always a Python. In a frozen program (PyInstaller, Nuitka) it is that program, and where Python is
    embedded (Maya, Unreal, uWSGI) it is the program around it. If we started it, the program would run a second time. In an
    embedded Python, the interpreter beside its library is taken. A path that was given to `multiprocessing.set_executable`
    goes before all others.
    """
    spawn = sys.modules.get("multiprocessing.spawn")  # nobody has given it a path if it is not loaded
    path = os.fsdecode(spawn.get_executable() or "") if spawn else ""
    if path != sys.executable and Path(path).is_file():
        return path
    if getattr(sys, "frozen", False):
        return None
    return next((str(path) for path in _list_candidates() if path.is_file()), None)


def _list_candidates() -> Iterator[Path]:
    windows = os.name == "nt"
    if sys.executable and Path(sys.executable).name.lower().startswith(_NAMES):
        yield Path(sys.executable)
    for folder in (sys.exec_prefix, sys.base_exec_prefix):
        yield Path(folder, "python.exe" if windows else f"bin/python{sys.version_info[0]}.{sys.version_info[1]}")
    for name in ("mayapy", "hython") if sys.executable else ():
        yield Path(sys.executable).with_name(f"{name}.exe" if windows else name)
