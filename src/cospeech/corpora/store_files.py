"""The files of a store: what its index and its arrays have to look like, and opening them safely."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..export.arrays import read_array_head
from ..files import read_regular, regular_file
from ..limits import STORE_INDEX_BYTES
from ..motion.rotations import Array

__all__ = ["ARRAYS", "FORMAT", "NUMBERED", "STATISTICS", "Entry", "open_array", "read_entry", "read_index"]

FORMAT = "cospeech-store-1"
ARRAYS = {
    "pose": "<f4", "audio": "<f4", "face": "<f4", "semantic": "<f4", "emotion": "|i1", "word": "<i4", "control": "<f4",
    "cluster": "<i4", "text": "<i4", "wav2vec": "<f2", "waveform": "<f2",
}  # fmt: skip
"""Name → type of the arrays that run along the frames; only the pose is always there. ``control``, ``cluster`` and ``text``
are in no file: they are worked out of the poses (`cospeech.training.style_controls`, `cospeech.training.movement_modes`) and
of the words (`cospeech.training.texts`, where ``text`` may be float32 as well)."""
STATISTICS = ("mean", "std")
NUMBERED = ("pose", "audio")
"""The arrays that have statistics."""


@dataclass(frozen=True)
class Entry:
    """One clip of a store: its frames are rows ``offset`` … ``offset + frames`` of every array."""

    name: str
    speaker: str
    split: str
    offset: int
    frames: int
    start: float
    """Seconds from the beginning of the original recording."""
    has: tuple[str, ...]
    """Which of `ARRAYS` it has values in."""


def read_entry(row: Mapping[str, Any]) -> Entry:
    """A row of the index; KeyError, TypeError or ValueError where it is none."""
    text = {name: str(row[name]) for name in ("name", "speaker", "split")}
    return Entry(**text, offset=int(row["offset"]), frames=int(row["frames"]), start=float(row["start"]), has=tuple(row["has"]))


def read_index(folder: Path) -> Mapping[str, Any]:
    """The index of a store, of this version.

    Raises:
        InputError: there is none.
    """
    path = folder / "index.json"
    try:
        index = json.loads(read_regular(path, "an index of cospeech", STORE_INDEX_BYTES))
    except (ValueError, RecursionError):  # an `InputError` is a ValueError
        raise InputError(f"{str(folder)!r} is not a store: no readable index.json", "`cospeech prepare` makes one") from None
    if not isinstance(index, dict) or index.get("format") != FORMAT:
        raise InputError(f"{str(folder)!r} is not a store of this version ({FORMAT})", "prepare it again")
    return index


def open_array(path: Path, dtype: str, shape: tuple[int, ...]) -> Array:
    """One array, mapped; never unpickled.

    Raises:
        InputError: missing, cut off, or of another type or shape than the index says.
    """
    try:
        with regular_file(path, "an array").open("rb") as file:
            head, offset = read_array_head(file, repr(str(path))), file.tell()
        if (head[0].str, head[1]) != (dtype, shape) or (head[2] != "C" and len(shape) > 1):
            raise InputError(f"{str(path)!r} is not {shape} of {dtype}, as the index says", "prepare the store again")
        return np.memmap(path, head[0], "r", offset, shape)
    except (OSError, ValueError, OverflowError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot open {str(path)!r}: {error}"[:200], "prepare the store again") from None
