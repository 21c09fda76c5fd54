"""Options of every command that takes a transcript, and the transcript that they describe."""

from __future__ import annotations

from os import PathLike
from typing import Annotated

from ..audio.transcript_file import TranscriptFile
from ..errors import InputError
from .options import option, seconds

__all__ = ["Offset", "describe_transcript"]


Offset = Annotated[
    float,
    option(
        "--transcript-offset",
        metavar="SECONDS",
        parser=seconds,
        help="Seconds that are added to the times of the transcript: -2.5 if its words come 2.5 s after the sound, -1:00:00 if "
        "its clock begins at 01:00:00.",
    ),
]


def describe_transcript(path: str | None, offset: float) -> str | PathLike[str] | None:
    """The transcript that the options describe.

    Args:
        path: of ``--transcript``.
        offset: of ``--transcript-offset``.

    Raises:
        InputError: there is no transcript, and something about it is given.
    """
    if path is None and offset:
        raise InputError("--transcript-offset without --transcript", "it would change nothing; leave it out")
    return TranscriptFile(path, offset) if path is not None and offset else path
