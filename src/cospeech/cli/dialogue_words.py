"""The transcripts of the persons of ``cospeech dialogue``, and options that are given once, or once for each person."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from ..errors import InputError
from .options import NAME, option
from .transcript_options import describe_transcript, offset_seconds

if TYPE_CHECKING:
    from .persons import Person

__all__ = ["EACH", "Offsets", "Tiers", "Transcripts", "find_words", "pick", "pick_words"]

EACH = "Give it once for all, or once for each person, in order."
"""What the help of an option says that may be given for each person."""
_WORDLESS = ".rttm"
Transcripts = Annotated[
    list[str] | None,
    option(
        "--transcript",
        metavar="FILE",
        help=f"Words: one file for each person, or one name with {NAME} in it: words/{NAME}.srt. With --speakers, one file "
        "for all.",
    ),
]
Offsets = Annotated[
    list[float] | None,
    option("--transcript-offset", metavar="SECONDS", parser=offset_seconds, help=f"See `cospeech generate`. {EACH}"),
]
Tiers = Annotated[
    list[str] | None,
    option(
        "--transcript-tier",
        metavar="NAME",
        help=f"See `cospeech generate`. {EACH} Or with {NAME} in it; then one file may have the words of all.",
    ),
]


def pick(flag: str, values: Sequence[Any] | None, k: int, persons: Sequence[Person], usual: Any) -> Any:
    """The value of an option for one person.

    Raises:
        InputError: the option is given neither once nor once for each person.
    """
    if not values:
        return usual
    if len(values) not in (1, len(persons)):
        raise InputError(f"{flag} is given {len(values)} times", f"once for all, or {len(persons)} times, once for each person")
    return values[0] if len(values) == 1 else values[k]


def pick_words(
    values: Sequence[str] | None,
    offsets: Sequence[float] | None,
    tiers: Sequence[str] | None,
    k: int,
    persons: Sequence[Person],
    *,
    is_mixed: bool,
) -> str | os.PathLike[str] | None:
    """The transcript of a person.

    Args:
        values, offsets, tiers: of the options.
        k: number of the person.
        persons: all persons.
        is_mixed: whether all are in one recording; then all words are in one file.

    Raises:
        InputError: there is one file for several recordings, or there are several files for one recording; or other options
            than the file are alone.
    """
    if values and is_mixed and (len(values) > 1 or NAME in values[0]):
        raise InputError(f"--transcript {' '.join(map(repr, values))} with --speakers", "one file with the words of all")
    tier = pick("--transcript-tier", tiers, k, persons, "")
    if values and not is_mixed and len(values) == 1 and NAME not in values[0] and not (len(tiers or ()) > 1 or NAME in tier):
        hint = f"one of each, words/{NAME}.srt, or --transcript-tier {NAME} if it has a tier of each"
        raise InputError(f"one transcript {values[0]!r} for {len(persons)} persons", hint)
    path = pick("--transcript", values, k, persons, None)
    offset = pick("--transcript-offset", offsets, k, persons, 0.0)
    name = persons[k].name
    return describe_transcript(path.replace(NAME, name) if path else None, offset, tier.replace(NAME, name))


def find_words(speakers: Path | None) -> list[str] | None:
    """The file of ``--speakers``, if it has words, too."""
    from ..audio.transcripts import load_speech_words

    if speakers is None or speakers.suffix.lower() == _WORDLESS:
        return None
    try:
        load_speech_words(speakers)
    except InputError:  # `hear_persons` has read it already, so it only lacks words
        return None
    return [str(speakers)]
