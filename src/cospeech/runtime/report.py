"""The report of a run of ``generate``: the content of ``report.json``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Literal, TypedDict

from ..audio.word import Word
from ..files import repair_text

__all__ = ["Failure", "Report", "Reports", "describe_language"]


class _Language(TypedDict):
    language: str | None
    language_source: Literal["given", "found", "assumed"] | None


def describe_language(words: Sequence[Word] | None, user_language: str = "") -> _Language:
    """What a report says about the language of words.

    Args:
        words: of the speech; None or none: there is nothing to say.
        user_language: the language that the user gave for them.
    """
    if not words:
        return {"language": None, "language_source": None}
    own = words[0].language
    return {"language": own or "en", "language_source": "given" if user_language else "found" if own else "assumed"}


class _Facts:
    def to_json(self) -> str:
        """The content of the file."""
        facts = asdict(self)  # type: ignore[call-overload]  # a dataclass
        return repair_text(json.dumps(facts, indent=2, ensure_ascii=False)) + "\n"


@dataclass(frozen=True, kw_only=True)
class Report(_Facts):
    """Facts of one run; ``report.to_json()`` is ``report.json``."""

    model: str
    """Registry name of the model."""
    speech: str = ""
    """Name of the sound file; of several speeches its path."""
    speech_seconds: float
    """Length of the speech, with its tail of silence."""
    frames: int
    """Frames of each take: exactly ceil(speech_seconds × fps)."""
    fps: float
    """Frames per second."""
    seed: int
    """Seed of the first take; the next takes count up from it."""
    takes: int
    """Number of takes."""
    realtime_factor: float
    """Seconds of work per second of motion, files included."""
    emotion: dict[str, float]
    """Probability of each emotion that was given or heard, over the whole speech."""
    played: dict[str, float]
    """Weight of each emotion that was played: given, or clear in the voice."""
    language: str | None = None
    """Language of the words, see `cospeech.audio.languages.LANGUAGES`; none without words."""
    language_source: Literal["given", "found", "assumed"] | None = None
    """Where it is from: given by the user, found in the words, or assumed."""
    arousal: float | None = None
    """Mean arousal that was heard in the voice and played, -1 … 1; none where an emotion was given."""
    style: str
    """Style of the gestures."""
    style_mixture: dict[str, float] | None = None
    """Speaker → weight, where a model plays a mixture of speakers; of an example the nearest one."""
    speaker: dict[str, float] | None = None
    """Probability of each speaker, where a model tells by the voice who speaks."""
    outputs: list[str]
    """Files written."""
    version: str
    """Version of cospeech."""


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A speech that failed, of a run over several."""

    speech: str
    """Its file."""
    error: str
    """What is wrong, and how to mend it."""
    ours: bool
    """Whether it is a failure of ours, not something wrong with the speech."""


@dataclass(frozen=True, kw_only=True)
class Reports(_Facts):
    """Facts of a run over several speeches."""

    speeches: list[Report]
    """One of each speech, in order."""
    failed: list[Failure]
    """Those of which nothing was made."""
