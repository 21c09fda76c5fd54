"""Files of a table: what their names tell, and that no table is lost to another one; which rows are made."""

from __future__ import annotations

import json
import warnings
from types import SimpleNamespace

import numpy as np
import pytest

from cospeech.corpora.store import Entry
from cospeech.corpora.store_writer import Piece, write_store
from cospeech.errors import CospeechWarning, InputError
from cospeech.experiments.tables import Runs, making, write_table
from cospeech.experiments.tables.cog import COG
from cospeech.experiments.tables.making import choose_rows

ROWS = COG["cog-2"].parts[0].rows


def make(*, store: str = "beat-1", rows: tuple[str, ...] = ("a", "b"), seeds: tuple[int, ...] = (0,), value: float = 1.0):
    cell = {"fgd": {"mean": value, "half": None, "values": [value], "note": ""}}
    table_rows = {name: {"recipe": "r", "published": {}} | ({"cells": cell} if name in rows else {}) for name in ("a", "b")}
    return {
        "table": "cog-2", "title": "t", "columns": {"fgd": "FGD"}, "head": "h", "pose": "euler", "small": True,
        "seeds": [*seeds], "rows": table_rows, "controls": {}, "verdicts": [],
        "origin": {"store": store, "rows": dict.fromkeys(rows, "r-1-0"), "settings": ["train.steps=6"]},
    }  # fmt: skip


def names(folder) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def write_quietly(table, folder):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return write_table(table, folder)


def test_a_table_that_has_all_of_the_last_one_takes_its_place(tmp_path):
    write_quietly(make(), tmp_path)
    data, page = write_quietly(make(seeds=(0, 1), value=2.0), tmp_path)
    assert json.loads(data.read_text("utf-8")) == make(seeds=(0, 1), value=2.0)
    assert names(tmp_path) == [data.name, page.name] == ["cog-2-euler-small.json", "cog-2-euler-small.md"]


@pytest.mark.parametrize(
    ("last", "message"),
    [
        (make(store="beat-2"), "a table of another store;"),
        (make(seeds=(0, 7)), "a table of other seeds;"),
        (make() | {"origin": make()["origin"] | {"settings": ["--raw"]}}, "a table of other settings;"),
        ({key: value for key, value in make().items() if key != "origin"}, "a table of an unknown store;"),  # older files
    ],
)
def test_another_table_is_kept_and_told(tmp_path, last, message):
    place = tmp_path / "cog-2-euler-small.json"
    place.write_text(json.dumps(last), "utf-8")
    place.with_suffix(".md").write_text("its page", "utf-8")
    with pytest.warns(CospeechWarning, match=message) as notes:
        write_table(make(), tmp_path)
    assert json.loads(place.read_text("utf-8")) == make()
    (backup,) = tmp_path.glob("cog-2-euler-small-kept-*.json")
    assert backup.name in str(notes[0].message)
    assert json.loads(backup.read_text("utf-8")) == last
    assert backup.with_suffix(".md").read_text("utf-8") == "its page"


def test_a_part_has_a_name_of_its_own(tmp_path):
    write_quietly(make(), tmp_path)
    (tmp_path / "cog-2-euler-small.md").unlink()
    data, _ = write_quietly(make(rows=("b",)), tmp_path)
    assert names(tmp_path) == ["cog-2-euler-small-part.json", "cog-2-euler-small-part.md", "cog-2-euler-small.json"]
    with pytest.warns(CospeechWarning, match="other rows"):
        write_table(make(rows=("a",)), tmp_path)
    assert len(names(tmp_path)) == 5
    assert [*json.loads(data.read_text("utf-8"))["origin"]["rows"]] == ["a"]


def test_a_hyphen_names_a_row_with_a_minus():
    assert choose_rows(ROWS, ["-face"]) == choose_rows(ROWS, ["−face"]) == {"−face"}
    with pytest.raises(InputError, match="called '-fase'"):
        choose_rows(ROWS, ["-fase"])


def test_the_head_counts_one_of_a_kind(tmp_path):
    rows = {"pose": np.zeros((5, 2), np.float32)}
    piece = Piece(Entry("one", "ann", "train", 0, 5, 0.0, ("pose",)), (), lambda: dict(rows))
    write_store(tmp_path / "one", [piece], corpus="beat", pose="none", fps=15.0, names={"pose": ("a", "b")})
    head = making._head(Runs(tmp_path / "one"), SimpleNamespace(windows="1 test window", features=""), [3], ())
    assert ", 1 speaker, " in head
    assert head.endswith("; seed 3")
