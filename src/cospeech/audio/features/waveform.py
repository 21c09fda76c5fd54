"""The waveform itself as features: the samples of each frame's own time, for networks that convolve over samples.

Frame f of the motion has the samples of [f / fps, (f + 1) / fps), always `SAMPLES` of them, whatever the rate: 16,200 samples a
second at 15 frames a second. Convolutions whose strides multiply to `SAMPLES` then give one vector per frame, however long the
speech is. Yoon et al. 2020 have 36,267 samples of 16 kHz for 34 frames, 1,066.7 for each, and the same strides: there the
vectors drift by 13 samples a frame.

Values lie between -1 and 1. They are interpolated linearly from 16 kHz.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..speech import Speech
from .mel import RATE, Floats
from .streaming import StreamingFeatures

__all__ = ["SAMPLES", "WAVEFORM_NAMES", "WaveformFeatures", "waveform_rows"]

SAMPLES = 1080  # of a frame: 5 · 6 · 6 · 6, the strides of Yoon et al. 2020
WAVEFORM_NAMES = tuple(f"waveform.{k}" for k in range(SAMPLES))
"""Columns of a row."""
_PIECE = 10.0  # seconds; ours: long speech is processed in pieces, which needs less memory and gives the same bits


class WaveformFeatures(StreamingFeatures):
    """Computes rows of `WAVEFORM_NAMES` for speech in pieces of any size and of any one rate; keeps samples.

    Args:
        fps: frames per second of the motion.

    Raises:
        InputError: fps is not a positive number.

    >>> features = WaveformFeatures(15)
    >>> len(features.push(Speech(np.zeros(16_000, np.float32)))), len(features.finish())
    (14, 1)
    """

    def __init__(self, fps: float) -> None:
        super().__init__(fps, np.zeros(0, np.float32))
        self.delay = 1 / fps + 1 / RATE

    def _convert(self, samples: Floats) -> Floats:
        return samples

    def _rest(self) -> Floats:
        return np.zeros(0, np.float32)

    def _places(self, frames: NDArray[np.int64]) -> NDArray[np.float64]:
        """(n, `SAMPLES`) where the samples of frames lie, in samples of 16 kHz."""
        return np.multiply(frames[:, None] * SAMPLES + np.arange(SAMPLES), RATE / self.fps / SAMPLES)

    def _certain(self, frame: int) -> bool:
        return (frame + 1) * RATE / self.fps + 1 <= self._end

    def _rows(self, frames: NDArray[np.int64]) -> Floats:
        """See `StreamingFeatures`; after the end of the sound there is silence."""
        places = self._places(frames)
        low = places.astype(int)
        share = (places - low).astype(np.float32)
        samples = np.concatenate([self._data, np.zeros(2, np.float32)])
        first, second = (samples[np.minimum(low + k - self._first, len(samples) - 1)] for k in (0, 1))
        return np.clip(first + share * (second - first), -1, 1).astype(np.float32)  # type: ignore[no-any-return]

    def _find_oldest(self, frame: int) -> int:
        return min(int(frame * RATE / self.fps), self._end)


def waveform_rows(speech: Speech, frames: int, fps: float) -> Floats:
    """(frames, `SAMPLES`) float32 of a whole speech of any rate."""
    stream = WaveformFeatures(fps)
    parts = [stream.push(chunk) for chunk in speech.chunks(_PIECE)]
    return np.concatenate([*parts, stream.finish(frames)])[:frames]
