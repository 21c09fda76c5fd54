"""Tracked faces of talking people: a folder per speaker with ``face.npz`` and ``audio/CLIP.flac``; and words, where there are.

``face.npz`` holds ``clip_ids`` (n,), ``lengths`` (n,) frames of each, ``blendshapes`` (Σ lengths, K), ``names`` (K,), ``fps``,
and may hold ``face_ok`` (frames,) and ``head_matrix`` (frames, 4, 4). Two sets of names are known: MediaPipe's 52 (ARKit's, and
a ``_neutral`` without meaning), and the 116 of FACEGOOD. Clips have ARKit's weights on our humanoid: the lower face and the
turn of the head. Eyes and brows do not follow from speech; they are 0, as are channels that the trackers leave at rest.

    GRID (Cooke et al. 2006), with blendshapes by MediaPipe: `words/CLIP.align` (start, end, word; 25,000 a second)
    FACEGOOD-Audio2Face: long takes, cut here into clips of ten seconds; a take lies in one split as a whole
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import blake2b
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..audio.speech import Speech, Word
from ..errors import InputError
from ..export.npz_arrays import open_arrays
from ..export.reading import check_frames, open_file, size_of
from ..motion.motion import Motion
from ..motion.rotations import (
    Array,
    matrix_to_quat,
    quat_conjugate,
    quat_multiply,
    quat_normalize,
    quat_to_rotvec,
    rotvec_to_quat,
)
from ..motion.skeleton import humanoid
from ..motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from .clip import Clip, Dropped
from .reading import check_lengths, files_of, number, read_each, read_text, usable_folder

__all__ = ["LOWER", "SECONDS", "read"]

SECONDS = 10.0  # of a clip at most; [ours]: longer takes are cut into windows of a usual length
ALIGN = 25_000.0  # units per second in GRID's alignments (Cooke et al. 2006)
_QUIET = ("sil", "sp")  # what GRID's alignments call silence
LOWER = tuple(name for name in ARKIT if name.startswith(("jaw", "mouth", "cheek", "nose")))
"""Channels of the lower face: those that are kept."""
_LEFT_OVER = {"cheekPuff", "cheekSquintLeft", "cheekSquintRight", "jawForward", "jawLeft", "jawRight", "mouthLeft",
              "mouthRight", "noseSneerLeft", "noseSneerRight"}  # fmt: skip
"""Channels of MediaPipe that are not used: (nearly) constant on our speakers (deviation below .01), or a turn of the face."""

_SIDES = (("Left", "l"), ("Right", "r"))
_FACEGOOD: dict[str, tuple[tuple[str, float], ...]] = {
    "jawOpen": (("mouth_stretch_c", 1.0),),
    "mouthFunnel": (
        ("mouth_funnel_dl", 0.25), ("mouth_funnel_dr", 0.25), ("mouth_funnel_ul", 0.25), ("mouth_funnel_ur", 0.25),
    ),
    "mouthPucker": (("mouth_pucker_l", 0.5), ("mouth_pucker_r", 0.5), ("mouth_oo_c", 1.0), ("mouth_oh_c", 0.5)),
    "mouthRollLower": (("mouth_suck_dl", 0.5), ("mouth_suck_dr", 0.5)),
    "mouthRollUpper": (("mouth_suck_ul", 0.5), ("mouth_suck_ur", 0.5)),
    "mouthShrugUpper": (("mouth_chinRaise_u", 1.0),),
    **{f"mouthSmile{side}": ((f"mouth_lipCornerPull_{s}", 1.0),) for side, s in _SIDES},
    **{f"mouthStretch{side}": ((f"mouth_lipStretch_{s}", 1.0),) for side, s in _SIDES},
    **{f"mouthLowerDown{side}": ((f"mouth_lowerLipDepress_{s}", 1.0),) for side, s in _SIDES},
    **{f"mouthUpperUp{side}": ((f"mouth_upperLipRaise_{s}", 1.0),) for side, s in _SIDES},
    **{f"mouthPress{side}": ((f"mouth_press_{s}", 1.0),) for side, s in _SIDES},
}  # fmt: skip
"""ARKit's channel → the channels of FACEGOOD that are added up for it; ours: by the names, and "oh" is half a pucker."""


