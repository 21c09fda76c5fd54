"""Trinity Speech-Gesture as GENEA 2020 gives it out: ``{Motion,Audio,Transcripts}/Recording_0xx.{bvh,wav,json}``.

60 fps BVH (hips with X, Y, Z position and Z, X, Y rotation, all others Z, X, Y rotation), 44.1 or 48 kHz WAV, words as Google's
speech recognition writes them. One speaker. Recording_008 is the papers' test recording. A recording without a BVH is dropped.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import NoReturn

from ...audio.speech import Speech
from ...audio.transcripts import settle
from ...audio.word_entries import Entry
from ...errors import InputError
from ...motion.skeletons.trinity import FULL_BODY, UPPER_BODY
from ..clip import Clip, Dropped
from ..reading import check_lengths, files_of, load_motion, load_sound, number, read_each, read_text, usable_folder
from .write import TEST, TEST_FOLDER, is_of_test, write

__all__ = ["FPS", "TEST", "read", "read_words", "write"]

FPS = 60.0
_FOLDERS = {
    "motion": ("Motion", "motion", "bvh"),
    "audio": ("Audio", "audio", "wav"),
    "words": ("Transcripts", "transcripts", "json"),
}
_LATEST = 1e5  # seconds; ours: a day of recording


def read(raw: str | PathLike[str]) -> Iterator[Clip | Dropped]:
    """Recordings in order of name, one at a time, on the file's own skeleton.

    Args:
        raw: the folder that holds ``Motion``, ``Audio`` and ``Transcripts``, or the one above it (with ``Training_data`` and
            ``Test_data``, which is of the test split).

    Raises:
        InputError: no such folder, or no BVH, WAV or transcript in it.
    """
    root = usable_folder(raw, "Trinity")
    places = [place for place in (root, *sorted(p for p in root.iterdir() if p.is_dir())) if _folder(place, "motion")]
    if not places:
        raise InputError(f"there is no folder 'Motion' in {str(root)!r}", "Trinity has Motion, Audio and Transcripts")
    return (item for place in places for item in _read(place))


def _folder(place: Path, what: str) -> Path | None:
    return next((place / name for name in _FOLDERS[what] if (place / name).is_dir()), None)


def _read(place: Path) -> Iterator[Clip | Dropped]:
    def files(what: str, suffix: str) -> dict[str, Path]:
        folder = _folder(place, what)
        return {} if folder is None else files_of(folder, suffix)

    motions, sounds, words = files("motion", ".bvh"), files("audio", ".wav"), files("words", ".json")
    test = place.name.lower() == TEST_FOLDER.lower()

    def one(name: str) -> Clip:
        if name not in motions:
            raise InputError(f"{f'{name}.bvh'!r} is not there", "a recording needs motion")
        entries = read_words(words[name]) if name in words else None
        motion = load_motion(motions[name], fps=FPS, units="cm", up="y")
        missing = sorted({*UPPER_BODY, *FULL_BODY} - set(motion.skeleton.names))
        if missing:
            raise InputError(f"{motions[name].name!r} has no joint {missing[0]!r}", "is it of another corpus?")
        speech = load_sound(sounds.get(name), None)
        extra: dict[str, object] = {}
        if entries is not None:
            own_words = settle(entries, motion.duration if speech is None else speech.seconds, words[name].name)
            if speech is None:
                extra["words"] = own_words
            else:
                speech = Speech(speech.samples, speech.rate, own_words, name=speech.name, duration=speech.duration)
        check_lengths(name, motion, speech)
        split = "test" if test or is_of_test(name) else "train"
        return Clip(name=name, speaker="trinity", corpus="trinity", speech=speech, motion=motion, split=split, extra=extra)

    return read_each(sorted({*motions, *sounds, *words}), one)


def read_words(path: Path) -> list[Entry]:
    """(word, start, end) of a transcript of Google's speech recognition: segments of ``alternatives``, the first one counts.

    Raises:
        InputError: not JSON, not this layout, a time that makes no sense; the segment and word are named.
    """

    def refuse(constant: str) -> NoReturn:
        raise InputError(f"{path.name!r} holds {constant}", "only finite numbers can be read")

    text = read_text(path)
    try:
        segments = json.loads(text, parse_constant=refuse)
    except RecursionError:
        raise InputError(f"{path.name!r} is nested too deeply", "is it damaged?") from None
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path.name!r} is not JSON: {error}"[:160], "is it cut off?") from None
    if isinstance(segments, dict) and isinstance(segments.get("results"), list):
        segments = segments["results"]
    if not isinstance(segments, list):
        raise InputError(f"{path.name!r} is no list of segments", "Google's speech recognition writes one")
    return [entry for k, segment in enumerate(segments) for entry in _segment(segment, f"{path.name!r}, segment {k}")]


def _segment(segment: object, place: str) -> Iterator[Entry]:
    if not isinstance(segment, dict) or not isinstance(segment.get("alternatives", []), list):
        raise InputError(f"{place} has no alternatives", "is it damaged?")
    best: object = next(iter(segment.get("alternatives", [])), {})
    words = best.get("words", []) if isinstance(best, dict) else None
    if not isinstance(words, list):
        raise InputError(f"{place} has no list of words", "is it damaged?")
    for k, word in enumerate(words):
        where = f"{place}, word {k}"
        if not isinstance(word, dict) or not isinstance(word.get("word"), str):
            raise InputError(f"{where} has no text", "is it damaged?")
        times = [
            _time(word.get(name, word.get(other)), where)
            for name, other in (("start_time", "startTime"), ("end_time", "endTime"))
        ]
        if times[1] < times[0]:
            raise InputError(f"{where} ends at {times[1]:g} s before it starts at {times[0]:g} s", "is it damaged?")
        yield word["word"], *times


def _time(value: object, where: str) -> float:
    """``"12.300s"`` or a number, in seconds."""
    if isinstance(value, bool) or not isinstance(value, (str, int, float)):
        raise InputError(f"{where}: {str(value)[:40]!r} is not a time", 'such as "12.300s"')
    return number(str(value).strip().removesuffix("s"), 0, _LATEST, where)
