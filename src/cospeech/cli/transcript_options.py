"""Options of every command that takes a transcript, and the transcript that they describe."""

from __future__ import annotations

from os import PathLike
from typing import Annotated

from ..audio.transcript_file import TranscriptFile
from ..errors import InputError
from .options import option, seconds

__all__ = ["Offset", "Tier", "describe_transcript", "offset_seconds"]


def offset_seconds(text: str | float) -> float:
    """As `seconds`; with a minus in front, it is below 0. A default value is a number already."""
    full_text = str(text).strip()
    size = seconds(full_text.removeprefix("-"), full_text)
    return -size if full_text.startswith("-") else size


Offset = Annotated[
    float,
    option(
        "--transcript-offset",
        metavar="SECONDS",
        parser=offset_seconds,
        help="Seconds that are added to the times of the transcript: -2.5 if its words come 2.5 s after the sound, -1:00:00 if "
        "its clock begins at 01:00:00.",
    ),
]
Tier = Annotated[
    str,
    option(
        "--transcript-tier",
        metavar="NAME",
        help="Which tier of a .TextGrid or .eaf transcript has the words, if it has several. Without the option, the program "
        "finds it.",
    ),
]


def describe_transcript(path: str | None, offset: float, tier: str) -> str | PathLike[str] | None:
    """The transcript that the options describe.

    Args:
        path: of ``--transcript``.
        offset: of ``--transcript-offset``.
        tier: of ``--transcript-tier``.

    Raises:
        InputError: there is no transcript, and something about it is given.
    """
    if path is None and (offset or tier):
        flag = "--transcript-offset" if offset else "--transcript-tier"
        raise InputError(f"{flag} without --transcript", "it would change nothing; leave it out")
    return TranscriptFile(path, offset, tier) if path is not None and (offset or tier) else path
