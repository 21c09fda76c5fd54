"""One clip → the arrays of the store, all at one rate; kept on disk until the whole corpus is there."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...audio.features import AUDIO_NAMES, LOG_MEL_NAMES, audio_features
from ...audio.features.log_mel import log_mel_at, log_mel_count
from ...audio.features.waveform import waveform_rows
from ...audio.features.words import word_ids
from ...audio.speech import Word
from ...errors import CospeechError, InputError, describe_extra
from ...files import atomic
from ...motion.motion import Motion
from ...motion.points import Points
from ...motion.poses import Pose, find_pose
from ...motion.rotations import Array
from ...rules import EMOTIONS
from ..clip import Clip, Semantic
from ..store import Entry
from ..store_writer import Piece
from .filters import FILTERS, keep

__all__ = [
    "PreparationPlan",
    "audio_names",
    "encode",
    "make_part",
    "read_part",
    "resample_points",
    "select_extra",
    "split_of",
    "wav2vec_names",
]

_ARRAYS = ("pose", "audio", "face", "semantic", "emotion", "word", "wav2vec", "waveform")  # arrays of a part
_SHORTEST = 0.5  # seconds; ours: no gesture is shorter, and a rest pose of one frame is no clip
_CUT = 0.5  # seconds; ours: motion and sound of one take differ by less, where nothing is missing
_CONVERT = "convert the files first: cospeech convert FILE NEW.bvh --map names.toml; see docs/skeletons.md"
_READY = {"pats": ("audio/log_mel_400", LOG_MEL_NAMES)}
"""Corpus → the spectra that come with it, for more clips than its sound does; their name in ``extra``, and their columns."""


@dataclass(frozen=True)
class PreparationPlan:
    """What is done to every clip.

    Args:
        corpus: its filters are used.
        pose: name of the representation.
        fps: frames per second of the store.
        filters: whether to filter.
        wav2vec: folder or name of a wav2vec 2.0, whose CNN's features are kept too.
        waveform: whether the samples are kept too.
    """

    corpus: str
    pose: str
    fps: float
    filters: bool = True
    wav2vec: str | None = None
    waveform: bool = False


def audio_names(corpus: str) -> tuple[str, ...]:
    """Columns of ``audio`` in a store of that corpus: ours, or those of the spectra that come with it."""
    return _READY[corpus][1] if corpus in _READY else AUDIO_NAMES


def wav2vec_names(name: str) -> tuple[str, ...]:
    """Columns of ``wav2vec`` in a store: the model's name, and a number.

    Raises:
        InputError: PyTorch or transformers is missing, or the model cannot be loaded.
    """
    return tuple(f"{Path(name).name} {k}" for k in range(_encoder(name).width))


def _encoder(name: str) -> Any:
    """The CNN of a wav2vec 2.0. It needs PyTorch; the rest of ``prepare`` does not."""
    try:
        from ...models.nn.speech_encoder import load_cnn
    except ImportError:
        raise InputError("wav2vec 2.0 needs PyTorch", describe_extra("wav2vec")) from None
    return load_cnn(name)


def select_extra(clip: Clip) -> dict[str, object]:
    """The entries of a clip's ``extra`` that go into a store: ready-made spectra, and words without sound."""
    names = ("words", *(name for name, _ in _READY.values()))
    return {name: clip.extra[name] for name in names if name in clip.extra}


def split_of(clip: Clip) -> str:
    """The corpus's own split; where it has none, 80, 10, 10 in 100 by a hash of the recording's name (ours).

    Clips of one recording, faster or mirrored say, are in one split: ``extra["take"]`` names it.
    """
    if clip.split is not None:
        return clip.split
    draw = hashlib.blake2b(str(clip.extra.get("take", clip.name)).encode(), digest_size=4).digest()
    share = int.from_bytes(draw, "big") / 2**32
    return "train" if share < 0.8 else "validation" if share < 0.9 else "test"