@dataclass(frozen=True, eq=False)
class _Tracks:
    """``face.npz``, checked, one row per frame of all clips."""

    speaker: str
    fps: float
    clips: tuple[str, ...]
    starts: Array
    face: Array
    """(frames, 52) as tracked."""
    head: Array | None
    """(frames, 4) turn of the head."""
    is_mediapipe: bool
    """Whether MediaPipe tracked them: its faces have a neutral face of their own, which is subtracted."""

    def rows(self, clip: str) -> slice:
        """Where a clip lies."""
        k = self.clips.index(clip)
        return slice(int(self.starts[k]), int(self.starts[k + 1]))


def read(raw: str | PathLike[str]) -> Iterator[Clip | Dropped]:
    """Clips in order of speaker and name, one at a time.

    Args:
        raw: a folder that holds speakers' folders, or one of these. A speaker is called as the folder, without ``face_``.

    Returns:
        Clips with speech and a motion of our humanoid that has a face and turns its head; their split is None.

    Raises:
        InputError: no such folder, no ``face.npz`` in it, or one that is damaged.
    """
    root = usable_folder(raw, "faces")
    folders = [folder for folder in (root, *sorted(root.iterdir())) if (folder / "face.npz").is_file()]
    if not folders:
        raise InputError(f"there is no face.npz in {str(root)!r}", "each speaker's folder has one")
    tracks = [(folder, _load(folder)) for folder in folders]
    return (item for folder, track in tracks for item in _read(folder, track))


def _read(folder: Path, tracks: _Tracks) -> Iterator[Clip | Dropped]:
    sounds, words = files_of(folder / "audio", ".flac"), files_of(folder / "words", ".align")
    silent = [_silent(sounds, words, tracks, name) for name in tracks.clips] if tracks.is_mediapipe else []
    neutral = _neutral(tracks, silent)
    head = None if tracks.head is None else _level(tracks.head)
    for name in tracks.clips:
        yield from _pieces(name, sounds, words, tracks, neutral, head)
    yield from (Dropped(name, "no face was tracked for it") for name in sounds if name not in tracks.clips)


# tracks -------------------------------------------------------------------------------------------------------------


