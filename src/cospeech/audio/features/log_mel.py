"""PATS' own audio features (`log_mel_400` of Ahuja et al. 2020) of any speech: at 100 a second, and at the rate of the motion.

A spectrum takes 512 samples of 16 kHz speech from its own time on; a Hann window covers the 400 in their middle. A row is the
logarithm of 64 mel bands of its magnitude, not of its power. Row k of a store is the last spectrum that begins at k / fps or
before.

All sums run along a spectrum, none over spectra and none through BLAS: a stream has the bits of the whole.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from .mel import BATCH, FPS, HOP, RATE, WINDOW, Bands, Doubles, Floats, magnitudes, mel_triangles
from .streaming import StreamingFeatures

__all__ = ["LOG_MEL_NAMES", "SPAN", "LogMelFeatures", "log_mel_400", "log_mel_at", "log_mel_count"]

SPAN = 512  # samples of a spectrum; this, hop, window, bands and silence are the authors' code's (data/audio.py of PATS)
_BANDS, _LOW, _HIGH = 64, 125.0, 7500.0  # Hz
_SILENT = 1e-6  # stands for a band that is exactly 0; small values stay as they are
LOG_MEL_NAMES = tuple(f"log_mel_400.{k}" for k in range(_BANDS))
"""Columns of a row."""


@cache
def _bands() -> Bands[np.float64]:
    return Bands(mel_triangles(RATE, SPAN, _BANDS, _LOW, _HIGH, False))


def _log_mel(samples: Floats, starts: NDArray[np.int64]) -> Doubles:
    """(T, 64) of the spectra that begin at these samples."""
    frames = np.lib.stride_tricks.sliding_window_view(samples, SPAN)
    out = np.empty((len(starts), _BANDS))
    for at in range(0, len(starts), BATCH):
        bands = _bands()(magnitudes(frames[starts[at : at + BATCH]], WINDOW))
        out[at : at + BATCH] = np.log(np.where(bands == 0, _SILENT, bands))
    return out


def log_mel_400(samples: Floats) -> Doubles:
    """(N,) samples at 16 kHz → (1 + (N - 512) // 160, 64), as PATS has them; fewer samples are filled up with silence."""
    samples = np.pad(samples, (0, max(0, SPAN - len(samples))))
    return _log_mel(samples, np.arange(0, len(samples) - SPAN + 1, HOP))


def log_mel_count(seconds: float) -> int:
    """How many rows `log_mel_400` gives of so much speech.

    >>> log_mel_count(1.0) == len(log_mel_400(np.zeros(16_000, np.float32)))
    True
    """
    return max(0, round(seconds * RATE) - SPAN) // HOP + 1


def log_mel_at(frames: NDArray[np.int64], fps: float) -> NDArray[np.int64]:
    """Which spectrum, at 100 a second, a frame of the motion has.

    >>> log_mel_at(np.arange(4), 15).tolist()
    [0, 6, 13, 20]
    """
    return (frames * FPS / fps).astype(np.int64)


class LogMelFeatures(StreamingFeatures):
    """Computes rows of `LOG_MEL_NAMES` for speech in pieces of any size and of any one rate; keeps samples.

    Args:
        fps: frames per second of the motion.

    Raises:
        InputError: fps is not a positive number.

    >>> from cospeech.audio.speech import Speech
    >>> features = LogMelFeatures(15)
    >>> len(features.push(Speech(np.zeros(16_000, np.float32)))), len(features.finish())
    (15, 0)
    """

    delay = SPAN / RATE

    def __init__(self, fps: float) -> None:
        super().__init__(fps, np.zeros(0, np.float32))

    def _convert(self, samples: Floats) -> Floats:
        return samples

    def _rest(self) -> Floats:
        """Silence, as many samples as the first spectrum lacks."""
        return np.zeros(max(0, SPAN - self._end), np.float32)

    @property
    def _last(self) -> int:
        """Number of the last complete spectrum; -1 where there is none yet."""
        return (self._end - SPAN) // HOP if self._end >= SPAN else -1

    def _certain(self, frame: int) -> bool:
        return bool(log_mel_at(np.array(frame), self.fps) <= self._last)

    def _rows(self, frames: NDArray[np.int64]) -> Floats:
        spectra = np.minimum(log_mel_at(frames, self.fps), self._last)
        rows = _log_mel(self._data, spectra * HOP - self._first) if len(spectra) else np.zeros((0, _BANDS))
        return rows.astype(np.float32)

    def _find_oldest(self, frame: int) -> int:
        return min(int(log_mel_at(np.array(frame), self.fps)), self._last) * HOP
