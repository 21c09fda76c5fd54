"""How loud a recording is; a warning where it is too quiet for level control, or clipped."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator

import numpy as np

from ..errors import CospeechWarning
from .level_control import MOST, USUAL
from .speech import Speech

__all__ = ["CLIPPED", "QUIET", "count_clipped_samples", "loudest_level", "note_level"]

QUIET = USUAL - MOST
"""dB of full scale, at the loudest moment, below which level control cannot bring a recording to a usual level."""
CLIPPED = 0.01
"""Share of the samples in clipped stretches above which a recording is clipped [ours: 58 recordings of people, made as loud as
they can be without clipping, have .0007 at most; a voice 3 dB above full scale has .01, and one 6 dB above it .08]."""
_FULL = 0.95  # of full scale, from which a sample counts [ours: resampling bends clipped tops by a few hundredths]
_RUN = 3  # such samples of one sign in a row are clipped; a peak of a voice has one or two [ours, at 16 kHz]
_MOMENT = 0.4  # seconds: a syllable or two [ours; the blocks of ITU-R BS.1770 are as long]


def loudest_level(speech: Speech) -> float:
    """The level of the loudest moment, dB of full scale; −∞ of silence and of no sound."""
    size = max(round(_MOMENT * speech.rate), 1)
    square = np.square(speech.samples, dtype=float)
    blocks = np.add.reduceat(square, np.arange(0, len(square), size)) / size if len(square) else np.zeros(1)
    with np.errstate(divide="ignore"):
        return float(10 * np.log10(blocks.max()))


def count_clipped_samples(speech: Speech) -> int:
    """How many samples lie in stretches at full scale, where a recorder cut off louder sound."""
    side = np.sign(speech.samples) * (np.abs(speech.samples) >= _FULL)
    first = np.flatnonzero(np.diff(side, prepend=np.float32(2)))  # of every stretch of one value
    lengths = np.diff(first, append=len(side))
    return int(lengths[(side[first] != 0) & (lengths >= _RUN)].sum())


def note_level(chunks: Iterable[Speech], name: str) -> Iterator[Speech]:
    """Give the same pieces of a speech; warn at the end if it is quiet or clipped.

    Args:
        chunks: of the speech.
        name: how the warning calls it.

    Warns:
        CospeechWarning: after the last piece, where the speech is quiet throughout, or where more than `CLIPPED` of its samples
            are in clipped stretches.
    """
    level, clipped_samples, count = -np.inf, 0, 0
    for chunk in chunks:
        level = max(level, loudest_level(chunk))
        clipped_samples, count = clipped_samples + count_clipped_samples(chunk), count + len(chunk)
        yield chunk
    if level == -np.inf:
        warnings.warn(f"{name} is silent; mouth and hands rest throughout", CospeechWarning, stacklevel=2)
    elif level < QUIET:
        problem = (
            f"{name} is quiet: {level:.0f} dB at its loudest; mouth and hands move less than they would "
            "(make it louder: -14 to -24 dB is usual)"
        )
        warnings.warn(problem, CospeechWarning, stacklevel=2)
    if clipped_samples > CLIPPED * count:
        share = f"{clipped_samples / count:.0%} of its samples are cut off at full scale"
        problem = f"{name} is clipped: {share}; the mouth opens too far and follows the voice less (record it at a lower level)"
        warnings.warn(problem, CospeechWarning, stacklevel=2)
