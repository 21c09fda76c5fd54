"""BEAT2 (Liu et al. 2024): SMPL-X motion, ``beat_<language>_v2.0.0/{smplxflame_30,wave16k,textgrid,sem}/<take>.*``.

30 fps npz of axis-angles and FLAME expressions, 16 kHz WAV, TextGrid, semantic scores, ``train_test_split.csv``. BEAT2 has no
emotion files; the emotion is that of the take's id, which the data set's own loader gets wrong (it labels all neutral).
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from os import PathLike
from pathlib import Path

import numpy as np

from ..errors import CospeechWarning, InputError
from ..export.npz_arrays import open_arrays
from ..export.reading import open_file
from ..motion.rotations import Array
from .beat.annotations import read_semantics, take_of
from .clip import Clip, Dropped
from .reading import check_lengths, files_of, load_motion, load_sound, read_each, read_rows, usable_folder, words_alone

__all__ = ["FPS", "read", "read_split"]

FPS = 30.0
_SPLITS = {"train": "train", "val": "validation", "test": "test", "additional": "train"}  # as EMAGE's code trains on the latter
_LIST = "train_test_split.csv"


def read(raw: str | PathLike[str]) -> Iterator[Clip | Dropped]:
    """Takes of every language's folder in order of name, one at a time.

    Args:
        raw: ``BEAT2``, or one of the ``beat_<language>_v2.0.0`` in it.

    Returns:
        Clips on skeleton ``smplx`` (the face is an opening jaw, see `cospeech.export.npz`). ``extra`` has ``betas (300,)`` and
        ``expressions (T, 100)`` where the file has them, and ``"additional": True`` for takes whose type in the list is
        ``additional``; they are for training.

    Raises:
        InputError: no such folder, no ``smplxflame_30`` in it, or a damaged ``train_test_split.csv``.
    """
    root = usable_folder(raw, "BEAT2")
    places = [p for p in (root, *sorted(p for p in root.iterdir() if p.is_dir())) if (p / "smplxflame_30").is_dir()]
    if not places:
        raise InputError(f"there is no folder 'smplxflame_30' in {str(root)!r}", "name BEAT2 or beat_english_v2.0.0")
    splits = [read_split(place / _LIST) for place in places]
    for place in places:
        if not (place / _LIST).exists():
            note = f"{_LIST!r} is not in {str(place)!r}: its takes have the split of BEAT, by their ids, and not that of BEAT2"
            warnings.warn(note, CospeechWarning, stacklevel=2)
    return (item for place, split in zip(places, splits, strict=True) for item in _read(place, split))


def read_split(path: Path) -> dict[str, str]:
    """Take → type, as ``id,type`` rows list them; empty where there is no list.

    Raises:
        InputError: no such columns, or an unknown type; the line is named.
    """
    if not path.exists():
        return {}
    rows = read_rows(path)
    header = [cell.strip() for cell in rows[0]] if rows else []
    if not {"id", "type"} <= set(header):
        raise InputError(f"{path.name!r} has no columns 'id' and 'type'", f"its first line: {','.join(header)[:60]}")
    name, kind = header.index("id"), header.index("type")
    types = {}
    for line, row in enumerate(rows[1:], 2):
        if not row:
            continue
        if len(row) <= max(name, kind) or row[kind].strip() not in _SPLITS:
            raise InputError(f"{path.name!r}, line {line}: {','.join(row)[:60]!r}", f"types: {', '.join(_SPLITS)}")
        types[row[name].strip()] = row[kind].strip()
    return types


def _read(place: Path, split: dict[str, str]) -> Iterator[Clip | Dropped]:
    motions, sounds = files_of(place / "smplxflame_30", ".npz"), files_of(place / "wave16k", ".wav")
    words, semantics = files_of(place / "textgrid", ".textgrid"), files_of(place / "sem", ".txt")

    def one(name: str) -> Clip:
        if name not in motions:
            raise InputError(f"'{name}.npz' is not there", "a take needs motion")
        take = take_of(name)
        scores = read_semantics(semantics[name]) if name in semantics else None
        motion = load_motion(motions[name], fps=FPS)
        extra = _shape_and_expressions(motions[name], len(motion))
        alone = words_alone(sounds.get(name), words.get(name), motion)
        speech = load_sound(sounds.get(name), words.get(name))
        check_lengths(name, motion, speech)
        kind = split.get(name)
        own = _SPLITS.get(kind or "") if split else take.split
        return Clip(
            name=name,
            speaker=take.speaker,
            corpus="beat2",
            speech=speech,
            motion=motion,
            emotion=take.emotion,
            semantics=scores,
            split=own,
            extra={"speaker_number": take.number, **extra, **alone, **({"additional": True} if kind == "additional" else {})},
        )

    return read_each(sorted({*motions, *(split if motions else ())}), one)


def _shape_and_expressions(path: Path, frames: int) -> dict[str, Array]:
    """FLAME's coefficients, which `cospeech.export.npz` does not read; it has checked the file before."""
    coefficients: dict[str, Array] = {}
    with open_file(path) as file, open_arrays(file, repr(path.name)) as arrays:
        for key, shape in (("betas", (300,)), ("expressions", (frames, 100))):
            if key not in arrays:
                continue
            if arrays.shape(key) != shape:
                if key == "betas":  # nothing here uses them: no reason to lose a take
                    continue
                raise InputError(f"{key!r} of {path.name!r} is of shape {arrays.shape(key)}", f"{shape} is due")
            values = arrays.read(key)
            if values.dtype.kind != "f" or not np.isfinite(values).all():
                raise InputError(f"{key!r} of {path.name!r} is {values.dtype}, or not finite", "is it damaged?")
            coefficients[key] = values.astype(np.float32)
    return coefficients
