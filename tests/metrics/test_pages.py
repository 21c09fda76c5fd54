"""Every metric has a page, with its name, its control rows, and where they come from."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from cospeech.metrics import METRICS, load_metric
from cospeech.metrics.controls import CONTROLS

PAGES = Path(__file__).resolve().parents[2] / "docs" / "metrics"
MODULES = sorted({where.split(":")[0].rpartition(".")[2] for where in METRICS.values()})


@pytest.mark.parametrize("module", MODULES)
def test_every_metric_has_a_page_with_control_rows(module):
    text = (PAGES / f"{module}.md").read_text("utf-8")
    table = re.search(r"<!-- measured -->\n(.*?)<!-- end -->", text, re.S)[1]
    for name, where in METRICS.items():
        if where.split(":")[0].endswith(f".{module}"):
            assert f"`{name}`" in text.replace(table, ""), f"{name} is not explained"
            assert f"`{name}`" in table, f"{name} is not measured: python tools/measure_metrics.py SPEECH"
    assert all(f"\n| {row} |" in table for row in CONTROLS)
    assert "Synthetic" in table
    assert "rule-based model" in table
    assert "uirk" in text


def test_there_is_no_page_without_a_metric():
    assert sorted(path.stem for path in PAGES.glob("*.md")) == MODULES


def test_the_table_of_beat_alignment_shows_both_sides():
    """The page says: as coded, noise is better than a speaker; corrected, noise scores nothing beyond its interval."""
    text = (PAGES / "beat_align.md").read_text("utf-8")
    names = [name.strip(" `↑") for name in re.search(r"^\| \|(.*)\|$", text, re.M)[1].split("|")]
    rows = {row[0]: dict(zip(names, row[1:], strict=True)) for row in
            ([cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| "))
            if row[0] in CONTROLS}  # fmt: skip
    value = {
        row: {name: [float(part) for part in cell.split("±")] for name, cell in cells.items()} for row, cells in rows.items()
    }
    assert value["white noise"]["beat_align_beat"][0] > 0.9
    assert value["white noise"]["beat_align_beat"][0] > value["ground truth"]["beat_align_beat"][0]
    for row in CONTROLS[1:]:
        middle, half = value[row]["beat_align"]
        assert abs(middle) <= half + 0.01
    middle, half = value["ground truth"]["beat_align"]
    assert middle - half > 0


def test_units_are_said_where_there_are_any():
    assert load_metric("ape").about.unit == "m"
    assert load_metric("w1_speed").about.unit.startswith("m/s")
