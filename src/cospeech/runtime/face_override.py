"""A given face, shown in place of the face of the rules."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..audio.emotions import Moods
from ..audio.features.shared_prosody import SharedProsody
from ..audio.speech import Speech
from ..motion.motion import Motion
from ..motion.rotations import Array
from ..rules import Session
from .conditioning import ConditioningFace

__all__ = ["FaceOverride"]


class FaceOverride:
    """A rule-based session whose weights of the face give way to given ones; gaze and moods are the session's.

    Args:
        session: makes a face of its own.
        face: the given one.
    """

    def __init__(self, session: Session, face: ConditioningFace) -> None:
        self._session, self._face, self._frame = session, face, 0

    @property
    def emotion(self) -> dict[str, float]:
        """See `cospeech.rules.Session`."""
        return self._session.emotion

    @property
    def expression(self) -> dict[str, float]:
        """See `cospeech.rules.Session`."""
        return self._session.expression

    @property
    def arousal(self) -> float | None:
        """See `cospeech.rules.Session`."""
        return self._session.arousal

    def arousal_at(self, times: Array) -> Array:
        """See `cospeech.rules.Session`."""
        return self._session.arousal_at(times)

    @property
    def latency(self) -> float:
        """See `cospeech.rules.Session`."""
        return self._session.latency

    @property
    def look_ahead(self) -> float:
        """See `cospeech.rules.Session`."""
        return self._session.look_ahead

    def is_quiet(self, samples: int) -> bool:
        """See `cospeech.rules.Session`."""
        return self._session.is_quiet(samples)

    def share(self, prosody: SharedProsody) -> None:
        """See `cospeech.rules.Session`."""
        self._session.share(prosody)

    def set_emotion(self, emotion: str | Moods) -> None:
        """See `cospeech.rules.Session`."""
        self._session.set_emotion(emotion)

    def set_intensity(self, intensity: float) -> None:
        """See `cospeech.rules.Session`."""
        self._session.set_intensity(intensity)

    def push(self, chunk: Speech) -> Iterator[Motion]:
        """See `cospeech.rules.Session`."""
        return self._session.push(chunk)

    def hear_rest(self) -> None:
        """See `cospeech.rules.Session`."""
        self._session.hear_rest()

    def finish(self) -> Iterator[Motion]:
        """See `cospeech.rules.Session`."""
        return self._session.finish()

    def aim(self, motion: Motion) -> Motion:
        """See `cospeech.rules.Session`; the next frames."""
        weights, share = self._face.at((self._frame + np.arange(len(motion))) / motion.fps)
        self._frame += len(motion)
        result = self._session.aim(motion)
        return result if result.face is None else replace(result, face=(1 - share) * result.face + share * weights)
