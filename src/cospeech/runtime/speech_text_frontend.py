"""Speech and its words → rows as a chain takes them."""

from __future__ import annotations

import numpy as np

from ..audio.features.shared_prosody import SharedProsody
from ..audio.features.words import WordStream
from ..audio.speech import Speech
from ..motion.rotations import Array
from .chain_bundle import ChainSystem
from .speech_frontend import SpeechFrontend

__all__ = ["SpeechTextFrontend"]


class SpeechTextFrontend:
    """Speech in pieces → standardised rows, what stands for the word of each behind it; zeros where nobody knows the words.

    What it offers is as of `SpeechFrontend`.

    Args:
        system: whose.
    """

    def __init__(self, system: ChainSystem) -> None:
        self._system, self._frontend, self._words = (
            system,
            SpeechFrontend(system, np.zeros(0, np.float32)),
            WordStream(system.fps),
        )
        self._heard = self._frontend.silence[:0]
        self._read = np.zeros((0, system.engine.sizes.words), np.float32)

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
        return np.concatenate([self._frontend.silence, np.zeros((1, self._system.engine.sizes.words), np.float32)], 1)

    def control(self, controls: Array) -> None:
        """A chain has no style controls: they are of no width."""

    def push(self, chunk: Speech) -> Array:
        """(n, A + W) rows that have become certain."""
        self._heard = np.concatenate([self._heard, self._frontend.push(chunk)])
        return self._join(self._words.push(chunk))

    def finish(self) -> Array:
        """The rest."""
        self._heard = np.concatenate([self._heard, self._frontend.finish()])
        return self._join(self._words.finish(self.frames))

    def _join(self, words: list[str | None]) -> Array:
        """Rows of which both the sound and the word are known."""
        self._read = np.concatenate([self._read, self._system.word_rows(words)])
        known = min(len(self._heard), len(self._read))
        rows = np.concatenate([self._heard[:known], self._read[:known]], 1)
        self._heard, self._read = self._heard[known:].copy(), self._read[known:].copy()
        return rows
