"""A transcript with what its file does not say: how far its times are off, and which of its tiers counts."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from os import PathLike

from ..errors import InputError
from ..limits import PLAUSIBLE_SECONDS

__all__ = ["TranscriptFile"]


@dataclass(frozen=True)
class TranscriptFile(PathLike[str]):
    """A transcript; it stands wherever the path of one does.

    >>> TranscriptFile("talk.srt", offset=-3600.0).offset  # its clock begins at 01:00:00
    -3600.0

    Args:
        path: of the file.
        offset: seconds that are added to its times; below 0 where it is late against the sound, above 0 where it is early.
        tier: the tier whose words count, in a file with several (.TextGrid, .eaf); if empty, that of the words is found.

    Raises:
        InputError: the offset is no number of seconds.
    """

    path: str | PathLike[str]
    offset: float = 0.0
    tier: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.offset) and abs(self.offset) < PLAUSIBLE_SECONDS):
            raise InputError(f"a transcript with an offset of {self.offset:g} s", "the offset is in seconds: -3600, or 2.5")

    def __fspath__(self) -> str:
        return os.fsdecode(self.path)

    def __str__(self) -> str:
        return os.fsdecode(self.path) + (f", tier {self.tier}" if self.tier else "")
