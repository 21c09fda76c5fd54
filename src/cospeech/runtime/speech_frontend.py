"""Speech, and its words, → rows as a network takes them."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..audio.features.reduce import audio_columns, has_levels, louder, open_features, reduce_audio
from ..audio.features.shared_prosody import SharedProsody
from ..audio.features.words import WordStream
from ..audio.level_control import LevelControl
from ..audio.speech import Speech, count_frames
from ..motion.rotations import Array
from .crossfade import Crossfade
from .system import System

__all__ = ["SpeechFrontend", "SpeechTextFrontend"]


class SpeechFrontend:
    """Speech in pieces → standardised rows, style controls behind each.

    Args:
        system: the bundle, opened.
        controls: (C,) standardised style controls.
    """

    def __init__(self, system: System, controls: Array) -> None:
        self._system = system
        self._controls = Crossfade(_row(controls), system.fps)
        self._features = open_features(system.audio, system.fps)
        self._level: LevelControl | None = None
        if has_levels(system.audio):
            names = audio_columns(system.audio)
            self._level, self._level_columns = LevelControl(system.fps), [names.index("energy"), names.index("voicing")]
            self._per_decibel = np.array(louder(system.audio)) / 10
        self._silent_row = reduce_audio(_hear_silence(system.audio, system.fps), system.audio)
        self._silence = self._standard(self._silent_row)
        self._frame = 0
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
        """(1, A) the row of silence, with the style controls of the next frame."""
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
        rows = self._append_controls(self._standard(self._raise(columns)))
        self._frame += len(rows)
        self._controls.forget(self._frame)
        return rows

    def _raise(self, columns: Array) -> Array:
        """(T, C) columns → (T, A) reduced; quiet speech is raised to a usual level, silence stays silence."""
        rows = reduce_audio(columns, self._system.audio)
        if self._level is None:
            return rows
        gains = self._level.follow(*columns[:, self._level_columns].T)
        if not gains.any():
            return rows
        return rows + np.minimum(gains[:, None] * self._per_decibel, np.maximum(rows - self._silent_row, 0)).astype(np.float32)

    def _standard(self, rows: Array) -> Array:
        """(T, A) rows as the network hears them; values beyond those of its training data are clipped."""
        s = self._system.statistics
        rows = (rows - s.audio_mean) / s.audio_std
        return np.minimum(np.maximum(rows, s.audio_low), s.audio_high).astype(np.float32)

    def _append_controls(self, rows: Array) -> Array:
        if not self._system.controls:
            return rows
        controls = self._controls.mix(lambda row: row, self._frame + np.arange(len(rows)))[0]
        return np.concatenate([rows, np.broadcast_to(controls, (len(rows), controls.shape[1]))], 1)


class SpeechTextFrontend:
    """Speech in pieces → standardised rows, the vector of the word of each behind it; zeros where the words are not known.

    It has the methods of `SpeechFrontend`.

    Args:
        system: the bundle, opened.
        controls: (C,) standardised style controls.
    """

    def __init__(self, system: System, controls: Array) -> None:
        self._system, self._frontend, self._words = system, SpeechFrontend(system, controls), WordStream(system.fps)
        self._sound_rows = self._frontend.silence[:0]
        self._no_word = system.word_rows([None])
        self._word_rows = self._no_word[:0]

    def share(self, prosody: SharedProsody) -> None:
        """See `SpeechFrontend`."""
        self._frontend.share(prosody)

    @property
    def frames(self) -> int:
        """Of the model, in all that was heard."""
        return self._frontend.frames

    @property
    def delay(self) -> float:
        """Seconds after a frame's time until its row is there."""
        return max(self._frontend.delay, self._words.delay)

    @property
    def silence(self) -> Array:
        """(1, A + W) a row of silence."""
        return np.concatenate([self._frontend.silence, np.zeros((1, self._word_rows.shape[1]), np.float32)], 1)

    def control(self, controls: Array) -> None:
        """See `SpeechFrontend`."""
        self._frontend.control(controls)

    def push(self, chunk: Speech) -> Array:
        """(n, A + W) rows that have become certain."""
        self._sound_rows = np.concatenate([self._sound_rows, self._frontend.push(chunk)])
        return self._join(self._words.push(chunk))

    def finish(self) -> Array:
        """The rest."""
        self._sound_rows = np.concatenate([self._sound_rows, self._frontend.finish()])
        return self._join(self._words.finish(self.frames))

    def _join(self, words: list[str | None]) -> Array:
        """Rows of which both the sound and the word are known."""
        read = self._system.word_rows(words) if any(words) else np.repeat(self._no_word, len(words), 0)
        self._word_rows = np.concatenate([self._word_rows, read])
        count = min(len(self._sound_rows), len(self._word_rows))
        rows = np.concatenate([self._sound_rows[:count], self._word_rows[:count]], 1)
        self._sound_rows, self._word_rows = self._sound_rows[count:].copy(), self._word_rows[count:].copy()
        return rows


@cache
def _hear_silence(audio: str, fps: float) -> Array:
    """(1, C) columns of silence; to be read only."""
    features = open_features(audio, fps)
    rows = features.push(Speech(np.zeros(16_000, np.float32)))
    row = np.concatenate([rows, features.finish(1)])[:1]
    row.setflags(write=False)
    return row


def _row(controls: Array) -> Array:
    return np.asarray(controls)[None, None]
