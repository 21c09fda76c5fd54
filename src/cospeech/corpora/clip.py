"""Clip: one recording of somebody speaking, as every corpus reader yields it and every writer takes it.

What a corpus does not have is None, never zeros.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ..audio.speech import Speech
from ..errors import InputError
from ..motion.motion import Motion
from ..motion.points import Points
from ..motion.rotations import Array

__all__ = ["SPLITS", "Clip", "Dropped", "Semantic"]

SPLITS = ("train", "validation", "test")


@dataclass(frozen=True)
class Semantic:
    """A stretch with a semantic score (BEAT's annotation): seconds, 0 … 1, the kind as the corpus names it, key words."""

    start: float
    end: float
    score: float
    kind: str = ""
    words: str = ""


@dataclass(frozen=True, eq=False)
class Clip:
    """One recording.

    Args:
        name: unique within the corpus.
        speaker: who speaks.
        corpus: name of the corpus.
        speech: sound and words; its ``words`` are None where the corpus has none.
        motion: joint rotations on the corpus's own skeleton (and the face where it has one at the same rate).
        points: key points, for corpora without rotations.
        face: (T, 52) ARKit weights where they come at a rate of their own.
        face_fps: of ``face``.
        emotion: one of the eight of BEAT (`cospeech.rules.EMOTIONS`).
        semantics: annotated stretches; an empty tuple means annotated as having none.
        split: one of `SPLITS`, where the corpus fixes it.
        start: seconds from the beginning of the original recording.
        extra: what only this corpus has (video ids, precomputed features), by name.
        pose: representation that the motion or the key points were decoded from, where a store kept them.

    Raises:
        InputError: a name that is no text, or a split that there is not.
    """

    name: str
    speaker: str
    corpus: str
    speech: Speech | None = None
    motion: Motion | None = None
    points: Points | None = None
    face: Array | None = None
    face_fps: float | None = None
    emotion: str | None = None
    semantics: tuple[Semantic, ...] | None = None
    split: str | None = None
    start: float = 0.0
    extra: dict[str, object] = field(default_factory=dict)
    pose: str | None = None

    def __post_init__(self) -> None:
        for what in ("name", "speaker", "corpus"):
            value = getattr(self, what)
            if not isinstance(value, str):
                raise InputError(f"clip {self.name!r}: the {what} is {value!r:.60}", "it is text")
        if self.split not in (None, *SPLITS):
            raise InputError(f"clip {self.name!r}: {self.split!r:.60} is no split", f"{', '.join(SPLITS)}, or None")

    @property
    def duration(self) -> float:
        """Seconds of motion or key points, else of speech."""
        for part in (self.motion, self.points, self.speech):
            if part is not None:
                return part.duration if not isinstance(part, Speech) else float(part.duration)
        return 0.0


@dataclass(frozen=True)
class Dropped:
    """A recording that a reader or a filter left out, and why; readers yield these between clips, nothing is lost silently."""

    name: str
    reason: str
