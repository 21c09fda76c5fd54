"""Audio features at the rate of the motion: the mean of what `prosody` hears over each frame's own time; whole or streamed.

Frame f of the motion is at f / fps seconds; its row covers half a frame before to half a frame after. The same class works out
the features that a network is trained on and those that it is given at run time: all rows have the same bits, whatever the
pieces in which the sound arrived.
"""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .at_16_khz import At16kHz
from .mel import FPS, Floats
from .prosody import DELAY, N_MELS, Features, ProsodyStream

if TYPE_CHECKING:
    from ..speech import Speech

__all__ = ["AUDIO_NAMES", "FrameFeatures", "audio_features", "frame_delay"]

AUDIO_NAMES = (*(f"mel{k}" for k in range(N_MELS)), "energy", "pitch", "voicing", "onset")
"""Columns of a row: natural log of 80 mel powers, then as in `Features`."""
_PITCH = AUDIO_NAMES.index("pitch")
_PIECE = 10.0  # seconds; ours: long speech is heard in pieces, which needs less memory and gives the same bits


def frame_delay(fps: float) -> float:
    """Seconds of 16 kHz sound after a frame's time that must have been heard before its row is certain.

    Half a frame, the rounding to hundredths, and what a hundredth itself waits for (`prosody.DELAY`); 65 ms at 20 frames a
    second. The resampler of speech at another rate keeps another 25 to 115 ms back (measured; 40 ms at 44.1 and 48 kHz).

    >>> round(frame_delay(20), 3)
    0.065
    """
    return 0.5 / fps + 0.5 / FPS + DELAY - 1 / FPS


class FrameFeatures:
    """Rows of `AUDIO_NAMES` for speech that arrives in pieces of any size and of one rate, whichever.

    Args:
        fps: frames per second of the motion.

    Raises:
        InputError: fps is not a positive number.

    >>> from cospeech.speech import Speech
    >>> heard = FrameFeatures(20)
    >>> len(heard.push(Speech(np.zeros(24_000, np.float32)))), len(heard.finish())
    (29, 1)
    """

    def __init__(self, fps: float) -> None:
        if not 0 < fps < np.inf:
            raise InputError(f"{fps} frames per second", "a positive number, such as 20")
        self.fps = fps
        self.delay = frame_delay(fps)
        """Seconds of 16 kHz sound after a frame's time that must have been heard before its row is certain."""
        self._speech = At16kHz()
        self._stream = ProsodyStream(mel=True)
        self._first = 0  # index of the first hundredth that is kept
        self._heard = np.zeros((0, len(AUDIO_NAMES)), np.float32)
        self._given = 0  # rows handed out

    @property
    def duration(self) -> Fraction:
        """Seconds heard so far."""
        return self._speech.duration

    def push(self, chunk: Speech) -> Floats:
        """(n, 84) float32: the rows that this piece makes certain; possibly none.

        Raises:
            InputError: the piece has another rate than those before, or the speech is over.
        """
        self._take(self._stream.push(self._speech.push(chunk)))
        known = self._first + len(self._heard)
        until = self._given
        while self._edge(until + 1) <= known and self._edge(until) < known:
            until += 1
        return self._give(until)

    def finish(self, frames: int | None = None) -> Floats:
        """The rest of the rows; frames after the end of the sound have its last hundredth's.

        Args:
            frames: how many rows there shall be in all; ceil(duration × fps) where not given. Fewer than were handed out
                already are no error: then there is no rest.
        """
        from ..speech import count_frames

        total = count_frames(self.duration, self.fps) if frames is None else frames
        if not self._speech.finished:
            self._take(self._stream.push(self._speech.finish()))
            self._take(self._stream.flush())
        return self._give(max(total, self._given))

    def _take(self, heard: Features) -> None:
        assert heard.mel is not None
        rest = np.stack([heard.energy, heard.pitch, heard.voicing, heard.onset], 1)
        self._heard = np.concatenate([self._heard, np.concatenate([heard.mel, rest], 1)])

    def _edge(self, frame: int | NDArray[np.int64]) -> Any:
        """The hundredth at which a frame's time begins."""
        return np.maximum(np.round((frame - 0.5) * (FPS / self.fps)), 0).astype(int)

    def _give(self, until: int) -> Floats:
        """Rows up to ``until``; forgets the hundredths that no later row needs."""
        frames = np.arange(self._given, until)
        end = self._first + len(self._heard)
        low = np.minimum(self._edge(frames), end - 1)
        count = np.clip(self._edge(frames + 1), low + 1, end) - low
        total = np.zeros((len(frames), len(AUDIO_NAMES)))
        voiced = np.zeros(len(frames))
        for k in range(count.max(initial=0)):  # one after the other: the bits do not depend on the rows beside
            row = self._heard[np.minimum(low + k, end - 1) - self._first]
            row = np.where((k < count)[:, None], row, 0.0)
            total += row
            voiced += row[:, _PITCH] > 0
        pitch = total[:, _PITCH] / np.maximum(voiced, 1)
        out = (total / count[:, None]).astype(np.float32)
        out[:, _PITCH] = pitch
        self._given = until
        done = min(max(int(self._edge(until)), self._first), end - 1) - self._first
        if done > 0:
            self._first, self._heard = self._first + done, self._heard[done:].copy()
        return out


def audio_features(speech: Speech, frames: int, fps: float) -> Floats:
    """(frames, 84) float32 of a whole speech of any rate: the mean over a frame's own time (of pitch: its voiced part)."""
    heard = FrameFeatures(fps)
    parts = [heard.push(chunk) for chunk in speech.chunks(_PIECE)]
    return np.concatenate([*parts, heard.finish(frames)])[:frames]
