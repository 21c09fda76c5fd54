"""Writing clips in the raw layout of Trinity Speech-Gesture (see `cospeech.corpora.trinity.read`)."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

from ...audio.speech import Word
from ...errors import InputError
from ...files import all_or_none, describe_os_error
from ..clip import Clip, Dropped
from ..layout import on_rate, write_bvh

__all__ = ["TEST", "TEST_FOLDER", "is_of_test", "write"]

TEST = ("Recording_008",)
"""Held out by MoGlow's code and by the stylised flow (its section 4)."""

_TEST = re.compile(r"(?:recording|naturaltalking)_0*8", re.IGNORECASE)
TEST_FOLDER = "Test_data"
"""Folder of GENEA 2020 whose recordings are all of the test split; ours of that split, but the first, are there too."""

_FPS, _RATE = 60.0, 44_100


def write(clips: Iterable[Clip | Dropped], raw: str | PathLike[str]) -> list[str]:
    """Write clips as recordings under ``raw``; drops are passed over.

    Motion is retargeted to Trinity's skeleton (one that is Trinity's already keeps its offsets) at 60 fps, speech is brought
    to 44.1 kHz, 16 bits. Names of Trinity's kind are kept; others become Recording_001 … in order, the first of the test split
    Recording_008; the others of that split lie in ``Test_data``. There is no place for speakers, faces, emotions and semantic
    scores in this layout.

    Returns:
        The names of the recordings, in order.

    Raises:
        InputError: a clip without motion, two clips of one name, or the folder cannot be written.
    """
    names: set[str] = set()
    recordings = []
    for clip in clips:
        if isinstance(clip, Dropped):
            continue
        if clip.motion is None or not len(clip.motion):
            raise InputError(f"{clip.name!r} has no motion", "Trinity's layout needs joint rotations")
        own = clip.name.startswith("Recording_") and not (is_of_test(clip.name) and clip.split not in (None, "test"))
        name = clip.name if own else _free(names, clip.split)
        if name in names:
            raise InputError(f"two clips are called {name!r}", "names are unique within a corpus")
        names.add(name)
        try:
            _write(clip, Path(raw, TEST_FOLDER) if clip.split == "test" and not is_of_test(name) else Path(raw), name)
        except OSError as error:
            raise InputError(f"cannot write {name!r} to {str(raw)!r}: {describe_os_error(error)}") from None
        recordings.append(name)
    return recordings


def is_of_test(name: str) -> bool:
    """Whether a recording is the papers' test: Recording_008, which the original release calls NaturalTalking_008."""
    return _TEST.fullmatch(name) is not None


def _free(others: set[str], split: str | None) -> str:
    names = [*(TEST if split == "test" else ()), *(n for n in (f"Recording_{k:03d}" for k in range(1, 1000)) if n not in TEST)]
    name = next((n for n in names if n not in others), None)
    if name is None:
        raise InputError("more than 998 recordings", "write them to several folders")
    return name


def _write(clip: Clip, raw: Path, name: str) -> None:
    assert clip.motion is not None
    body = (clip.motion if clip.motion.skeleton.kind == "trinity" else clip.motion.retarget("trinity")).resample(_FPS)
    targets = [raw / "Motion" / f"{name}.bvh", raw / "Audio" / f"{name}.wav", raw / "Transcripts" / f"{name}.json"]
    if clip.speech is None:
        targets = targets[:1]
    elif clip.speech.words is None:
        targets = targets[:2]
    for target in targets:
        target.parent.mkdir(parents=True, exist_ok=True)
    with all_or_none(targets) as place:
        write_bvh(place(targets[0]), body, order="ZXY", root=body.root, frame_time="0.016667")
        if clip.speech is not None:
            import soundfile

            soundfile.write(place(targets[1]), on_rate(clip.speech, _RATE), _RATE, "PCM_16", format="WAV")
        if len(targets) == 3:
            assert clip.speech is not None
            place(targets[2]).write_text(_transcript(clip.speech.words or ()), "utf-8", newline="\n")


def _transcript(words: Iterable[Word]) -> str:
    rows = [{"start_time": f"{w.start:.3f}s", "end_time": f"{w.end:.3f}s", "word": w.text} for w in words]
    text = " ".join(row["word"] for row in rows)
    return json.dumps(
        [{"alternatives": [{"transcript": text, "confidence": 1.0, "words": rows}]}], indent=1, ensure_ascii=False
    )
