"""The report of ``cospeech prepare`` on a store."""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from ...errors import CospeechWarning
from ..attributes import Attributes
from ..shared_speech import describe_shared_speech

__all__ = ["PrepareReport", "describe_reasons", "join_notes"]

_USES = {
    "train": "nothing can be trained on this store",
    "validation": "train with --set data.validation=0.05, or with --set train.validate_every=0",
    "test": "evaluate with --split all, or another split; what was trained on those clips scores too well",
}
"""Split → what its absence means."""
_OWN = re.compile(r"'[^']*'|\d+(?:\.\d+)?")  # what differs between the same reason of two recordings: names and numbers


def describe_reasons(drops: Sequence[Mapping[str, Any]]) -> str:
    """The reason for which most recordings are left out, with the first of them, for an error."""
    if not drops:
        return "it holds no clips"
    kinds = [_OWN.sub("", row["reason"].removeprefix(f"{row['name']}: ")) for row in drops]
    ((kind, count),) = Counter(kinds).most_common(1)
    first = drops[kinds.index(kind)]
    share = "" if len(drops) == 1 else f"{count} of {len(drops)} for this reason; "
    return f"{share}the first: {first['name']}: {first['reason']}"


@contextmanager
def join_notes() -> Iterator[None]:
    """Notes of one text on several files (``'FILE': TEXT``) are given once, at the end, with the number of files."""
    notes: dict[str, list[str]] = {}

    def keep(message: Warning | str, category: type[Warning], *where: Any) -> None:
        if not issubclass(category, CospeechWarning):
            return usual(message, category, *where)
        text = str(message)
        file, _, rest = text.partition(": ") if text.startswith(("'", '"')) else ("", "", text)
        files = notes.setdefault(rest, [])
        files += [file] if file not in files else []
        return None

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", CospeechWarning)
            usual, warnings.showwarning = warnings.showwarning, keep  # type: ignore[assignment]
            yield
    finally:
        for text, files in notes.items():
            more = f" and {len(files) - 1} more" if len(files) > 1 else ""
            warnings.warn(f"{files[0]}{more}: {text}" if files[0] else text, CospeechWarning, stacklevel=4)


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
    shared: dict[str, float]
    """Split → share of its speech that is also said in training; see `cospeech.corpora.shared_speech`."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what the store lacks for training and evaluation; none where it lacks nothing."""
        uses = _USES if self.clips > 3 else _USES | {"validation": "train with --set train.validate_every=0"}
        lacks = [f"no clip is in the {name} split: {use}" for name, use in uses.items() if not self.splits.get(name)]
        return (*lacks, *(f"{sentence}: new speech would be harder" for sentence in describe_shared_speech(self.shared)))

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
