"""Files of a table: CSV that a spreadsheet reads, and LaTeX."""

from __future__ import annotations

import csv
import io
from html import unescape

import pytest

from cospeech.errors import InputError
from cospeech.evaluation import evaluate_clips, evaluate_store
from cospeech.metrics import Score
from cospeech.metrics.controls import WRONG
from cospeech.metrics.table import Table

SCORES = {
    "my_flow & co": {"fgd": Score(3164.0, (2412.0, 3704.0), 35, "untrained, 32-d"), "pck_2d": None},
    "ground truth": {"fgd": Score(1.25e-13, (0.0, 108.0), 35), "pck_2d": Score(float("nan"), None, 2)},
}
TABLE = Table(
    tuple(SCORES), ("fgd", "pck_2d"), SCORES, {"my_flow & co": {"pck_2d": "needs points"}},
    {"fgd": [f"frozen pose is {WRONG} ground truth"]}, "2 clips, 0.6 min", 2,
)  # fmt: skip


def test_the_csv_has_a_line_for_each_system_and_metric():
    rows = list(csv.DictReader(io.StringIO(TABLE.to_csv())))
    assert [(row["system"], row["metric"]) for row in rows] == [(system, name) for system in SCORES for name in TABLE.columns]
    assert [rows[0][key] for key in ("value", "low", "high", "count")] == ["3164.0", "2412.0", "3704.0", "35"]
    assert (rows[0]["better"], rows[0]["note"]) == ("lower", "untrained, 32-d")
    assert (rows[1]["value"], rows[1]["note"]) == ("", "needs points")
    assert (rows[3]["value"], rows[3]["low"]) == ("nan", "")


def test_the_latex_is_a_tabular_that_says_what_the_text_says():
    lines = TABLE.to_latex().splitlines()
    body = [line for line in lines if not line.startswith("%")]
    assert [line for line in body if line.startswith("my")] == [
        r"my\_flow \& co & $3.16 \times 10^{3} \pm 6.5 \times 10^{2}$ & -- \\"
    ]
    assert [line for line in body if line.startswith("ground")] == [
        r"ground truth & $1.25 \times 10^{-13}\;[0, 108]$ & $nan$ \\"
    ]
    assert r" & fgd $\downarrow^{!}$ & pck\_2d $\uparrow$ \\" in body
    assert body[0] == r"\begin{tabular}{lrr}"
    assert body.count(r"\midrule") == 2  # below the heads, and above the control rows
    comments = [line.removeprefix("% ") for line in lines if line.startswith("%")]
    assert comments[0] == TABLE.about
    assert all(line in TABLE.to_text().splitlines() for line in comments)


def test_a_row_without_a_score_is_named_with_the_reason():
    assert TABLE.to_text().splitlines()[-1] == "– pck_2d of my_flow & co: needs points"


def test_a_printed_table_is_its_text():
    assert str(TABLE) == TABLE.to_text()


def test_a_notebook_shows_the_text_and_no_markup_of_names():
    table = Table(("a <b>",), ("jerk",), {"a <b>": {"jerk": None}})
    assert "a &lt;b&gt;" in table._repr_html_()
    assert unescape(table._repr_html_()) == f"<pre>{table.to_text()}</pre>"


@pytest.mark.parametrize(
    ("metrics", "name", "problem"),
    [
        (("pkc",), "mine", "no metric is called 'pkc'"),
        ("pck", "mine", "a list of names"),
        ((), "mine", "no metrics"),
        (("pck",), "white noise", "a system called"),
    ],
)
def test_a_wrong_name_is_told_before_anything_is_read_or_played(metrics, name, problem, tmp_path):
    with pytest.raises(InputError, match=problem):
        evaluate_store({name: "rules"}, tmp_path / "no_store", metrics=metrics)
    with pytest.raises(InputError, match=problem):
        evaluate_clips({name: []}, [], metrics=metrics)
