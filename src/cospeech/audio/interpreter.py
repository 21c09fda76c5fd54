"""Which Python child processes run."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

__all__ = ["find_interpreter"]

_NAME = re.compile(r"(python|pypy|graalpy|hython)[\d.]*[tw]*(_d)?|mayapy[\d.]*")
"""Names of programs that are a Python; `pythonservice` of pywin32 is none."""


def find_interpreter() -> str | None:
    """Path of a Python that can run as a child process; None if there is none.

    ``sys.executable`` is not always a Python. In a frozen program (PyInstaller, Nuitka) it is that program, and where Python is
    embedded (Maya, Unreal, uWSGI) it is the program around it. If we started it, the program would run a second time. In an
    embedded Python, the interpreter beside its library is taken. A path that was given to `multiprocessing.set_executable`
    goes before it. A frozen program has none: its libraries lie in itself, where another Python does not find them.
    """
    if getattr(sys, "frozen", False):
        return None
    spawn = sys.modules.get("multiprocessing.spawn")  # nobody has given it a path if it is not loaded
    path = os.fsdecode(spawn.get_executable() or "") if spawn else ""
    if path != sys.executable and Path(path).is_file():
        return path
    return next((str(path) for path in _list_candidates() if path.is_file()), None)


def _list_candidates() -> Iterator[Path]:
    windows = os.name == "nt"
    if sys.executable and _NAME.fullmatch(Path(sys.executable).name.lower().removesuffix(".exe")):
        yield Path(sys.executable)
    for folder in map(Path, (sys.exec_prefix, sys.base_exec_prefix)):
        # where a Python finds no library, this is the working folder
        if folder.is_absolute() and folder.is_dir() and not folder.samefile("."):
            yield folder / ("python.exe" if windows else f"bin/python{sys.version_info[0]}.{sys.version_info[1]}")
    for name in ("mayapy", "hython") if sys.executable else ():
        yield Path(sys.executable).with_name(f"{name}.exe" if windows else name)
