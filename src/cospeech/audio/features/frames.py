"""Audio features at the rate of the motion: means of the features of `prosody` over the time of each frame; whole or streamed.

Frame f of the motion is at f / fps seconds; its row covers half a frame before to half a frame after. The same class computes
the features for training and at run time: all rows have the same bits, whatever the size of the pieces in which the sound
arrives.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .mel import FPS, Floats
from .prosody import DELAY, N_MELS, Features, ProsodyStream
from .shared_prosody import Prosody, SharedProsody
from .streaming import StreamingFeatures

if TYPE_CHECKING:
    from ..speech import Speech

__all__ = ["AUDIO_NAMES", "FrameFeatures", "audio_features", "frame_delay"]

AUDIO_NAMES = (*(f"mel{k}" for k in range(N_MELS)), "energy", "pitch", "voicing", "onset")
"""Columns of a row: natural log of 80 mel powers, then as in `Features`."""
_PITCH = AUDIO_NAMES.index("pitch")
_PIECE = 10.0  # seconds; ours: long speech is processed in pieces, which needs less memory and gives the same bits


def frame_delay(fps: float) -> float:
    """Seconds of 16 kHz sound after a frame's time that must have been heard before its row is certain.

    That is half a frame, the rounding to hundredths of a second, and the delay of a hundredth (`prosody.DELAY`): 65 ms at 20
    frames a second. For speech at another rate, the resampler adds 25 to 115 ms (measured; 40 ms at 44.1 and 48 kHz).

    >>> round(frame_delay(20), 3)
    0.065
    """
    return 0.5 / fps + 0.5 / FPS + DELAY - 1 / FPS


class FrameFeatures(StreamingFeatures):
    """Computes rows of `AUDIO_NAMES` for speech in pieces of any size and of any one rate; keeps hundredths of a second.

    Args:
        fps: frames per second of the motion.

    Raises:
        InputError: fps is not a positive number.

    >>> from cospeech.audio.speech import Speech
    >>> features = FrameFeatures(20)
    >>> len(features.push(Speech(np.zeros(24_000, np.float32)))), len(features.finish())
    (29, 1)
    """

    def __init__(self, fps: float) -> None:
        super().__init__(fps, np.zeros((0, len(AUDIO_NAMES)), np.float32))
        self.delay = frame_delay(fps)
        self._stream: Prosody = ProsodyStream(mel=True)

    def share(self, prosody: SharedProsody) -> None:
        """See `StreamingFeatures`."""
        self._stream = prosody.tap()

    def _convert(self, samples: Floats) -> Floats:
        return _columns(self._stream.push(samples))

    def _rest(self) -> Floats:
        return _columns(self._stream.flush())

    def _edge(self, frame: NDArray[np.int64]) -> NDArray[np.int64]:
        """The hundredth at which a frame's time begins."""
        edge: NDArray[np.int64] = np.maximum(np.round((frame - 0.5) * (FPS / self.fps)), 0).astype(int)
        return edge

    def _edge_of(self, frame: int) -> int:
        """As `_edge`, of one frame and without arrays: it is called at every piece."""
        return max(round((frame - 0.5) * (FPS / self.fps)), 0)

    def _certain(self, frame: int) -> bool:
        return self._edge_of(frame + 1) <= self._end and self._edge_of(frame) < self._end

    def _rows(self, frames: NDArray[np.int64]) -> Floats:
        low = np.minimum(self._edge(frames), self._end - 1)
        count = np.minimum(np.maximum(self._edge(frames + 1), low + 1), self._end) - low
        total, voiced = self._add_few(low, count) if count.max(initial=0) > len(frames) else self._add_many(low, count)
        pitch = total[:, _PITCH] / np.maximum(voiced, 1)
        out = (total / count[:, None]).astype(np.float32)
        out[:, _PITCH] = pitch
        return out

    def _add_few(self, low: NDArray[np.int64], count: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Sums (n, 84) of so many hundredths each, and (n,) how many of them are voiced; frame by frame."""
        total, voiced = np.empty((len(low), len(AUDIO_NAMES))), np.empty(len(low))
        for k, (first, many) in enumerate(zip((low - self._first).tolist(), count.tolist(), strict=True)):
            rows = self._data[first : first + many].astype(float)
            total[k], voiced[k] = np.add.reduce(rows, 0), np.count_nonzero(rows[:, _PITCH] > 0)
        return total, voiced

    def _add_many(self, low: NDArray[np.int64], count: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """As `_add_few`, hundredth by hundredth: the bits of a row do not depend on other rows."""
        total, voiced = np.zeros((len(low), len(AUDIO_NAMES))), np.zeros(len(low))
        for k in range(count.max(initial=0)):
            row = self._data[np.minimum(low + k, self._end - 1) - self._first]
            row = np.where((k < count)[:, None], row, 0.0)
            total += row
            voiced += row[:, _PITCH] > 0
        return total, voiced

    def _find_oldest(self, frame: int) -> int:
        return min(self._edge_of(frame), self._end - 1)


def _columns(features: Features) -> Floats:
    """(n, 84) columns of hundredths of a second."""
    assert features.mel is not None
    return np.concatenate([features.mel, np.stack([features.energy, features.pitch, features.voicing, features.onset], 1)], 1)


def audio_features(speech: Speech, frames: int, fps: float) -> Floats:
    """(frames, 84) float32 of a whole speech of any rate: the mean over a frame's own time (of pitch: its voiced part)."""
    stream = FrameFeatures(fps)
    parts = [stream.push(chunk) for chunk in speech.chunks(_PIECE)]
    return np.concatenate([*parts, stream.finish(frames)])[:frames]
