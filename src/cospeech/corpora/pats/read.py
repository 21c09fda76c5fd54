"""PATS (Ahuja et al. 2020): intervals of 25 speakers, one HDF5 file each; 52 key points in 2-D at 15 fps, log-mel, words.

    cmu_intervals_df.csv                     an interval per row: split, speaker, id, times, video
    cmu_intervals_df_transforms.csv          the same of transformed speakers: speaker "oliver|mirror", interval "123|mirror"
    missing_intervals.h5                     intervals: ids whose features are incomplete
    processed/<speaker>/<interval_id>.h5     pose/{data,normalize,confidence}, audio/…, text/…
    raw/<speaker>_cropped/<interval_id>.mp3  where the holder fetched the sound

``pose/data`` is (T, 104): x of all joints, then y, in pixels, y down, from the neck; joint 0, the neck, is where it is in the
picture. `Points` are absolute, y up. HDF5 files are read in a process of their own (`reader`), tables of words without pandas.
"""

from __future__ import annotations

from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ...audio.speech import Speech, Word
from ...errors import InputError
from ...motion.points import Points
from ...motion.poses.keypoints2d import points_of
from ...motion.rotations import Array
from ..clip import Clip, Dropped
from ..hdf5_lmdb import Dataset, Hdf5LmdbReader
from ..reading import usable_folder
from .pandas_frame import read_frame
from .points import FPS, from_points, hold_arm, mirror, to_points
from .statistics import CENTRES, load_statistics
from .tables import TABLE, TRANSFORMS, Interval, read_table
from .write import write

__all__ = ["CENTRES", "FPS", "from_points", "hold_arm", "load_statistics", "mirror", "points_of", "read", "to_points", "write"]

_FARTHEST = 1e5  # pixels; ours
_SOUNDS = (".mp3", ".wav", ".flac", ".m4a", ".ogg")
_FEATURES: dict[str, tuple[int | None, float, float, float]] = {  # columns, largest value, frames per second from … to; ours
    "pose/normalize": (104, _FARTHEST, 15, 15),
    "pose/confidence": (104, 1.01, 15, 15),
    "audio/log_mel_400": (64, 750.0, 80, 125),  # the logarithm of the smallest float is -745
    "audio/log_mel_512": (128, 750.0, 40, 130),
    "audio/silence": (None, 1.0, 10, 35),
    "text/bert": (768, 1e4, 15, 15),
    "text/w2v": (300, 1e4, 15, 15),
    "text/tokens": (None, 1e6, 15, 15),
}
_GROUPS = ("pose", "audio", "text")


def read(raw: str | PathLike[str], *, transforms: bool = False) -> Iterator[Clip | Dropped]:
    """The intervals of the table, in its order.

    Args:
        raw: the folder with ``cmu_intervals_df.csv`` (PATS' ``data``).
        transforms: also those of the table of transforms; a mirrored one without a file of its own is made from its original.

    Raises:
        InputError: there is no PATS, or a table cannot be read.
    """
    root = usable_folder(raw, "PATS")
    root = next((place for place in (root, root / "data", root / "pats" / "data") if (place / TABLE).is_file()), root)
    if not (root / TABLE).is_file():
        raise InputError(f"there is no PATS in {str(root)!r}", f"name the folder that holds {TABLE}")
    tables = [root / TABLE, *([root / TRANSFORMS] if transforms and (root / TRANSFORMS).is_file() else [])]
    with Hdf5LmdbReader("hdf5") as reader:
        missing = _missing(root, reader)
        for table in tables:
            for row in read_table(table):
                if isinstance(row, Dropped):
                    yield row
                elif row.name in missing or row.name.split("|")[0] in missing:
                    yield Dropped(row.name, "listed in missing_intervals.h5")
                else:
                    try:
                        yield _clip(root, row, reader)
                    except InputError as error:
                        yield Dropped(row.name, f"{row.speaker}/{row.name}: {error}")


def _missing(root: Path, reader: Hdf5LmdbReader) -> set[str]:
    """Ids in missing_intervals.h5: text, whatever h5py calls it; none where there is no such file or no list in it."""
    path = root / "missing_intervals.h5"
    if not path.is_file():
        return set()
    dataset = reader.hdf5(path)[0].get("intervals")
    if dataset is None:
        return set()
    if not isinstance(dataset.value, list):
        if dataset.value.dtype.kind != "S":
            raise InputError(f"{path.name!r}: intervals are {dataset.value.dtype}", "text is right")
        return {value.decode("utf-8", "replace") for value in dataset.value.ravel().tolist()}
    return {value.decode("utf-8", "replace") if isinstance(value, bytes) else value for value in dataset.value}


