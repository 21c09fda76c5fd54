"""Animations of somebody's character: which one is read, and warnings of those that a new file does not hold."""

from __future__ import annotations

import warnings
from os import PathLike
from pathlib import Path

from ..errors import CospeechWarning, InputError, nearest
from .character_files import read_character
from .gltf import GltfFile

__all__ = ["MANNEQUIN_SKIN", "find_clip", "holds_other_figure", "note_lost_clips"]

MANNEQUIN_SKIN = "cospeech"  # name of the skin of our own character in a file
_NAME_LENGTH = 60  # ours: characters of a name in a note
_DIGITS = 9  # ours: of a number of a clip; Python refuses to read very long ones


def find_clip(file: GltfFile, clip: int | str | None) -> int:
    """Number of an animation from 0.

    Args:
        file: that holds it.
        clip: its name, or its number; the first where None.

    Raises:
        InputError: there is no such animation.

    Warns:
        CospeechWarning: none is chosen, and there are several.
    """
    names = [str(animation.get("name") or k) for k, animation in enumerate(file.list("animations"))]
    if clip is None:
        if len(names) > 1:
            problem = f"{file.name} holds {len(names)} clips; clip 0, {names[0][:_NAME_LENGTH]!r}, is taken"
            warnings.warn(f"{problem} (--clip chooses one; animation= in Python)", CospeechWarning, stacklevel=4)
        return 0
    if not names or clip in names:
        return names.index(str(clip)) if names else 0
    if not (str(clip).isdecimal() and len(str(clip)) <= _DIGITS):
        raise InputError(f"{file.name} has no clip {clip!r}", nearest(str(clip), names))
    if int(clip) >= len(names):
        raise InputError(f"{file.name} has no clip {clip}", f"0 … {len(names) - 1}, or a name")
    return int(clip)


def note_lost_clips(file: GltfFile) -> None:
    """Warn where a character has animations: the new file holds none of them."""
    count = len(file.list("animations"))
    if count:
        problem = f"{file.name} has {count} clip{'s' * (count > 1)} of its own, which the new file does not hold"
        warnings.warn(f"{problem}: it holds this motion alone", CospeechWarning, stacklevel=5)


def holds_other_figure(path: str | PathLike[str]) -> bool:
    """Whether a .glb, .vrm or .fbx holds a figure with a skin that is not our mannequin."""
    if Path(path).suffix.lower() not in (".glb", ".vrm", ".fbx"):
        return False
    file = read_character(path)
    return any(skin.get("name") != MANNEQUIN_SKIN for skin in file.list("skins"))
