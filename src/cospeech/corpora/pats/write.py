"""Writing clips in PATS' layout (see `cospeech.corpora.pats.read`)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ...audio.features.log_mel import log_mel_400
from ...audio.features.mel import RATE, mel_triangles, spectra
from ...audio.speech import Speech, Word
from ...errors import InputError, describe_extra
from ...files import atomic, describe_os_error
from ...motion.keypoints import resample_points
from ...motion.points import Points
from ...motion.poses.keypoints2d import points_of
from ...motion.rotations import Array
from ...motion.skeletons.pats import JOINTS
from ..clip import Clip, Dropped
from ..layout import on_rate
from .pandas_frame_writer import write_frame
from .points import FPS, from_points, mirror, normalise_points
from .tables import TABLE, TRANSFORMS, Interval, write_table

__all__ = ["write"]

_VIDEO_RATE = 44_100  # Hz; of log_mel_512, that of most of the videos
_QUIET = 10 ** (-40 / 20)  # ours: 40 dB below the loudest frame nobody speaks; the authors ask WebRTC's detector
_FIRST_ID = 100_000  # ours: of intervals whose clip's name cannot be one


def write(clips: Iterable[Clip | Dropped], raw: str | PathLike[str], *, transforms: bool = False) -> list[str]:
    """Write clips as intervals of PATS under ``raw``; drops are passed over.

    Clips need key points or motion (brought to 15 fps, seen from the front). Speech becomes log-mel features and an MP3; the
    authors' word vectors are not written. A clip without a split goes to train, the ninth of ten to dev, the tenth to test.

    Args:
        clips: what to write.
        raw: a folder without such a table.
        transforms: also write each interval mirrored, as ``speaker|mirror``, listed in the table of transforms.

    Returns:
        The ids of the intervals, in order.

    Raises:
        InputError: a clip without key points and motion, or the folder cannot be written.
    """
    root = Path(raw)
    if (root / TABLE).exists():
        raise InputError(f"{str(root)!r} has a {TABLE} already", "name another folder")
    rows: list[Interval] = []
    mirrors: list[Interval] = []
    try:
        root.mkdir(parents=True, exist_ok=True)
        for number, (clip, name) in enumerate(_assign_ids(clips)):
            points = _points(clip)
            split = clip.split or {9: "test", 8: "validation"}.get(number % 10, "train")
            video, link = (str(clip.extra.get(key, "")) for key in ("video_fn", "video_link"))
            rows.append(Interval(name, _folder(clip.speaker), split, points.duration, max(clip.start, 0.0), video, link))
            sides = [(rows[-1], points.values)]
            if transforms:
                row = rows[-1]
                mirrors.append(Interval(f"{name}|mirror", f"{row.speaker}|mirror", split, row.seconds, row.start, video, link))
                sides.append((mirrors[-1], mirror(points.values)))
            for row, values in sides:
                _write_interval(root / "processed" / row.speaker / f"{row.name}.h5", clip, values)
            if clip.speech is not None:
                _write_sound(root / "raw" / f"{rows[-1].speaker}_cropped" / f"{name}.mp3", clip.speech, points.duration)
        _write_missing(root / "missing_intervals.h5")
        write_table(root / TRANSFORMS, mirrors)
        write_table(root / TABLE, rows)  # last: a folder without it is no PATS
    except OSError as error:
        raise InputError(f"cannot write {str(root)!r}: {describe_os_error(error)}") from None
    return [row.name for row in rows]


def _assign_ids(clips: Iterable[Clip | Dropped]) -> Iterator[tuple[Clip, str]]:
    """Each clip with an id: its name where it can be a file's, else a number."""
    names: set[str] = set()
    for number, clip in enumerate(clip for clip in clips if isinstance(clip, Clip)):
        name = clip.name if re.fullmatch(r"[A-Za-z0-9_-]{1,100}", clip.name) and not re.match("0[0-9]", clip.name) else ""
        if not name or name in names:
            name = str(_FIRST_ID + number)
        while name in names:
            name += "x"
        names.add(name)
        yield clip, name


