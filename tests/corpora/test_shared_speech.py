"""Speech of the test that is also in training: it is measured and told."""

from __future__ import annotations

import numpy as np
import pytest

from cospeech.corpora.prepare.report import PrepareReport
from cospeech.corpora.shared_speech import measure_shared_speech
from cospeech.corpora.store import Entry, Store
from cospeech.corpora.store_writer import Piece, write_store

WORDS = tuple(f"word{k:02d}" for k in range(40))


def piece(name: str, split: str, numbers: list[int] | None) -> Piece:
    """A clip that says these words, three frames each, with silence after every fourth."""
    rows = np.array(
        [n + 1 for k, n in enumerate(numbers or [0] * 9) for n in ([n] * 3 + ([-1] if k % 4 == 3 else []))], np.int32
    )
    values = {"pose": np.zeros((len(rows), 2), np.float32)} | ({} if numbers is None else {"word": rows})
    return Piece(Entry(name, "ann", split, 0, len(rows), 0.0, tuple(values)), WORDS, lambda: dict(values))


def shares(folder, *pieces: Piece) -> dict[str, float]:
    write_store(folder, pieces, corpus="beat", pose="none", fps=15.0, names={"pose": ("a", "b")})
    return measure_shared_speech(Store(folder))


def test_shared_speech_is_found_wherever_it_stands(tmp_path):
    train = piece("a", "train", [*range(20)])
    by_split = shares(
        tmp_path / "one", train, piece("b", "test", [30, *range(5, 16)]), piece("c", "validation", [*range(39, 19, -1)])
    )
    assert by_split == {"test": pytest.approx(4 / 5), "validation": 0}
    assert shares(tmp_path / "two", train, piece("b", "test", [*range(7)]), piece("c", "validation", None)) == {}


def test_shared_speech_is_told(tmp_path):
    given = (
        "beat",
        "euler",
        15.0,
        9,
        0,
        60.0,
        {"train": 40.0, "validation": 10.0, "test": 10.0},
        {"ann": 60.0},
        {},
        (),
        0,
        {},
        {},
    )
    assert PrepareReport(*given, {"test": 0.02}).notes == ()
    (note,) = PrepareReport(*given, {"test": 0.84, "validation": 0.0}).notes
    assert note.startswith("84 % of the speech of the test split is also said in training")
