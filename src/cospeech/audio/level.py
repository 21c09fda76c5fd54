"""How loud a recording is at its loudest; a note where it is so quiet that level control does not reach it."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator

import numpy as np

from ..errors import CospeechWarning
from .level_control import MOST, USUAL
from .speech import Speech

__all__ = ["QUIET", "loudest_level", "note_quiet"]

QUIET = USUAL - MOST
"""dB of full scale, at the loudest moment, below which level control cannot bring a recording to a usual level."""
_MOMENT = 0.4  # seconds: a syllable or two [ours; the blocks of ITU-R BS.1770 are as long]


def loudest_level(speech: Speech) -> float:
    """The level of the loudest moment, dB of full scale; −∞ of silence and of no sound."""
    size = max(round(_MOMENT * speech.rate), 1)
    square = np.square(speech.samples, dtype=float)
    blocks = np.add.reduceat(square, np.arange(0, len(square), size)) / size if len(square) else np.zeros(1)
    with np.errstate(divide="ignore"):
        return float(10 * np.log10(blocks.max()))


def note_quiet(chunks: Iterable[Speech], name: str) -> Iterator[Speech]:
    """The same pieces of a speech.

    Args:
        chunks: of the speech.
        name: how the note calls it.

    Warns:
        CospeechWarning: after the last piece, where the speech is quiet throughout.
    """
    level = -np.inf
    for chunk in chunks:
        level = max(level, loudest_level(chunk))
        yield chunk
    if level < QUIET:
        told = "silent" if level == -np.inf else f"quiet: {level:.0f} dB at its loudest"
        problem = f"{name} is {told}; mouth and hands move less than they would (make it louder: -14 to -24 dB is usual)"
        warnings.warn(problem, CospeechWarning, stacklevel=2)
