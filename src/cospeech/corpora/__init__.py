"""Corpora: one module per data set, each reading it as it lies on disk.

A reader is a function ``read(raw) -> Iterator[Clip | Dropped]``; where the layout can be written, ``write(clips, raw)`` writes
the same layout byte for byte as the original's tools do.
"""

from __future__ import annotations

from typing import NamedTuple

from ..motion.points import Points
from .clip import Clip, Dropped, Semantic

__all__ = ["CORPORA", "Clip", "Corpus", "Dropped", "Points", "Semantic"]


class Corpus(NamedTuple):
    """A row of the table of corpora."""

    module: str
    what: str
    writable: bool


CORPORA: dict[str, Corpus] = {
    "ted": Corpus("cospeech.corpora.ted.read", "TED talks (Yoon 2019/2020): LMDB of 10 joints in 3-D, raw audio, words", True),
    "trinity": Corpus("cospeech.corpora.trinity.read", "Trinity Speech-Gesture / GENEA 2020: BVH, WAV, word JSON", True),
    "pats": Corpus("cospeech.corpora.pats.read", "PATS: HDF5 of 52 key points in 2-D, log-mel, words", True),
    "beat": Corpus("cospeech.corpora.beat.read", "BEAT: BVH, face JSON, WAV, TextGrid, semantics, emotion", True),
    "beat2": Corpus("cospeech.corpora.beat2", "BEAT2: SMPL-X npz, WAV, TextGrid, semantics", False),
    "zeroeggs": Corpus("cospeech.corpora.zeroeggs", "ZeroEGGS: BVH and WAV in 19 styles", False),
    "faces": Corpus("cospeech.corpora.faces", "tracked faces of talking people: GRID by MediaPipe, FACEGOOD", False),
    "folder": Corpus("cospeech.corpora.folder", "any folder of sound files, with motion and transcripts beside them", False),
}
"""Name → module; `cospeech list corpora`, ``prepare`` and the tests iterate over it."""
