"""Writing clips in TED's raw layout: three LMDB folders of pyarrow payloads (see `cospeech.corpora.ted.read`)."""

from __future__ import annotations

import hashlib
import re
import shutil
from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ...audio.features.mel import mel_triangles, spectra
from ...errors import InputError, describe_extra
from ...files import describe_os_error
from ...motion.keypoints import resample_points
from ...motion.points import Points
from ...motion.poses.direction_vectors import points_of
from ...motion.rotations import Array
from ...motion.skeletons.ted import AXES, JOINTS
from ..clip import Clip, Dropped
from ..layout import on_rate
from .legacy_arrow_writer import encode

__all__ = ["RATE", "SPLIT_FOLDERS", "VIDEO_FPS", "write"]

RATE = 16_000  # Hz; of audio_raw
SPLIT_FOLDERS = {"train": "lmdb_train", "validation": "lmdb_val", "test": "lmdb_test"}
VIDEO_FPS = 25.0  # of TED's videos, or 30
_GAP = 1.0  # seconds; ours: between the clips of one speaker, laid out as one talk
_VID = 11  # characters of a YouTube id
_MAP = 1 << 26  # bytes; ours: the first size of a database, doubled as it fills


def write(clips: Iterable[Clip | Dropped], raw: str | PathLike[str]) -> list[str]:
    """Write clips as ``lmdb_train``, ``lmdb_val``, ``lmdb_test`` under ``raw``; drops are passed over.

    Clips need speech, and key points or motion (brought to 25 fps). A clip without ``extra["vid"]`` belongs to a talk of its
    speaker, in which the clips follow each other; one without a split is put where the authors' rule puts it: the tenth of
    ten into test, the ninth into validation. Poses and audio are stored as float16 (0.001 m; -66 dB).

    Returns:
        The names under which `cospeech.corpora.ted.read.read` yields the clips, in order of writing.

    Raises:
        InputError: a clip lacks something, or the folder cannot be written or has such databases already.
    """
    root = Path(raw)
    existing = [name for name in SPLIT_FOLDERS.values() if (root / name).exists()]
    if existing:
        raise InputError(f"{str(root)!r} has a {existing[0]} already", "name another folder")
    try:
        root.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot write {str(root)!r}: {describe_os_error(error)}") from None
    stores: dict[str, _Store] = {}
    try:
        for split, name in SPLIT_FOLDERS.items():
            stores[split] = _Store(root / f".{name}.part")
        names = _write_all(clips, stores)
        for split, name in SPLIT_FOLDERS.items():
            stores[split].close()
            stores[split].folder.rename(root / name)
    except OSError as error:
        raise InputError(f"cannot write {str(root)!r}: {describe_os_error(error)}") from None
    finally:
        for store in stores.values():
            store.close()
            shutil.rmtree(store.folder, ignore_errors=True)
    return names


def _write_all(clips: Iterable[Clip | Dropped], stores: dict[str, _Store]) -> list[str]:
    """One entry per stretch of clips of one talk and frame rate in each split, held in memory until the talk ends."""
    names: list[str] = []
    ends: dict[str, float] = {}
    pending: dict[str, list[Any]] = {}
    talk: tuple[str, float] = ("", 0.0)

    def flush() -> None:
        for split, parts in pending.items():
            stores[split].add({"vid": talk[0], "framerate": talk[1], "clips": parts})
        pending.clear()

    for number, clip in enumerate(clip for clip in clips if isinstance(clip, Clip)):
        points = _points(clip)
        vid = _vid(clip)
        start = clip.start if "vid" in clip.extra else max(ends.get(vid, 0.0), 0.0)
        ends[vid] = start + points.duration + _GAP
        if (vid, points.fps) != talk:
            flush()
            talk = (vid, points.fps)
        split = clip.split or {9: "test", 8: "validation"}.get(number % 10, "train")
        parts = pending.setdefault(split, [])
        names.append(f"{split}-{stores[split].count:010}-{len(parts):03d}")
        parts.append(_entry(clip, points, start))
    flush()
    return names


def _points(clip: Clip) -> Points:
    if clip.speech is None:
        raise InputError(f"{clip.name!r} has no speech", "TED's layout needs it")
    if clip.points is not None and clip.points.layout == "ted" and clip.points.values.shape[1:] == (len(JOINTS), 3):
        return clip.points
    if clip.motion is None or not len(clip.motion):
        raise InputError(f"{clip.name!r} has neither motion nor TED's key points", "TED's layout needs one of them")
    points = points_of(clip.motion)
    return Points(VIDEO_FPS, resample_points(points.values, points.fps, VIDEO_FPS), "ted")


def _vid(clip: Clip) -> str:
    """The talk's id: its own, or the speaker's name, filled up to 11 characters where it fits and hashed where not."""
    own = clip.extra.get("vid")
    if isinstance(own, str) and own:
        return own
    if re.fullmatch(rf"[A-Za-z0-9-]{{1,{_VID}}}", clip.speaker):
        return clip.speaker.ljust(_VID, "_")
    return hashlib.sha256(clip.speaker.encode()).hexdigest()[:_VID]


def _entry(clip: Clip, points: Points, start: float) -> dict[str, object]:
    assert clip.speech is not None
    values = (points.values - points.values[:, :1]) * np.array(AXES) + 0.0
    audio = on_rate(clip.speech, RATE)[: round(points.duration * RATE)]
    first = clip.extra.get("start_frame_no")
    first = first if isinstance(first, int) else round(start * points.fps)
    shift = start - clip.speech.start
    words = [[word.text, word.start + shift, word.end + shift] for word in clip.speech.words or ()]
    return {
        "words": words,
        "skeletons_3d": values.astype(np.float16),
        "audio_feat": _audio_feat(audio),
        "audio_raw": audio.astype(np.float16),
        "start_frame_no": first,
        "end_frame_no": first + len(points),
        "start_time": float(start),
        "end_time": float(start + points.duration),
    }


def _audio_feat(samples: Array) -> Array:
    """(128, T) float16: decibels below the loudest of 128 mel bands, 1024 samples every 512, down to -80 dB."""
    power = np.square(spectra(samples, 1024, 512, 1024, centred=True)) @ mel_triangles(RATE, 1024, 128, 0.0, RATE / 2, True).T
    decibels = 10 * np.log10(np.maximum(power, 1e-10)) - 10 * np.log10(max(power.max(), 1e-10))
    return np.ascontiguousarray(np.maximum(decibels, decibels.max() - 80.0).T).astype(np.float16)


class _Store:
    """One LMDB being written: entries under ten digits."""

    def __init__(self, folder: Path) -> None:
        try:
            import lmdb
        except ImportError:
            raise InputError("writing TED's layout needs lmdb", describe_extra("corpora")) from None
        shutil.rmtree(folder, ignore_errors=True)
        self.folder, self.count, self._full = folder, 0, lmdb.MapFullError
        self._size = _MAP
        self._store = lmdb.open(str(folder), map_size=self._size, sync=False)
        self._open = True

    def add(self, value: object) -> None:
        key, data = f"{self.count:010}".encode("ascii"), encode(value)
        while True:
            try:
                with self._store.begin(write=True) as change:
                    change.put(key, data)
                break
            except self._full:
                self._size = 2 * max(self._size, len(data))
                self._store.set_mapsize(self._size)
        self.count += 1

    def close(self) -> None:
        if self._open:
            self._store.sync(True)
            self._store.close()
            self._open = False
