"""Writing a store: pieces of clips, one after the other, into arrays of known length; statistics on the way."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import all_or_none, describe_os_error
from ..motion.rotations import Array
from .store_files import ARRAYS, FORMAT, STATISTICS, Entry

__all__ = ["Piece", "RowMoments", "write_store"]

_FLAT = 1e-6  # ours: a dimension that varies less is constant; its deviation becomes 1, so that nothing is divided by zero


@dataclass(frozen=True)
class Piece:
    """A clip to be written.

    Args:
        entry: its offset is filled in.
        words: of its own ``word`` array, from index 1 on.
        load: gives name → (frames, …) for every name of ``entry.has``.
    """

    entry: Entry
    words: tuple[str, ...]
    load: Callable[[], dict[str, Array]]


class RowMoments:
    """Mean and sum of squared deviations per row of the statistics, merged clip by clip (Chan et al. 1979)."""

    def __init__(self, rows: int, columns: int) -> None:
        self.count = np.zeros(rows)
        self.mean, self.squares = np.zeros((rows, columns)), np.zeros((rows, columns))

    def add(self, row: int, values: Array) -> None:
        values = values.astype(np.float64)
        mean = values.mean(0)
        total = self.count[row] + len(values)
        delta = mean - self.mean[row]
        self.squares[row] += np.square(values - mean).sum(0) + np.square(delta) * self.count[row] * len(values) / total
        self.mean[row] += delta * len(values) / total
        self.count[row] = total

    def results(self) -> tuple[Array, Array]:
        """Float32 means and deviations; a row without any frames has those of the first."""
        std = np.sqrt(self.squares / np.maximum(self.count, 1)[:, None])
        std = np.where(std < _FLAT, 1.0, std)
        empty = self.count == 0
        mean = np.where(empty[:, None], self.mean[:1], self.mean)
        return mean.astype(np.float32), np.where(empty[:, None], std[:1], std).astype(np.float32)


def write_store(
    folder: Path, pieces: Sequence[Piece], *, corpus: str, pose: str, fps: float, names: dict[str, tuple[str, ...]]
) -> None:
    """Write all files of a store, or none; the same pieces give the same bytes.

    Args:
        names: of the columns of ``"pose"``, ``"audio"`` and ``"face"``.

    Raises:
        InputError: no pieces, or the folder cannot be written.
    """
    if not pieces:
        raise InputError("no clip is left for the store", "see the report for what was dropped and why")
    total = sum(piece.entry.frames for piece in pieces)
    present = [name for name in ARRAYS if any(name in piece.entry.has for piece in pieces)]
    speakers = sorted({piece.entry.speaker for piece in pieces})
    words = ["", *sorted({word for piece in pieces for word in piece.words})]
    shapes: dict[str, tuple[int, ...]] = {name: (total, len(names[name])) if name in names else (total,) for name in present}
    with_moments = [name for name in ("pose", "audio") if name in present]
    for name in with_moments:
        shapes |= {f"{name}_{what}": (1 + len(speakers), len(names[name])) for what in STATISTICS}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with all_or_none([*(folder / f"{name}.npy" for name in shapes), folder / "index.json"]) as place:
            paths = {name: place(folder / f"{name}.npy") for name in shapes}
            arrays: dict[str, Array] = {
                name: np.lib.format.open_memmap(paths[name], "w+", ARRAYS[name], shapes[name], version=(1, 0))
                for name in present
            }
            entries, moments = _fill(
                arrays, pieces, speakers, words, {n: RowMoments(1 + len(speakers), len(names[n])) for n in with_moments}
            )
            arrays.clear()  # unmaps them, so that they can be moved everywhere
            for array, moment in moments.items():
                for what, values in zip(STATISTICS, moment.results(), strict=True):
                    np.save(paths[f"{array}_{what}"], values, allow_pickle=False)
            index = {
                "format": FORMAT, "corpus": corpus, "pose": pose, "fps": fps, "speakers": speakers, "words": words,
                "names": {name: names[name] for name in present if name in names}, "arrays": shapes,
                "clips": [asdict(entry) for entry in entries],
            }  # fmt: skip
            place(folder / "index.json").write_text(json.dumps(index, ensure_ascii=False), "utf-8", newline="\n")
    except OSError as error:
        raise InputError(f"cannot write the store {str(folder)!r}: {describe_os_error(error)}") from None


def _fill(
    arrays: dict[str, Array], pieces: Sequence[Piece], speakers: list[str], words: list[str], moments: dict[str, RowMoments]
) -> tuple[list[Entry], dict[str, RowMoments]]:
    """Copy every piece to its rows. Statistics are those of the train split (of everything where there is none)."""
    entries, at = [], 0
    train = any(piece.entry.split == "train" for piece in pieces)
    numbers = {word: k for k, word in enumerate(words)}
    row = {name: 1 + k for k, name in enumerate(speakers)}
    for piece in pieces:
        entry = replace(piece.entry, offset=at)
        rows = slice(at, at + entry.frames)
        values = piece.load()
        if "word" in values:  # numbers of the piece → numbers of the store
            own = np.array([0, *(numbers[word] for word in piece.words)], np.int32)
            values["word"] = np.where(values["word"] < 0, -1, own[values["word"]])
        for name, array in arrays.items():
            array[rows] = values.get(name, np.nan if array.dtype.kind == "f" else -1)
        if entry.split == "train" or not train:
            for name, moment in moments.items():
                if name in values:
                    moment.add(0, values[name])
                    moment.add(row[entry.speaker], values[name])
        entries.append(entry)
        at += entry.frames
    return entries, moments
