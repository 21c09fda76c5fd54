"""BEAT's annotations as text: semantic scores (.txt), emotions (.csv), and emotion and split by take id."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from ...errors import InputError
from ..clip import Semantic
from ..reading import number, read_text

__all__ = ["FOUR_SPEAKERS", "Take", "emotion_text", "read_emotions", "read_semantics", "semantic_text", "take_of"]

_LATEST = 1e5  # seconds; ours: a day of recording
_EMOTION_IDS = {  # first id of a speech take → emotion (BEAT's recording plan); the last one ends at 118
    1: "neutral", 65: "happiness", 73: "anger", 81: "sadness", 87: "contempt", 95: "surprise", 103: "fear", 111: "disgust",
}  # fmt: skip
EMOTIONS = tuple(_EMOTION_IDS.values())
_STEMS = {  # how the files spell them; "netural" is theirs
    "netur": "neutral", "neutr": "neutral", "happ": "happiness", "ang": "anger", "sad": "sadness", "contempt": "contempt",
    "surpris": "surprise", "fear": "fear", "disgust": "disgust",
}  # fmt: skip
_KINDS = (
    "00_nogesture", "01_beat_align", "02_deictic_l", "03_deictic_m", "04_deictic_h", "05_iconic_l", "06_iconic_m",
    "07_iconic_h", "08_metaphoric_l", "09_metaphoric_m", "10_metaphoric_h",
)  # fmt: skip
_TAKE = re.compile(r"(\d{1,3})_([A-Za-z0-9]+)_(\d)_(\d{1,3})_(\d{1,3})")

FOUR_SPEAKERS = (2, 4, 6, 8)
"""The speakers whose takes the papers' split divides; we divide the takes of others in the same way."""


def _ids(speech: str, conversation: str) -> set[tuple[int, int]]:
    def spread(text: str) -> Iterable[int]:
        for part in text.split():
            first, _, last = part.partition("-")
            yield from range(int(first), int(last or first) + 1)

    return {(0, k) for k in spread(speech)} | {(1, k) for k in spread(conversation)}


SPLIT = {  # (recording, id) of CaMN's and CoG's four-speaker split
    "test": _ids("1-8 65 73 81 87 95 103 111", "1"),
    "validation": _ids("57-64 72 80 86 94 102 110 118", "12"),
    "train": _ids("9-56 66-71 74-79 82-85 88-93 96-101 104-109 112-117", "2-11"),
}


class Take(NamedTuple):
    """What a take's name says: ``2_scott_0_65_65`` is speaker 2, scott, English speech, text 65."""

    number: int
    speaker: str
    recording: int
    first: int
    last: int

    @property
    def emotion(self) -> str | None:
        """The emotion of its ids; conversations (odd recordings) are neutral; None where ids leave the plan or mix emotions."""
        if self.recording % 2:
            return "neutral"
        inside = {max((k for k in _EMOTION_IDS if k <= i), default=0) for i in (self.first, self.last)}
        return _EMOTION_IDS.get(inside.pop()) if len(inside) == 1 and self.last <= 118 else None

    @property
    def split(self) -> str | None:
        """The papers' split of four speakers; all others and other languages have the same [ours], as they read the same texts.

        None where an id is outside of the plan.

        Raises:
            InputError: its texts are in several splits.
        """
        ids = {(self.recording % 2, k) for k in range(self.first, self.last + 1)}
        splits = [name for name, members in SPLIT.items() if ids & members]
        if len(splits) > 1:
            problem = f"its texts {self.first} to {self.last} are of the {' and the '.join(splits)} split"
            raise InputError(problem, "cut it at the border, so that no text of the test is in training")
        return splits[0] if splits and ids <= SPLIT[splits[0]] else None


def take_of(name: str) -> Take:
    """Take a name apart.

    Raises:
        InputError: it is no take's name.
    """
    match = _TAKE.fullmatch(name)
    if match is None:
        raise InputError(f"{name!r} is not the name of a take", "such as 2_scott_0_1_1")
    number, speaker, recording, first, last = match.groups()
    return Take(int(number), speaker, int(recording), int(first), int(last))


def read_semantics(path: Path) -> tuple[Semantic, ...]:
    """``kind start end duration score [key words]`` per line, separated by tabs or, in some files, blanks.

    Raises:
        InputError: a line of fewer fields, a time or score that makes no sense; the line is named.
    """
    semantics = []
    for line, text in enumerate(read_text(path).splitlines(), 1):
        if not text.strip():
            continue
        place = f"{path.name!r}, line {line}"
        fields = text.rstrip("\n").split("\t") if "\t" in text else text.split(maxsplit=5)
        if len(fields) < 5:
            raise InputError(
                f"{place}: {len(fields)} fields in {text.strip()[:40]!r}", "kind start end duration score belong there"
            )
        start, end = (number(field.strip(), 0, _LATEST, place) for field in fields[1:3])
        if end < start:
            raise InputError(f"{place}: it ends at {end:g} s before it starts at {start:g} s", "are its columns swapped?")
        score = number(fields[4].strip(), 0, 1, place)
        semantics.append(Semantic(start, end, score, fields[0].strip(), " ".join(fields[5:]).strip()))
    return tuple(semantics)


def semantic_text(semantics: Iterable[Semantic]) -> str:
    """The text of a semantics file, separated by tabs; a kind is made up from the score where there is none."""
    rows = []
    for s in semantics:
        kind = s.kind or _KINDS[min(max(round(s.score * 10), 0), 10)]
        fields = [kind, *(f"{v:.3f}".rstrip("0").rstrip(".") for v in (s.start, s.end, s.end - s.start, s.score))]
        rows.append("\t".join([*fields, *([" ".join(s.words.split())] if s.words else [])]) + "\n")
    return "".join(rows)


def read_emotions(path: Path) -> tuple[tuple[str, float, float], ...]:
    """(emotion, start, end) per line of ``00_netural, start, end, duration, class``.

    Raises:
        InputError: no line, fewer fields, an unknown name, or times that make no sense; the line is named.
    """
    emotions = []
    for line, text in enumerate(read_text(path).splitlines(), 1):
        if not text.strip():
            continue
        place = f"{path.name!r}, line {line}"
        fields = [field.strip() for field in text.split(",")]
        if len(fields) < 3:
            raise InputError(f"{place}: {len(fields)} fields in {text.strip()[:40]!r}", "name, start and end belong there")
        letters = re.sub(r"^[\d_\s]+", "", fields[0]).lower()
        emotion = next((ours for stem, ours in _STEMS.items() if letters.startswith(stem)), None)
        if emotion is None:
            raise InputError(f"{place}: {fields[0][:40]!r} is no emotion", f"known: {', '.join(EMOTIONS)}")
        start, end = (number(field, 0, _LATEST, place) for field in fields[1:3])
        if end < start:
            raise InputError(f"{place}: it ends at {end:g} s before it starts at {start:g} s", "are its columns swapped?")
        emotions.append((emotion, start, end))
    if not emotions:
        raise InputError(f"{path.name!r} has no line", "was the download interrupted?")
    return tuple(emotions)


def emotion_text(emotion: str, seconds: float) -> str:
    """The one line of an emotion file.

    Raises:
        InputError: none of BEAT's eight.
    """
    if emotion not in EMOTIONS:
        raise InputError(f"BEAT has no emotion {emotion!r}", f"known: {', '.join(EMOTIONS)}")
    number = EMOTIONS.index(emotion)
    name = "netural" if emotion == "neutral" else emotion  # [sic]
    return f"{number:02d}_{name}, 0, {seconds:.3f}, {seconds:.3f}, {number}\n"