def _folder(speaker: str) -> str:
    return re.sub(r"[^A-Za-z0-9_-]", "_", speaker)[:100] or "_"


def _points(clip: Clip) -> Points:
    points = clip.points
    if points is None or points.layout != "pats" or points.values.shape[1:] != (len(JOINTS), 2):
        if clip.motion is None or not len(clip.motion):
            raise InputError(f"{clip.name!r} has neither motion nor PATS' key points", "PATS' layout needs one of them")
        points = points_of(clip.motion)
    return Points(FPS, resample_points(points.values, points.fps, FPS), "pats")


def _h5py() -> Any:
    try:
        import h5py
    except ImportError:
        raise InputError("writing PATS' layout needs h5py", describe_extra("corpora")) from None
    return h5py


def _write_interval(path: Path, clip: Clip, values: Array) -> None:
    flat = from_points(values)
    try:
        small = normalise_points(flat)
    except InputError as error:
        raise InputError(f"{clip.name!r}: {error.problem}", error.hint) from None
    path.parent.mkdir(parents=True, exist_ok=True)
    extra_words = clip.extra.get("words")
    words = clip.speech.words if clip.speech is not None else extra_words if isinstance(extra_words, tuple) else None
    with atomic(path) as temporary, _h5py().File(temporary, "w") as file:
        file["pose/data"], file["pose/normalize"], file["pose/confidence"] = flat, small, np.ones(flat.shape)
        if clip.speech is not None:
            for name, array in _sound_features(clip.speech, len(flat)).items():
                file[f"audio/{name}"] = array
        if words is not None:
            _write_words(file, words, clip.speech.start if clip.speech is not None else 0.0, len(flat))


def _write_words(file: Any, words: Iterable[Word], start: float, frames: int) -> None:
    """Words that begin before the poses end, on the nearest whole frames; each takes one at least."""
    spans = [(w.text, round((w.start - start) * FPS), round((w.end - start) * FPS) - 1) for w in words]
    spans = [(text, min(first, frames - 1), last) for text, first, last in spans if 0 <= first <= frames]
    rows = [(text, first, max(min(last, frames - 1), first)) for text, first, last in spans]
    numbers = {"start_frame": [first for _, first, _ in rows], "end_frame": [last for _, _, last in rows]}
    write_frame(file.create_group("text/meta"), [text for text, _, _ in rows], numbers, "Word")


def _sound_features(speech: Speech, frames: int) -> dict[str, Array]:
    """log_mel_400, log_mel_512 and silence as the authors' scripts make them; silence by loudness."""
    low = on_rate(speech, RATE)[: round(frames / FPS * RATE)]
    high = on_rate(speech, _VIDEO_RATE)[: round(frames / FPS * _VIDEO_RATE)]
    wide = np.square(spectra(high, 2048, 512, 2048, centred=True))
    wide = wide @ mel_triangles(_VIDEO_RATE, 2048, 128, 0.0, _VIDEO_RATE / 2, True).T
    edges = np.round(np.arange(frames + 1) * (RATE / FPS)).astype(int)
    parts = [low[a:b] for a, b in pairwise(edges)]
    loudness = np.array([np.sqrt(np.mean(np.square(part))) if len(part) else 0.0 for part in parts])
    return {
        "log_mel_400": log_mel_400(low),
        "log_mel_512": np.log(np.where(wide == 0, 1e-10, wide)),
        "silence": (loudness <= _QUIET * loudness.max()).astype(np.int64),
    }


def _write_sound(path: Path, speech: Speech, seconds: float) -> None:
    import soundfile

    path.parent.mkdir(parents=True, exist_ok=True)
    samples = on_rate(speech, RATE)[: round(seconds * RATE)]
    with atomic(path) as temporary:
        soundfile.write(temporary, np.clip(samples, -1, 1), RATE, format="MP3", subtype="MPEG_LAYER_III")


def _write_missing(path: Path) -> None:
    """An empty list, as variable-length text."""
    h5py = _h5py()
    with atomic(path) as temporary, h5py.File(temporary, "w") as file:
        file.create_dataset("intervals", (0,), h5py.string_dtype())
