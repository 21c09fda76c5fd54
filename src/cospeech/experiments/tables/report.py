"""A table as text: means over seeds with their intervals, published figures beside them, verdicts on the paper's claims.

The table is a plain dictionary, as in the JSON file. Text and markdown are made from it alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import sqrt
from typing import Any

import numpy as np

from ...metrics.controls import WRONG
from .paper_tables import Cells

__all__ = ["summary", "to_markdown", "to_text"]

_T = (12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131, 2.120, 2.110,
      2.101, 2.093)  # fmt: skip
"""97.5 % points of Student's t with 1, 2, … degrees of freedom (any table of it); 1.96 beyond."""
_NOTHING = 1e-9  # rounding error of equal values
BELOW = "‡"


def _half(values: Sequence[float]) -> float | None:
    """Half of the 95 % interval of a mean over seeds; None for one seed."""
    if len(values) < 2:
        return None
    t = _T[len(values) - 2] if len(values) - 2 < len(_T) else 1.96
    return float(t * np.std(values, ddof=1) / sqrt(len(values)))


def summary(runs: Sequence[Cells], metric: str, *, draws: bool = True) -> dict[str, Any]:
    """One cell over seeds: ``mean``, ``half``, ``values``, ``note``; or ``why`` it has no value.

    With ``draws``, also the draws of clips, as means over seeds, which is all that verdicts need.
    """
    values = [cells[metric]["value"] for cells in runs if "value" in cells[metric]]
    if len(values) < len(runs) or not values:
        return {"why": next((cells[metric]["why"] for cells in runs if "why" in cells[metric]), "no run")}
    note = runs[0][metric].get("note", "")
    entry = {"mean": float(np.mean(values)), "half": _half(values), "values": values, "note": note}
    if controls := runs[0][metric].get("controls"):
        entry["controls"] = controls
    samples = [cells[metric].get("draws") or () for cells in runs]
    if not draws or not all(len(each) == len(samples[0]) > 1 for each in samples):
        return entry
    return entry | {"draws": [float(f"{draw:.6g}") for draw in np.mean(samples, 0)]}


def _number(cell: Mapping[str, Any]) -> str:
    half = cell.get("half")
    if abs(cell["mean"]) < _NOTHING:
        return "0"
    return f"{cell['mean']:.3g}" + ("" if half is None else f" ± {half:.2g}")


def _cells(table: Mapping[str, Any]) -> Iterable[list[str]]:
    """Rows of text: the head, then for each row our figures and, where there are some, those of the paper."""
    columns = table["columns"]
    yield ["", *columns.values()]
    for name, row in table["rows"].items():
        if row.get("cells"):
            below = table.get("below", {}).get(name, {})
            marks = {metric: f" {BELOW}" for metric in below}
            yield [name, *(_number(c) + marks.get(m, "") if "mean" in (c := row["cells"][m]) else "–" for m in columns)]
        if row["published"]:
            label = f"{name}, published" if row.get("cells") else f"{name}, published (not run)"
            yield [label, *(f"({row['published'][m]:g})" if m in row["published"] else "" for m in columns)]
    for name, cells in table["controls"].items():
        yield [f"control: {name}", *(_number(c) if "mean" in (c := cells[m]) else "–" for m in columns)]


def _notes(table: Mapping[str, Any]) -> list[str]:
    """Notes below the table: how to read the figures."""
    notes = [
        f"± half of the 95 % interval over {len(table['seeds'])} seeds (Student's t)." if len(table["seeds"]) > 1 else
        "One seed: no intervals.",
        "Figures in brackets are the paper's, of its own data and feature networks: not comparable with ours.",
    ]  # fmt: skip
    controls = dict.fromkeys(control for row in table.get("below", {}).values() for control in row.values())
    if controls:
        notes.append(f"{BELOW} not better than a control row: {', '.join(controls)}.")
    if table.get("note"):
        notes.append(table["note"])
    facts = {name: row["facts"] for name, row in table["rows"].items() if row.get("facts")}
    notes += dict.fromkeys(f"{name.partition(',')[0]}: {fact}" for name, fact in facts.items())  # rows of one system share it
    reasons: dict[tuple[str, str], list[str]] = {}
    for name, cells in [(n, r["cells"]) for n, r in table["rows"].items() if r.get("cells")] + [*table["controls"].items()]:
        for metric, cell in cells.items():
            if "why" in cell:
                reasons.setdefault((metric, cell["why"]), []).append(name)
    groups: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for (metric, why), names in reasons.items():
        groups.setdefault((why, tuple(names)), []).append(table["columns"][metric])
    notes += [f"– {', '.join(heads)}: {why} ({', '.join(names)})" for (why, names), heads in groups.items()]
    notes += [f"headroom of {table['columns'][m]}: {text}" for m, text in table.get("headroom", {}).items()]
    faults = {m: problems for m, problems in table.get("faults", {}).items() if problems}
    for m, problems in faults.items():
        wrong, unsure = ([each for each in problems if (WRONG in each) is sure] for sure in (True, False))
        if wrong:
            notes.append(f"! {table['columns'][m]} puts the control rows in the wrong order: {'; '.join(wrong)}")
        if unsure:
            notes.append(f"~ {table['columns'][m]}: too few clips to tell control rows apart: {'; '.join(unsure)}")
    return notes


def _verdict_lines(table: Mapping[str, Any]) -> list[str]:
    return [f"{verdict['verdict']}: {_claim(verdict)}: {verdict['because']}" for verdict in table["verdicts"]]


def _claim(verdict: Mapping[str, str]) -> str:
    return verdict["claim"] + (f" [expected: {verdict['expected']}]" if "expected" in verdict else "")


def to_text(table: Mapping[str, Any]) -> str:
    """The table for a terminal."""
    rows = [*_cells(table)]
    sizes = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = [table["title"], table["head"], ""]
    lines += [
        "  ".join([row[0].ljust(sizes[0]), *(c.rjust(s) for c, s in zip(row[1:], sizes[1:], strict=True))]) for row in rows
    ]
    return "\n".join([*lines, "", *_notes(table), "", *_verdict_lines(table)]).rstrip()


def to_markdown(table: Mapping[str, Any]) -> str:
    """The table for the documentation."""
    head, *rows = ([cell.replace("|", "\\|") for cell in row] for row in _cells(table))
    lines = [f"### {table['title']}", "", table["head"], ""]
    lines += ["| " + " | ".join(head) + " |", "|---" + "|---:" * (len(head) - 1) + "|"]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    lines += ["", *(f"* {note}" for note in _notes(table)), ""]
    lines += [f"* **{verdict['verdict']}**: {_claim(verdict)}: {verdict['because']}" for verdict in table["verdicts"]]
    return "\n".join(lines).rstrip() + "\n"
