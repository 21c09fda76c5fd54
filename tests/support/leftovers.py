"""What a process that was killed leaves behind, as the tests need it."""

from __future__ import annotations

import platform
from pathlib import Path

from cospeech.files import PREFIX

__all__ = ["make_leftover"]


def make_leftover(parent: Path, *, machine: str | None = None, name: str = "x1y2z3a4") -> Path:
    """Make a workplace whose process has ended, of this machine or of another one."""
    place = parent / f"{PREFIX}{name}"
    place.mkdir()
    (place / "lock").write_bytes(b"cospeech " + (machine or platform.node()).encode())
    return place
