"""What ``cospeech prepare`` says of a store."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..attributes import Attributes

__all__ = ["PrepareReport"]


@dataclass(frozen=True)
class PrepareReport:
    """What went into a store, and what did not; ``report.json`` beside the store's index."""

    corpus: str
    pose: str
    fps: float
    clips: int
    """Read, without derived speakers and augmented ones."""
    augmented: int
    seconds: float
    """Of motion in the store, derived speakers and augmented clips included."""
    splits: dict[str, float]
    """Seconds per split."""
    speakers: dict[str, float]
    """Seconds per speaker."""
    reasons: dict[str, float]
    """Reason → seconds that filters dropped for it."""
    dropped: tuple[dict[str, Any], ...]
    """Recordings and stretches left out: name, reason, and of stretches start and end in seconds."""
    derived_speakers: int
    """Clips of derived speakers; see `cospeech.corpora.derived_speakers`."""
    attributes: dict[str, Attributes]
    """Speaker → how they gesture, measured; see `cospeech.corpora.attributes`."""
    cut: dict[str, float]
    """Reason → seconds of motion or sound that are left out because the other ends half a second earlier, or more."""

    def summary(self) -> str:
        """One line."""
        whole = sum("start" not in row for row in self.dropped)
        parts = [f"{self.seconds / 60:.1f} min", f"clips: {self.clips}", f"speakers: {len(self.speakers)}"]
        parts += [f"of derived speakers: {self.derived_speakers}"] if self.derived_speakers else []
        parts += [f"by augmentation: {self.augmented}"] if self.augmented else []
        parts += [f"dropped: {whole}"] if whole else []
        parts += [f"filtered: {sum(self.reasons.values()):.1f} s"] if self.reasons else []
        parts += [f"cut: {sum(self.cut.values()):.1f} s"] if self.cut else []
        return ", ".join(parts)
