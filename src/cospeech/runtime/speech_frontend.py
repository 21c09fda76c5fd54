"""Speech → rows of features as a network hears them."""

from __future__ import annotations

import numpy as np

from ..audio.features.reduce import open_features, reduce_audio
from ..audio.features.shared_prosody import SharedProsody
from ..audio.speech import Speech, count_frames
from ..motion.rotations import Array
from .crossfade import Crossfade
from .manifest import System

__all__ = ["SpeechFrontend"]


class SpeechFrontend:
    """Speech in pieces → standardised rows, style controls behind each.

    Args:
        system: whose.
        controls: (C,) standardised style controls.
    """

    def __init__(self, system: System, controls: Array) -> None:
        self._system = system
        self._controls = Crossfade(_row(controls), system.fps)
        self._features = open_features(system.audio, system.fps)
        self._silence = self._standard(_silence(system))
        self._given = 0
        self._nothing = self.silence[:0]

    def share(self, prosody: SharedProsody) -> None:
        """See `cospeech.audio.features.streaming.StreamingFeatures`."""
        self._features.share(prosody)

    @property
    def frames(self) -> int:
        """Of the model, in all that was heard."""
        return count_frames(self._features.duration, self._system.fps)

    @property
    def delay(self) -> float:
        """Seconds of sound at 16 kHz after a frame's time until its row is there."""
        return self._features.delay

    @property
    def silence(self) -> Array:
        """(1, A) what silence sounds like where rows have come to."""
        return self._append_controls(self._silence)

    def control(self, controls: Array) -> None:
        """Other style controls (C,) from the frame on that was heard last."""
        self._controls.change(_row(controls), self.frames)

    def push(self, chunk: Speech) -> Array:
        """(n, A) rows that have become certain."""
        return self._rows(self._features.push(chunk))

    def finish(self) -> Array:
        """The rest."""
        return self._rows(self._features.finish())

    def _rows(self, columns: Array) -> Array:
        if not len(columns):
            return self._nothing
        rows = self._append_controls(self._standard(columns))
        self._given += len(rows)
        self._controls.forget(self._given)
        return rows

    def _standard(self, columns: Array) -> Array:
        """(T, C) columns as the network hears them; sounds louder or softer than any it has heard are as those."""
        s = self._system.statistics
        rows = (reduce_audio(columns, self._system.audio) - s.audio_mean) / s.audio_std
        return np.clip(rows, s.audio_low, s.audio_high).astype(np.float32)

    def _append_controls(self, rows: Array) -> Array:
        controls = self._controls.mix(lambda row: row, self._given + np.arange(len(rows)))[0]
        return np.concatenate([rows, np.broadcast_to(controls, (len(rows), controls.shape[1]))], 1)


def _silence(system: System) -> Array:
    """(1, C) columns of silence."""
    silence = open_features(system.audio, system.fps)
    rows = silence.push(Speech(np.zeros(16_000, np.float32)))
    return np.concatenate([rows, silence.finish(1)])[:1]


def _row(controls: Array) -> Array:
    return np.asarray(controls)[None, None]