def encode(clip: Clip, plan: PreparationPlan) -> dict[str, Array]:
    """Name → (T, …) of every array of the store that the clip has something for.

    Raises:
        InputError: no motion, motion that the representation cannot take, or hardly any.
    """
    pose = find_pose(plan.pose)
    vectors = np.asarray(pose.encode(_source(clip, pose, plan.fps)), np.float32)
    if not np.isfinite(vectors).all():
        raise InputError(f"{clip.name!r} has poses that are not finite", "a skeleton without extent?")
    speech, frames = clip.speech, len(vectors)
    if speech is not None:
        frames = min(frames, speech.frames(plan.fps))
    if frames < _SHORTEST * plan.fps:
        raise InputError(
            f"{clip.name!r} is {frames / plan.fps:.2f} s long", f"a clip has motion and sound of {_SHORTEST:g} s at least"
        )
    out: dict[str, Array] = {"pose": vectors[:frames]}
    face, rate = (clip.face, clip.face_fps) if clip.face is not None else _face(clip.motion)
    if face is not None and rate:
        out["face"] = _sample_rows(face, rate, frames, plan.fps).astype(np.float32)
    audio = _audio(clip, frames, plan)
    if audio is not None:
        out["audio"] = audio
    if plan.wav2vec is not None and speech is not None:
        out["wav2vec"] = _encoder(plan.wav2vec).frame_features(speech, frames, plan.fps)
    if plan.waveform and speech is not None:
        out["waveform"] = waveform_rows(speech, frames, plan.fps).astype(np.float16)
    if clip.semantics is not None:
        out["semantic"] = _scores(clip.semantics, frames, plan.fps)
    if clip.emotion is not None:
        index = EMOTIONS.index(clip.emotion) if clip.emotion in EMOTIONS else -1
        out["emotion"] = np.full(frames, index, np.int8)
    words = _words(clip)
    if words is not None:
        out["word"] = _word_numbers(words, frames, plan.fps)
    return out


def _cut(clip: Clip, frames: int, fps: float) -> list[tuple[float, float, str]]:
    """Start and end in seconds of the part of a clip that has no frames, and why: motion or sound beyond the other's end."""
    if clip.speech is None:
        return []
    sound, end = float(clip.speech.duration), frames / fps
    longest = max(sound, clip.duration)
    reason = "sound without motion" if sound > clip.duration else "motion without sound"
    return [(end, longest, reason)] if longest - end > _CUT else []


def _words(clip: Clip) -> tuple[Word, ...] | None:
    words = clip.extra.get("words") if clip.speech is None else clip.speech.words
    return tuple(words) if isinstance(words, (list, tuple)) else None


def _audio(clip: Clip, frames: int, plan: PreparationPlan) -> Array | None:
    """Features of the sound, or the spectra that come with the corpus: taken at 100 a second where their number fits that, else
    evenly over the clip."""
    if plan.corpus not in _READY:
        return None if clip.speech is None else audio_features(clip.speech, frames, plan.fps)
    ready = clip.extra.get(_READY[plan.corpus][0])
    if not isinstance(ready, np.ndarray) or not len(ready):
        return None
    if abs(len(ready) - log_mel_count(clip.duration)) <= 1:
        rows = log_mel_at(np.arange(frames), plan.fps)
    else:
        rows = (np.arange(frames) / plan.fps * (len(ready) / max(clip.duration, 1e-9))).astype(int)
    return ready[np.minimum(rows, len(ready) - 1)].astype(np.float32)


def _source(clip: Clip, pose: Pose, fps: float) -> Any:
    """The motion or the key points at the rate of the store, on the skeleton of the representation."""
    if clip.motion is None and clip.points is None:
        raise InputError(f"{clip.name!r} has no motion", "a sound needs a file of motion beside it")
    if pose.source == "points":
        if clip.points is None:
            raise InputError(f"{clip.name!r} has no key points", f"{pose.name} takes key points; choose another --pose")
        return resample_points(clip.points, fps)
    if clip.motion is None:
        raise InputError(f"{clip.name!r} has no joint rotations", f"{pose.name} takes rotations; choose another --pose")
    motion = clip.motion.resample(fps)
    kind: str = pose.skeleton  # type: ignore[attr-defined]  # all that take motion have one
    try:
        return motion if motion.skeleton.kind == kind else motion.retarget(kind)
    except InputError as error:
        raise InputError(error.problem, _CONVERT) from None


def resample_points(points: Points, fps: float) -> Points:
    """At another rate, linear between frames; the duration is kept to a frame."""
    count = max(1, int(np.ceil(len(points) * fps / points.fps - 1e-9))) if len(points) else 0
    flat = points.values.reshape(len(points), -1)
    values = flat if fps == points.fps else _sample_rows(flat, points.fps, count, fps)
    return Points(fps, values.reshape(len(values), *points.values.shape[1:]), points.layout)


def _sample_rows(values: Array, rate: float, frames: int, fps: float) -> Array:
    """(frames, D): linear between rows of ``values`` at ``rate``; the last one stays."""
    at = np.minimum(np.arange(frames) * (rate / fps), len(values) - 1)
    low = at.astype(int)
    high = np.minimum(low + 1, len(values) - 1)
    return values[low] + (values[high] - values[low]) * (at - low)[:, None]