def _clip(root: Path, row: Interval, reader: Hdf5LmdbReader) -> Clip:
    folder = root / "processed"
    file, is_mirrored = folder / row.speaker / f"{row.name}.h5", False
    speaker, _, transform = row.speaker.partition("|")
    plain = row.name.split("|")[0]
    if transform and not file.is_file():
        if transform != "mirror":
            raise InputError(
                f"there is no file for the transform {transform!r}", "make it with cospeech.corpora.pats.read.hold_arm"
            )
        file, is_mirrored = folder / speaker / f"{plain}.h5", True
    data, groups = reader.hdf5(file, _GROUPS)
    if "pose/data" not in data:
        raise InputError(f"{file.name!r} has no pose/data", "is it of another corpus?")
    flat = _feature(data["pose/data"].value, "pose/data", 104, _FARTHEST)
    frames = len(flat)
    if not flat[:, 1:52].any():
        raise InputError("all poses are zero", "was the detection empty?")
    if abs(frames / FPS - row.seconds) > max(1.0, 0.1 * row.seconds):
        raise InputError(f"{frames} poses for {row.seconds:.1f} s, {frames / row.seconds:.1f} per second", f"{FPS:g} are right")
    extra: dict[str, object] = {"video_fn": row.video, "video_link": row.link}
    for name, (columns, most, low, high) in _FEATURES.items():
        if name in data:
            array = _feature(data[name].value, name, columns, most)
            seconds = frames / FPS
            if not low * (seconds - 0.5) <= len(array) <= high * (seconds + 0.5):  # half a second more or less: ours
                raise InputError(f"{name} has {len(array)} rows for {frames} poses", "is it cut short?")
            extra[name] = array
    values = to_points(flat)
    words = _words(data, groups, frames / FPS)
    speech = _speech(root / "raw" / f"{speaker}_cropped", plain, words, frames / FPS)
    if words is not None and speech is None:
        extra["words"] = words
    if is_mirrored:
        values = mirror(values)
        extra.pop("pose/normalize", None)
    points = Points(FPS, values, "pats")
    return Clip(row.name, row.speaker, "pats", speech, points=points, split=row.split, start=row.start, extra=extra)


def _feature(value: Any, name: str, columns: int | None, most: float) -> Array:
    """Numbers of that many columns (None: one, or a vector), all finite and no larger than ``most``."""
    array = value if isinstance(value, np.ndarray) else np.zeros(0, object)
    if array.dtype.kind not in "fiub" or array.ndim not in (1, 2) or (columns is not None and array.shape[1:] != (columns,)):
        raise InputError(f"{name} is {array.dtype} of shape {array.shape}", f"numbers in {columns or 1} columns are right")
    if not len(array):
        raise InputError(f"{name} is empty", "is it cut short?")
    bad = ~(np.abs(array.astype(float)) <= most)
    if bad.any():
        place = tuple(int(k) for k in np.argwhere(bad)[0])
        raise InputError(f"{name} is {array[place]:g} at {list(place)}", f"values up to {most:g} are right")
    return array


def _words(data: dict[str, Dataset], groups: dict[str, dict[str, object]], seconds: float) -> tuple[Word, ...] | None:
    """Words of text/meta: frames, the last one included, to seconds; None where there is no such table."""
    table = read_frame(data, groups, "text/meta")
    if table is None:
        return None
    try:
        rows = list(zip(table["Word"], table["start_frame"], table["end_frame"], strict=True))
    except KeyError as error:
        raise InputError(f"text/meta has no column {error}", "Word, start_frame and end_frame are right") from None
    words = []
    for k, (text, first, last) in enumerate(rows):
        whole = all(isinstance(n, (int, float)) and not isinstance(n, bool) and n == n // 1 for n in (first, last))
        if not isinstance(text, str) or not whole or not 0 <= first <= last <= seconds * FPS + FPS:  # type: ignore[operator]
            raise InputError(f"text/meta: row {k} is {str((text, first, last))[:60]}", "a word and its frames are right")
        words.append(Word(text, float(first) / FPS, float(last + 1) / FPS))  # type: ignore[arg-type, operator]
    return tuple(sorted(words, key=lambda word: word.start))


def _speech(folder: Path, name: str, words: tuple[Word, ...] | None, seconds: float) -> Speech | None:
    path = next((folder / f"{name}{suffix}" for suffix in _SOUNDS if (folder / f"{name}{suffix}").is_file()), None)
    if path is None:
        return None
    speech = Speech.load(path)
    if abs(float(speech.duration) - seconds) > max(1.0, 0.1 * seconds):
        raise InputError(f"{path.name!r} lasts {speech.seconds:.1f} s, the poses {seconds:.1f} s", "is it cut short?")
    return Speech(speech.samples, speech.rate, words, name=name, duration=speech.duration)