def _load(folder: Path) -> _Tracks:
    path = folder / "face.npz"
    with open_file(path) as stream, open_arrays(stream, repr(str(path))) as file:
        frames = (file.shape("blendshapes") if "blendshapes" in file else ()) or (0,)
        check_frames(repr(str(path)), frames[0], len(humanoid()), size_of(stream))
        arrays: dict[str, Any] = {name: file.read(name) for name in file}
    try:
        names, lengths = [str(name) for name in arrays["names"]], arrays["lengths"].astype(int)
        weights, fps = arrays["blendshapes"].astype(float), float(arrays["fps"])
        clips = tuple(str(name) for name in arrays["clip_ids"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"cannot read {str(path)!r}: {error}"[:200], "is it damaged?") from None
    starts = np.concatenate([[0], np.cumsum(lengths)])
    fits = weights.shape == (starts[-1], len(names)) and len(clips) == len(lengths) and lengths.min(initial=1) > 0
    if not (fits and np.isfinite(weights).all() and 1 <= fps <= 240 and len({*clips}) == len(clips)):
        raise InputError(f"{str(path)!r}: tracks of shape {weights.shape}, {starts[-1]} frames of {len(clips)} clips are due")
    is_mediapipe = "_neutral" in names
    face = _of_mediapipe(names, weights) if is_mediapipe else _of_facegood(names, weights, path)
    head = _heads(arrays["head_matrix"], len(face), path) if "head_matrix" in arrays else None
    has_face = np.asarray(arrays.get("face_ok", np.ones(len(face))), bool)
    if len(has_face) != len(face) or not has_face.any():
        raise InputError(f"{str(path)!r}: 'face_ok' of shape {has_face.shape}, or no face at all")
    face, head = _fill_gaps(face, has_face), None if head is None else head[_nearest(has_face)]
    return _Tracks(folder.name.removeprefix("face_"), fps, clips, starts, face, head, is_mediapipe)


def _of_mediapipe(names: list[str], weights: Array) -> Array:
    face = np.zeros((len(weights), len(ARKIT)))
    for k, name in enumerate(names):
        if name in LOWER and name not in _LEFT_OVER:
            face[:, ARKIT_INDEX[name]] = weights[:, k]
    return face


def _of_facegood(names: list[str], weights: Array, path: Path) -> Array:
    face, place = np.zeros((len(weights), len(ARKIT))), {name: k for k, name in enumerate(names)}
    for name, parts in _FACEGOOD.items():
        for part, share in parts:
            if part not in place:
                raise InputError(f"{str(path)!r} has no channel {part!r}", "names of MediaPipe and of FACEGOOD are known")
            face[:, ARKIT_INDEX[name]] += share * weights[:, place[part]]
    return np.clip(face, 0, 1)


def _heads(matrices: Array, frames: int, path: Path) -> Array:
    if matrices.shape != (frames, 4, 4) or not np.isfinite(matrices).all():
        raise InputError(f"{str(path)!r}: 'head_matrix' of shape {matrices.shape}, ({frames}, 4, 4) is due")
    return quat_normalize(matrix_to_quat(matrices[:, :3, :3].astype(float)))


def _nearest(has_face: Array) -> Array:
    """(frames,) for each frame the one before it, or first after it, in which a face was seen."""
    last = np.maximum.accumulate(np.where(has_face, np.arange(len(has_face)), -1))
    return np.where(last < 0, int(np.argmax(has_face)), last)


def _fill_gaps(face: Array, has_face: Array) -> Array:
    """Frames without a face from those around them."""
    at, valid = np.arange(len(face)), np.flatnonzero(has_face)
    return np.stack([np.interp(at, valid, column[valid]) for column in face.T], 1)


def _silent(sounds: dict[str, Path], words: dict[str, Path], tracks: _Tracks, name: str) -> Array:
    """Which frames of a clip are silent by its alignment; no frame where the alignment is missing or damaged."""
    rows = tracks.rows(name)
    quiet = np.zeros(rows.stop - rows.start, bool)
    try:
        spans = _read_alignment(words[name]) if name in words and name in sounds else []
    except InputError:  # reading the clip will say so
        return quiet
    for start, end, word in spans:
        if word in _QUIET:
            quiet[int(np.ceil(start * tracks.fps)) : int(end * tracks.fps)] = True
    return quiet


def _neutral(tracks: _Tracks, silent: list[Array]) -> Array:
    """(52,) the face at rest: per channel the median of silent frames, or a low quantile of all where none is known."""
    if not tracks.is_mediapipe:
        return np.zeros(len(ARKIT))
    quiet = np.concatenate(silent)
    if quiet.any():
        return np.asarray(np.median(tracks.face[quiet], 0))
    return np.asarray(np.quantile(tracks.face, 0.1, axis=0))  # ours: a mouth rests in a tenth of all frames


def _level(head: Array) -> Array:
    """Turns relative to the mean one: where the camera stood does not matter."""
    turns = head * np.where((head @ head[0])[:, None] < 0, -1.0, 1.0)
    return quat_multiply(quat_conjugate(quat_normalize(turns.mean(0))), turns)


# clips --------------------------------------------------------------------------------------------------------------


def _pieces(
    name: str, sounds: dict[str, Path], words: dict[str, Path], tracks: _Tracks, neutral: Array, head: Array | None
) -> Iterator[Clip | Dropped]:
    """A recording as one clip, or as several of `SECONDS` at most."""
    rows = tracks.rows(name)
    frames, most = rows.stop - rows.start, round(SECONDS * tracks.fps)
    cuts = _cuts(frames, most)
    split = _split_of_takes(tracks, most).get(name)

    def one(piece: str) -> Clip:
        first, end = spans[piece]
        if name not in sounds:
            raise InputError(f"'audio/{name}.flac' is not there", "a clip needs sound")
        speech = Speech.load(sounds[name])
        entries = [(a, b, w) for a, b, w in _read_alignment(words[name]) if w not in _QUIET] if name in words else None
        cut = slice(rows.start + first, rows.start + end)
        motion = _moving(np.clip(tracks.face[cut] - neutral, 0, 1), None if head is None else head[cut], tracks.fps)
        if len(spans) == 1:
            check_lengths(name, motion, speech)
        start, stop = first / tracks.fps, end / tracks.fps
        samples = speech.samples[round(start * speech.rate) : round(stop * speech.rate)]
        if not len(samples):
            raise InputError(f"'audio/{name}.flac' ends before {start:.1f} s", "is it cut short?")
        sound = Speech(samples, speech.rate, _words(entries, start, len(samples) / speech.rate), name=piece)
        return Clip(name=piece, speaker=tracks.speaker, corpus="faces", speech=sound, motion=motion, split=split, start=start)

    whole = len(cuts) == 2
    spans = {name if whole else f"{name}@{k:02d}": (cuts[k], cuts[k + 1]) for k in range(len(cuts) - 1)}
    return read_each(spans, one)


def _cuts(frames: int, most: int) -> list[int]:
    """Where a recording is cut into pieces of ``most`` frames; a short rest stays with the piece before it."""
    cuts = [*range(0, frames, most), frames]
    if len(cuts) > 2 and cuts[-1] - cuts[-2] < most // 2:
        del cuts[-2]
    return cuts


def _split_of_takes(tracks: _Tracks, most: int) -> dict[str, str]:
    """Split of each take that is cut: neighbouring pieces share a voice's course, so a take is held out as a whole.

    A tenth of a speaker's takes is for validation and a tenth for the test, one of each at least; the order is that of a hash
    of the name. Fewer than three takes are all for training.
    """
    lengths = np.diff(tracks.starts)
    takes = [name for name, frames in zip(tracks.clips, lengths, strict=True) if len(_cuts(int(frames), most)) > 2]
    takes.sort(key=lambda name: blake2b(name.encode(), digest_size=4).digest())
    count = max(1, round(len(takes) / 10)) if len(takes) >= 3 else 0
    kinds = ["test"] * count + ["validation"] * count
    return {name: kinds[k] if k < len(kinds) else "train" for k, name in enumerate(takes)}


def _read_alignment(path: Path) -> list[tuple[float, float, str]]:
    """Start and end in seconds, word; of GRID's alignments."""
    entries = []
    for line, text in enumerate(read_text(path).splitlines(), 1):
        parts, place = text.split(), f"{path.name!r}, line {line}"
        if not parts:
            continue
        if len(parts) != 3:
            raise InputError(f"{place}: {text[:40]!r} where start, end and word belong", "is it damaged?")
        start = number(parts[0], 0, 1e9, place)
        entries.append((start / ALIGN, number(parts[1], start, 1e9, place) / ALIGN, parts[2]))
    return entries


def _words(entries: list[tuple[float, float, str]] | None, first: float, seconds: float) -> tuple[Word, ...] | None:
    """Those that begin in a piece of a take.

    Args:
        entries: start and end in seconds of the take, word; None: no words are known.
        first: where the piece begins, seconds of the take.
        seconds: its length.
    """
    if entries is None:
        return None
    own = [(start - first, min(end - first, seconds), word) for start, end, word in entries]
    return tuple(Word(word, start, end) for start, end, word in own if 0 <= start < end)


def _moving(face: Array, head: Array | None, fps: float) -> Motion:
    """A body at rest with this face; the turn of the head is shared by neck and head, half each."""
    body = humanoid()
    rotations = np.broadcast_to(body.rest, (len(face), len(body), 4)).copy()
    if head is not None:
        rotations[:, [body.index["neck"], body.index["head"]]] = rotvec_to_quat(quat_to_rotvec(head) / 2)[:, None]
    return Motion(fps, rotations, np.broadcast_to(body.offsets[0], (len(face), 3)).copy(), face, body)