def _face(motion: Motion | None) -> tuple[Array | None, float | None]:
    return (None, None) if motion is None else (motion.face, motion.fps)


def _scores(semantics: tuple[Semantic, ...], frames: int, fps: float) -> Array:
    """(frames,) score of the stretch that a frame lies in; the highest where they overlap, 0 outside."""
    out = np.zeros(frames, np.float32)
    for stretch in semantics:
        rows = slice(max(0, round(stretch.start * fps)), max(0, round(stretch.end * fps)))
        out[rows] = np.maximum(out[rows], stretch.score)
    return out


def _word_numbers(words: tuple[Word, ...], frames: int, fps: float) -> Array:
    """(frames,) 1 + the place in `_vocabulary` of the word that is being said, 0 in silence."""
    numbers = {word: 1 + k for k, word in enumerate(_vocabulary(words))}
    frame_words = word_ids(words, frames, fps)
    return np.array([0 if word is None else numbers[word.lower()] for word in frame_words], np.int32)


def _vocabulary(words: tuple[Word, ...] | None) -> list[str]:
    return sorted({word.text.lower() for word in words or ()})


def fingerprint(clip: Clip) -> str:
    """A hash of what a clip holds, so that a part is used again only for the same data."""
    digest = hashlib.blake2b(clip.name.encode(), digest_size=16)
    arrays = [
        clip.face,
        None if clip.speech is None else clip.speech.samples,
        None if clip.points is None else clip.points.values,
    ]
    arrays += [ready for ready in clip.extra.values() if isinstance(ready, np.ndarray)]
    arrays += [] if clip.motion is None else [clip.motion.rotations, clip.motion.root, clip.motion.face]
    for array in arrays:
        digest.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
    digest.update(repr((clip.speaker, clip.split, clip.emotion, clip.semantics, _words(clip), clip.duration)).encode())
    return digest.hexdigest()


def make_part(clip: Clip, plan: PreparationPlan, path: Path) -> dict[str, Any]:
    """Encode a clip and keep it at ``path`` (an uncompressed npz) unless it is there already.

    Returns:
        What the report and the assembly need: name, seconds, kept stretches, losses, what is cut;
        of a clip that cannot be used, why.
    """
    mark = fingerprint(clip)
    if path.is_file():
        try:
            with np.load(path, allow_pickle=False) as old:
                meta: dict[str, Any] = json.loads(str(old["meta"]))
            if meta["fingerprint"] == mark:
                return meta
        except (OSError, ValueError, KeyError, EOFError):
            pass  # of another version: it is made again
    meta = {"name": clip.name, "speaker": clip.speaker, "split": split_of(clip), "start": clip.start, "fingerprint": mark}
    arrays: dict[str, Array] = {}
    try:
        arrays = encode(clip, plan)
        runs, losses = keep(arrays["pose"], FILTERS.get(plan.corpus) if plan.filters else None)
        meta |= {"frames": len(arrays["pose"]), "runs": runs, "losses": [tuple(loss) for loss in losses], "why": None}
        meta["cut"] = _cut(clip, meta["frames"], plan.fps)
    except CospeechError as error:
        meta |= {"frames": 0, "runs": [], "losses": [], "cut": [], "why": str(error)}
    meta["words"] = _vocabulary(_words(clip)) if "word" in arrays else []
    with atomic(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **{"meta": np.array(json.dumps(meta))} | arrays)  # type: ignore[arg-type]  # no allow_pickle in it
    return meta


def read_part(path: Path, meta: dict[str, Any], fps: float) -> list[Piece]:
    """The pieces of a part, one per kept stretch; arrays are loaded when they are written."""
    pieces = []
    with np.load(path, allow_pickle=False) as part:
        has = tuple(name for name in _ARRAYS if name in part.files)
    for first, end in meta["runs"]:
        whole = (first, end) == (0, meta["frames"])
        name = meta["name"] if whole else f"{meta['name']}@{first}"
        entry = Entry(name, meta["speaker"], meta["split"], 0, end - first, meta["start"] + first / fps, has)
        pieces.append(Piece(entry, tuple(meta["words"]), _Loader(path, first, end, has)))
    return pieces


@dataclass(frozen=True)
class _Loader:
    path: Path
    first: int
    end: int
    has: tuple[str, ...]

    def __call__(self) -> dict[str, Array]:
        with np.load(self.path, allow_pickle=False) as part:
            return {name: part[name][self.first : self.end] for name in self.has}
