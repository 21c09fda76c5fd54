"""TED (Yoon et al. 2019, 2020): talks as LMDB, 10 key points in 3-D, raw audio, words; and the 42-frame cache of its loaders.

    lmdb_train/ lmdb_val/ lmdb_test/              a video per entry, with its clips
    lmdb_train_cache/ …                           a window of 42 frames at 15 fps per entry

Keys are ``0000000000``, ``0000000001``, …; values are payloads of the old ``pyarrow.serialize`` (`legacy_arrow`). The databases
are read in a process of their own (`reader`). The authors put clip k of the collection into test where k % 10 is 9, into
validation where it is 8, else into train; so parts of one talk are in all three. A speaker is a video: names are not known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ...audio.speech import Speech, Word
from ...errors import InputError
from ...motion.points import Points
from ...motion.poses.direction_vectors import points_of
from ...motion.rotations import Array
from ...motion.skeletons.ted import AXES, JOINTS
from ..clip import Clip, Dropped
from ..hdf5_lmdb import read_lmdb
from ..reading import usable_folder
from .legacy_arrow import PickledContent, decode
from .write import RATE, SPLIT_FOLDERS, write

__all__ = ["CACHE_FPS", "RATE", "SPLIT_FOLDERS", "points_of", "read", "write"]

CACHE_FPS = 15.0  # of the cached windows (Yoon et al. 2020, section 5.1)

_ABOUT = ("start_frame_no", "end_frame_no", "is_correct_motion", "filtering_message")
_FARTHEST = 10.0  # metres from the root; ours
_LOUDEST = 4.0  # ours: resampling overshoots ±1 a little
_FPS = (5.0, 240.0)  # ours: of the videos
_LATEST = 1e6  # seconds; ours: no talk is that long
_APART = 0.5  # seconds; ours: by which poses, times and audio of a clip may disagree


def read(raw: str | PathLike[str]) -> Iterator[Clip | Dropped]:
    """The clips of the raw databases, or where there are none the windows of the cached ones.

    Raises:
        InputError: there is no database, one cannot be read, or an entry holds pickled content (it names the key).
    """
    root = usable_folder(raw, "TED")
    folders = {split: root / name for split, name in SPLIT_FOLDERS.items() if (root / name / "data.mdb").is_file()}
    if folders:
        for split, folder in folders.items():
            yield from _entries(folder, split, _video)
        return
    files = {split: sorted(root.glob(f"{name}*cache*/data.mdb")) for split, name in SPLIT_FOLDERS.items()}
    cache_folders = [(split, path.parent) for split, paths in files.items() for path in paths]
    if not cache_folders:
        raise InputError(f"there is no TED in {str(root)!r}", "name the folder that holds lmdb_train, lmdb_val and lmdb_test")
    for split, folder in cache_folders:
        yield from _entries(folder, split, _window)


def _entries(
    folder: Path, split: str, read_entry: Callable[[Any, str, str], Iterator[Clip | Dropped]]
) -> Iterator[Clip | Dropped]:
    for key, data in read_lmdb(folder):
        name = f"{split}-{key[:20] if key.isascii() and key.isprintable() else '?'}"
        try:
            if not (len(key) == 10 and key.isdecimal()):
                raise InputError(f"the key {key[:20]!r}", "ten digits are right")
            yield from read_entry(decode(data), name, split)
        except PickledContent as error:
            raise PickledContent(f"entry {key} of {str(folder)!r}: {error.problem}", error.hint) from None
        except InputError as error:
            yield Dropped(name, f"entry {key[:20]!r} of {folder.name}: {error}")


def _video(entry: Any, name: str, split: str) -> Iterator[Clip | Dropped]:
    """The clips of one video; a damaged clip is dropped alone."""
    vid, clips = _get(entry, "vid", str), _get(entry, "clips", list)
    if not vid or not vid.isprintable():
        raise InputError(f"the video id {vid[:20]!r}", "is it damaged?")
    if not clips:
        yield Dropped(name, "a video without clips")
    for number, clip in enumerate(clips):
        own = f"{name}-{number:03d}"
        try:
            yield _clip(entry, clip, vid, own, split)
        except InputError as error:
            yield Dropped(own, f"clip {number} of {vid}: {error}")


def _clip(video: Any, clip: Any, vid: str, name: str, split: str) -> Clip:
    start, end = (_number(_get(clip, key, float, int), key, 0, _LATEST) for key in ("start_time", "end_time"))
    first, last = (int(_get(clip, key, int)) for key in ("start_frame_no", "end_frame_no"))
    if not start < end:
        raise InputError(f"it runs from {start:g} to {end:g} s", "is it damaged?")
    rate = _get(video, "framerate", float, int) if "framerate" in video else (last - first) / (end - start)
    fps = _number(rate, "framerate", *_FPS)
    points = _points(_get(clip, "skeletons_3d", np.ndarray), fps)
    extra: dict[str, object] = {"vid": vid, "start_frame_no": first, "end_frame_no": last}
    if "audio_feat" in clip:
        extra["audio_feat"] = _spectrogram(clip["audio_feat"], "audio_feat", end - start)
    if abs(last - first - len(points)) > _APART * fps:
        raise InputError(f"{len(points)} poses for the frames {first} to {last}", "is it cut short?")
    return _finish(clip, points, start, end, "audio_raw", name, split, extra)


def _window(entry: Any, name: str, split: str) -> Iterator[Clip | Dropped]:
    """One window of the cache: [words, poses, direction vectors, audio, spectrogram, aux] (and MFCCs behind them)."""
    if not isinstance(entry, list) or len(entry) not in (6, 7) or not isinstance(entry[5], dict):
        raise InputError("not a window of 6 parts", "words, poses, direction vectors, audio, spectrogram and times are right")
    words, poses, vectors, audio, spectrogram, about = entry[:6]
    vid = _get(about, "vid", str)
    start, end = (_number(_get(about, key, float, int), key, 0, _LATEST) for key in ("start_time", "end_time"))
    points = _points(_stack(poses), CACHE_FPS)
    extra: dict[str, object] = {"vid": vid}
    extra |= {key: about[key] for key in _ABOUT if key in about}
    extra["direction_vectors"] = _array(vectors, "direction vectors", (len(points), 9, 3), 2.0)
    extra["spectrogram"] = _spectrogram(spectrogram, "the spectrogram", end - start)
    yield _finish({"words": words, "audio": audio}, points, start, end, "audio", name, split, extra)


def _finish(
    clip: Any, points: Points, start: float, end: float, sound: str, name: str, split: str, extra: dict[str, object]
) -> Clip:
    """Check the lengths of the parts, and move the words to the clip's own time."""
    samples = _array(_get(clip, sound, np.ndarray), sound, (None,), _LOUDEST).astype(np.float32)
    for what, seconds in (("poses", points.duration), ("audio", len(samples) / RATE)):
        if abs(seconds - (end - start)) > _APART + 0.02 * (end - start):
            raise InputError(f"{seconds:.2f} s of {what} for a clip of {end - start:.2f} s", "is it cut short?")
    words, outside = [], 0
    for k, entry in enumerate(_get(clip, "words", list)):
        if not isinstance(entry, (list, tuple)) or len(entry) != 3 or not isinstance(entry[0], str):
            raise InputError(f"word {k} is {str(entry)[:40]!r}", "text, start and end are right")
        begins, ends = (_number(value, f"time of word {k}", 0, _LATEST) - start for value in entry[1:])
        if ends < begins:
            raise InputError(f"word {k} ends before it starts: {entry[1]:g} … {entry[2]:g} s", "is it damaged?")
        if ends <= 0 or begins >= end - start:
            outside += 1
            continue
        words.append(Word(entry[0], max(begins, 0.0), min(ends, end - start)))
    if outside:
        extra["words_outside"] = outside
    words.sort(key=lambda word: word.start)
    speech = Speech(samples, RATE, tuple(words), name=name)
    return Clip(name, str(extra["vid"]), "ted", speech, points=points, split=split, start=start, extra=extra)


