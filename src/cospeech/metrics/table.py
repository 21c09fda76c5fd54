"""A table of systems and control rows by metrics: as text, JSON, CSV and LaTeX."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np

from ..errors import say_count
from . import load_metric
from .controls import CONTROLS, WRONG
from .metric import Score

__all__ = ["DEFAULT", "Table"]

DEFAULT = (
    "movement", "beat_align", "fgd", "fid_poses", "pck", "pck_2d", "ape", "srgr", "cca", "diversity", "l1_div", "multimodality",
    "w1_speed", "w1_acceleration", "jerk", "hellinger_speed",
)  # fmt: skip
"""The metrics of a table where the caller names none: the corrected forms. Cells without data stay empty."""


COVERAGE = {2: 50, 3: 75, 4: 80, 5: 84, 6: 86, 7: 87, 8: 89, 9: 90}
"""Clips → in how many of 100 cases an interval of 95 % holds the true mean. Ours: the percentile bootstrap of
`cospeech.metrics.interval` on 20,000 sets of normal values; from 10 clips on it is 90 and more."""
LOPSIDED = 1.5  # ours: an interval that reaches more than so many times as far to one side is shown by its ends


def _spread(score: Score) -> str:
    """The interval of a score as text: "± half", or its ends where it is not symmetric."""
    if score.interval is None:
        return ""
    low, high = score.interval
    short, long = sorted((score.value - low, high - score.value))
    if long > LOPSIDED * short and high - low > 1e-9 * max(1.0, abs(score.value)):  # else it is rounding alone
        return f" [{low:.3g}, {high:.3g}]"
    return f" ± {(high - low) / 2:.2g}"


def _mark(faults: Sequence[str]) -> str:
    return "!" if any(WRONG in fault for fault in faults) else "~" if faults else ""


_LATEX = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", **{c: f"\\{c}" for c in "&%$#_{}"}}
_ARROWS = {"higher": r"\uparrow", "lower": r"\downarrow", "reference": r"\rightarrow"}
_MARKS = {"": "", "!": "^{!}", "~": r"^{\sim}"}


def _escape(text: str) -> str:
    """A name as LaTeX prints it."""
    return "".join(_LATEX.get(letter, letter) for letter in text)


def _formula(cell: str) -> str:
    """A cell of `Table.to_text` as LaTeX: powers of ten, and the sign of plus or minus."""
    powers = re.sub(r"e([+-]?)0*(\d+)", lambda match: rf" \times 10^{{{match[1].strip('+')}{match[2]}}}", cell)
    return "--" if cell == "–" else f"${powers.replace('±', chr(92) + 'pm').replace(' [', chr(92) + ';[')}$"


@dataclass(frozen=True)
class Table:
    """Scores of systems and control rows.

    Args:
        rows: names, systems first.
        columns: names of metrics.
        cells: row → column → score; None where the data for it are missing.
        why: row → column → why there is none.
        faults: column → what the metric puts in the wrong order among the control rows.
        about: the data and the networks of the table, in words.
        clips: how many recordings the rows are scored on; 0: not known.
    """

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    cells: Mapping[str, Mapping[str, Score | None]]
    why: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    faults: Mapping[str, Sequence[str]] = field(default_factory=dict)
    about: str = ""
    clips: int = 0

    def to_json(self) -> str:
        """The whole table; values that are not numbers are null."""

        def plain(score: Score | None) -> dict[str, object] | None:
            if score is None:
                return None
            ends = None if score.interval is None else [x if np.isfinite(x) else None for x in score.interval]
            value = score.value if np.isfinite(score.value) else None
            return {"value": value, "interval": ends, "count": score.count, "note": score.note}

        units = {name: load_metric(name).about for name in self.columns}
        return json.dumps(
            {
                "about": self.about,
                "clips": self.clips,
                "metrics": {
                    n: {"better": a.better, "unit": a.unit, "faults": list(self.faults.get(n, ()))} for n, a in units.items()
                },
                "rows": {row: {column: plain(self.cells[row][column]) for column in self.columns} for row in self.rows},
                "why": {row: dict(reasons) for row, reasons in self.why.items()},
            },
            indent=2,
            ensure_ascii=False,
        )

    def to_csv(self) -> str:
        """A line for each system and metric, for pandas and R; without a score, the note says why."""
        file = io.StringIO()
        lines = csv.writer(file, lineterminator="\n")
        lines.writerow(("system", "metric", "better", "unit", "value", "low", "high", "count", "note"))
        for row in self.rows:
            for name in self.columns:
                about, score = load_metric(name).about, self.cells[row][name]
                if score is None:
                    figures: tuple[object, ...] = ("", "", "", "", self.why.get(row, {}).get(name, ""))
                else:
                    figures = (score.value, *(score.interval or ("", "")), score.count, score.note)
                lines.writerow((row, name, about.better, about.unit, *figures))
        return file.getvalue().removesuffix("\n")

    def to_latex(self) -> str:
        """A tabular for the package booktabs, with the lines of `to_text` that explain it as comments."""
        lines = [r"\begin{tabular}{l" + "r" * len(self.columns) + "}", r"\toprule"]
        arrows = (_ARROWS[load_metric(name).about.better] + _MARKS[_mark(self.faults.get(name, ()))] for name in self.columns)
        heads = (f"{_escape(name)} ${arrow}$" for name, arrow in zip(self.columns, arrows, strict=True))
        lines += [" & ".join(["", *heads]) + r" \\", r"\midrule"]
        for k, row in enumerate(self.rows):
            if k and row in CONTROLS and self.rows[k - 1] not in CONTROLS:
                lines.append(r"\midrule")
            lines.append(" & ".join([_escape(row), *(_formula(self._cell(row, name)) for name in self.columns)]) + r" \\")
        lines += [r"\bottomrule", r"\end{tabular}"]
        return "\n".join([*(f"% {line}" for line in [self.about, *self._legend()] if line), *lines])

    def _cell(self, row: str, column: str) -> str:
        score = self.cells[row][column]
        if score is None:
            return "–"
        return f"{score.value:.3g}{_spread(score)}"

    def _reasons(self) -> list[str]:
        """Why scores are missing: one line for a metric that has none, else a line that names the rows without one."""
        names_of: dict[tuple[str, tuple[str, ...]], list[str]] = {}
        for name in self.columns:
            lacking = [row for row in self.rows if self.cells[row].get(name) is None]
            rows_of: dict[str, list[str]] = {}
            for row in lacking:
                if why := self.why.get(row, {}).get(name, "").removeprefix(f"{name} "):
                    rows_of.setdefault(why, []).append(row)
            if len(lacking) == len(self.rows):
                rows_of = {why: [] for why in [*rows_of][:1]}
            for why, rows in rows_of.items():
                names_of.setdefault((why, tuple(rows)), []).append(name)
        return [
            f"– {', '.join(names)}{' of ' if rows else ''}{', '.join(rows)}: {why}" for (why, rows), names in names_of.items()
        ]

    def to_text(self, *, width: int = 120) -> str:
        """Aligned columns, in blocks that fit into ``width`` characters; the faults of metrics below."""
        arrows = {"higher": "↑", "lower": "↓", "reference": "→"}
        marks = {name: _mark(self.faults.get(name, ())) for name in self.columns}
        heads = {name: f"{name} {arrows[load_metric(name).about.better]}{marks[name]}" for name in self.columns}
        sizes = {n: max(len(heads[n]), *(len(self._cell(row, n)) for row in self.rows)) for n in self.columns}
        first = max(map(len, self.rows))
        blocks: list[list[str]] = [[]]
        for name in self.columns:
            if blocks[-1] and first + sum(sizes[n] + 2 for n in [*blocks[-1], name]) > width:
                blocks.append([])
            blocks[-1].append(name)
        lines = [self.about] if self.about else []
        for block in blocks:
            lines += ["", " " * first + "".join(f"  {heads[n]:>{sizes[n]}}" for n in block)]
            lines += [f"{row:<{first}}" + "".join(f"  {self._cell(row, n):>{sizes[n]}}" for n in block) for row in self.rows]
        return "\n".join([*lines, "", *self._legend()])

    __str__ = to_text

    def _repr_html_(self) -> str:
        """How a notebook shows it."""
        return f"<pre>{escape(self.to_text())}</pre>"

    def _legend(self) -> list[str]:
        """What the signs of a table mean, and the faults of its metrics."""
        lines = [
            "± half of the 95 % interval, [from, to] where it is not symmetric",
            "↑ higher is better, ↓ lower, → nearest to the ground truth",
            "! the control rows are in the wrong order; ~ they are too near to each other to tell, on so few clips",
        ]
        if self.clips in COVERAGE:
            rate = f"holds the true value in some {COVERAGE[self.clips]} of 100 cases, not in 95"
            lines.append(f"note: ± is too narrow with so few clips: an interval over {say_count(self.clips, 'clip')} {rate}")
        lines += [f"{_mark(faults)} {name}: {'; '.join(faults)}" for name, faults in self.faults.items() if faults]
        return lines + self._reasons()
