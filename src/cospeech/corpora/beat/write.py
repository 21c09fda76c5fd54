"""Writing clips in BEAT's raw layout, file by file as its own tools did (see `cospeech.corpora.beat.read`)."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

import numpy as np

from ...audio.speech import Speech, Word
from ...errors import InputError
from ...files import all_or_none, describe_os_error
from ...motion.motion import Motion
from ...motion.rotations import Array
from ...motion.skeletons.arkit import ARKIT, ARKIT_INDEX
from ..clip import Clip, Dropped
from ..layout import on_rate, textgrid, write_bvh, write_float_wav
from .annotations import EMOTIONS, FOUR_SPEAKERS, SPLIT, Take, emotion_text, semantic_text, take_of

__all__ = ["FACE_NAMES", "write"]

FACE_NAMES = tuple(sorted(name for name in ARKIT if name != "tongueOut"))
"""BEAT's 51 shapes in its order, the alphabetical one."""

_FPS, _FACE_FPS, _RATE = 120.0, 60.0, 16_000
_FIRST = {"neutral": 1} | dict(zip(EMOTIONS[1:], (65, 73, 81, 87, 95, 103, 111), strict=True))
_LAST = dict(zip(EMOTIONS, (64, 72, 80, 86, 94, 102, 110, 118), strict=True))


def write(clips: Iterable[Clip | Dropped], raw: str | PathLike[str]) -> list[str]:
    """Write clips as takes of BEAT under ``raw``; drops are passed over.

    Motion is retargeted to BEAT's skeleton (one that is BEAT's already keeps its offsets) at 120 fps with the hips at the
    origin in the first frame, faces are brought to 60 fps, speech to 16 kHz. A clip whose name is a take's keeps it; others
    get the next free id of their emotion, and of their split, in the split's four speakers first.

    Returns:
        The names of the takes, in order.

    Raises:
        InputError: a clip without motion, no id left for a speaker's emotion, or the folder cannot be written.
    """
    names = _Names()
    take_names = []
    for clip in clips:
        if isinstance(clip, Dropped):
            continue
        if clip.motion is None or not len(clip.motion):
            raise InputError(f"{clip.name!r} has no motion", "BEAT's layout needs joint rotations")
        take = names.take(clip)
        name = f"{take.number}_{take.speaker}_{take.recording}_{take.first}_{take.last}"
        folder = Path(raw) / str(take.number)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _write_take(clip, clip.motion, folder / name)
        except OSError as error:
            raise InputError(f"cannot write {str(folder / name)!r}: {describe_os_error(error)}") from None
        take_names.append(name)
    return take_names


def _write_take(clip: Clip, motion: Motion, stem: Path) -> None:
    """All files of a take, or none."""
    body = (motion if motion.skeleton.kind == "beat" else motion.retarget("beat")).resample(_FPS)
    face = clip.face if clip.face is not None else motion.face
    seconds = float(clip.speech.duration) if clip.speech is not None else motion.duration
    texts: dict[str, str] = {}
    if face is not None:
        texts[".json"] = _face_text(_resample_face(face, clip.face_fps or motion.fps))
    if clip.emotion is not None:
        texts[".csv"] = emotion_text(clip.emotion, seconds)
    if clip.semantics is not None:
        texts[".txt"] = semantic_text(clip.semantics) or f"00_nogesture\t0\t{seconds:.3f}\t{seconds:.3f}\t0\n"
    if clip.speech is not None and clip.speech.words is not None:
        texts[".TextGrid"] = textgrid({"words": clip.speech.words, "phones": _phones(clip.speech)}, seconds)
    sound = [] if clip.speech is None else [".wav"]
    with all_or_none(stem.parent / (stem.name + s) for s in (".bvh", *sound, *texts)) as place:
        root = body.root - body.root[0]
        write_bvh(place(stem.parent / f"{stem.name}.bvh"), body, order="XYZ", root=root, frame_time="0.008333")
        if clip.speech is not None:
            write_float_wav(place(stem.parent / f"{stem.name}.wav"), on_rate(clip.speech, _RATE), _RATE)
        for suffix, text in texts.items():
            place(stem.parent / (stem.name + suffix)).write_text(text, "utf-8", newline="\n")


def _resample_face(face: Array, fps: float) -> Array:
    """(T, 52) weights at 60 fps."""
    if fps == _FACE_FPS:
        return face
    count = max(1, int(np.ceil(len(face) * _FACE_FPS / fps - 1e-9)))
    at, own = np.arange(count) / _FACE_FPS, np.arange(len(face)) / fps
    return np.stack([np.interp(at, own, column) for column in face.T], 1)


def _face_text(face: Array) -> str:
    rows = (np.round(face[:, [ARKIT_INDEX[name] for name in FACE_NAMES]].astype(float), 6) + 0.0).tolist()
    frames = [{"weights": row, "time": round(k / _FACE_FPS, 6), "rotation": []} for k, row in enumerate(rows)]
    return json.dumps({"names": FACE_NAMES, "frames": frames})


def _phones(speech: Speech) -> list[Word]:
    """Phones of the words by spelling rules, each word's time shared out evenly: an aligner's would be better."""
    from ...face.graphemes import graphemes_to_phones

    intervals = []
    for word in speech.words or ():
        phones = graphemes_to_phones(word.text) or ("spn",)
        edges = np.linspace(word.start, word.end, len(phones) + 1)
        intervals += [Word(p.upper(), float(a), float(b)) for p, a, b in zip(phones, edges, edges[1:], strict=False)]
    return intervals


class _Names:
    """Gives clips the names of takes, none twice."""

    def __init__(self) -> None:
        self.used: set[tuple[int, int, int]] = set()
        self.numbers: dict[str, int] = {}

    def take(self, clip: Clip) -> Take:
        try:
            take = take_of(clip.name)
        except InputError:
            take = self._next(clip)
        key = (take.number, take.recording, take.first)
        if key in self.used:
            raise InputError(f"two clips are called {clip.name!r}", "names are unique within a corpus")
        self.used.add(key)
        self.numbers.setdefault(take.speaker, take.number)
        return take

    def _next(self, clip: Clip) -> Take:
        speaker = re.sub(r"[^a-z0-9]", "", clip.speaker.lower()) or "speaker"
        if speaker not in self.numbers:
            numbers = set(self.numbers.values())
            order = (*FOUR_SPEAKERS, *(n for n in range(1, 1000) if n not in FOUR_SPEAKERS))
            self.numbers[speaker] = next(n for n in order if n not in numbers)
        number, emotion = self.numbers[speaker], clip.emotion or "neutral"
        if emotion not in _FIRST:
            raise InputError(f"BEAT has no emotion {emotion!r}", f"known: {', '.join(EMOTIONS)}")
        split_ids = SPLIT[clip.split or "train"]
        for k in range(_FIRST[emotion], _LAST[emotion] + 1):
            if (number, 0, k) not in self.used and (0, k) in split_ids:
                return Take(number, speaker, 0, k, k)
        places = sum(_FIRST[emotion] <= k <= _LAST[emotion] for recording, k in split_ids if recording == 0)
        problem = f"no id is left for {emotion} takes of {clip.speaker!r} in the {clip.split or 'train'} split"
        raise InputError(problem, f"BEAT has {places}")