def _get(mapping: Any, key: str, *kinds: type) -> Any:
    """The value under a key, of one of the right types."""
    if not isinstance(mapping, dict) or key not in mapping:
        raise InputError(f"there is no {key!r}", "is it of another corpus?")
    value = mapping[key]
    if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
        raise InputError(f"{key!r} is a {type(value).__name__}", f"{' or '.join(kind.__name__ for kind in kinds)} is right")
    return value


def _number(value: Any, what: str, low: float, high: float) -> float:
    number = not isinstance(value, bool) and isinstance(value, (int, float, np.floating))
    if not number or not isfinite(value) or not low <= value <= high:
        raise InputError(f"{what} is {str(value)[:30]}", f"a number of {low:g} … {high:g} is right")
    return float(value)


def _array(value: Any, what: str, shape: tuple[int | None, ...], most: float) -> Array:
    """A float array of that shape (None: any length but 0) without a value that is not finite or beyond ``most``."""
    if not isinstance(value, np.ndarray) or value.dtype.kind != "f" or value.ndim != len(shape):
        about = f"{value.dtype} of shape {value.shape}" if isinstance(value, np.ndarray) else f"a {type(value).__name__}"
        raise InputError(f"{what} is {about}", f"floats in {len(shape)} dimensions are right")
    if any(n == 0 or (want is not None and n != want) for n, want in zip(value.shape, shape, strict=True)):
        raise InputError(f"{what} has the shape {value.shape}", "is it cut short?")
    bad = ~(np.abs(value) <= most)
    if bad.any():
        place = tuple(int(k) for k in np.argwhere(bad)[0])
        raise InputError(f"{what} is {value[place]:g} at {list(place)}", f"values up to {most:g} are right")
    return value


def _spectrogram(value: Any, what: str, seconds: float) -> Array:
    """128 bands in decibels, a frame per 512 samples."""
    array = _array(value, what, (128, None), 1e4)
    if abs(array.shape[1] * 512 / RATE - seconds) > _APART + 0.02 * seconds:
        raise InputError(f"{what} has {array.shape[1]} frames for {seconds:.2f} s", "is it cut short?")
    return array


def _stack(poses: Any) -> Any:
    if isinstance(poses, list) and poses and all(isinstance(p, np.ndarray) and p.shape == (len(JOINTS), 3) for p in poses):
        return np.stack(poses)
    return poses


def _points(values: Any, fps: float) -> Points:
    values = _array(values, "the poses", (None, len(JOINTS), 3), _FARTHEST)
    if not values.any():
        raise InputError("all poses are zero", "was the detection empty?")
    positions = values.astype(np.float64 if values.dtype == np.float64 else np.float32)
    return Points(fps, positions * np.array(AXES, positions.dtype) + positions.dtype.type(0), "ted")
