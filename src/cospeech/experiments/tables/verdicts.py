"""What a table says of the paper's claims, in four words.

    holds         the order is the paper's, and the intervals over seeds do not overlap
    contradicted  the order is the other way round, and the intervals over seeds do not overlap
    undecided     the intervals overlap, or seeds or figures are missing: nothing follows from the table
    not assayed   a system of the claim is no better than a frozen pose or white noise in this metric, or hardly moves to the
                  speech, or hardly moves: the table cannot test the claim

Two rows are alike only where their difference, with its interval, lies within a margin; overlap of intervals does not say it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .paper_tables import Claim, PaperTable, TableSplit
from .report import number_text

__all__ = ["CONTRADICTED", "HOLDS", "LEAST_SEEDS", "NOT_ASSAYED", "UNDECIDED", "verdict", "verdicts"]

HOLDS, CONTRADICTED, UNDECIDED, NOT_ASSAYED = "holds", "contradicted", "undecided", "not assayed"
LEAST_SEEDS = 3  # [ours] evidence of an order takes three seeds at least
MARGIN = 0.01  # [ours] of F1, the metric of the paper's only claim that nothing is gained (Mix-StAGE, supplement, table 6)
TRIVIAL = ("frozen pose", "white noise")
"""Control rows that a system must beat, in the direction in which the paper reads the metric."""
LIVELY, LEAST_SHARE = {"beat_align": "beat lift", "rate": "rate of strokes"}, 0.25
"""Metrics of which every system must have a share of what recordings have, where the table measures them; the share. [ours]"""

Rows = Mapping[str, Mapping[str, Any]]


def verdict(claim: Claim, rows: Rows, heads: Mapping[str, str], controls: Rows | None = None) -> dict[str, Any] | None:
    """What the table says of a claim; None where a row was not run.

    Args:
        claim: of the paper.
        rows: name → row of the table.
        heads: metric → head of its column; a claim about another metric is left out.
        controls: name → cells of the control rows.
    """
    names = (claim.better, claim.worse)
    if claim.metric not in heads or any(not rows.get(name, {}).get("cells") for name in names):
        return None
    better, worse = (rows[name]["cells"][claim.metric] for name in names)
    sign = "is about" if claim.alike else ">" if claim.higher else "<"
    text = f"{heads[claim.metric].rstrip(' ↑↓→')}: {claim.better} {sign} {claim.worse} ({claim.source})"
    if "mean" not in better or "mean" not in worse:
        return {"claim": text, "verdict": UNDECIDED, "because": better.get("why") or worse.get("why")}
    told = f"{number_text(better)} and {number_text(worse)}"
    if min(len(better["values"]), len(worse["values"])) < LEAST_SEEDS:
        return {"claim": text, "verdict": UNDECIDED, "because": f"{told}: fewer than {LEAST_SEEDS} seeds"}
    word, why = _compare(claim, better, worse)
    faults: dict[str, list[str]] = {}
    for name in names:
        for fault in _faults(claim, rows[name]["cells"], controls or {}):
            faults.setdefault(fault, []).append(name)
    if faults:
        word, why = NOT_ASSAYED, "; ".join([why, *(f"{fault}: {' and '.join(who)}" for fault, who in faults.items())])
    return {"claim": text, "verdict": word, "because": f"{told}: {why}"}


def _compare(claim: Claim, better: Mapping[str, Any], worse: Mapping[str, Any]) -> tuple[str, str]:
    """Word and reason, from the two means and their intervals over seeds."""
    gap = (better["mean"] - worse["mean"]) * (1 if claim.higher else -1)
    room = better["half"] + worse["half"]
    if claim.alike:
        if abs(gap) + room <= MARGIN:
            return HOLDS, f"the difference lies within ±{MARGIN:g}"
        if abs(gap) - room > MARGIN:
            return CONTRADICTED, f"the difference lies outside ±{MARGIN:g}"
        return UNDECIDED, f"the interval of the difference is not within ±{MARGIN:g}, nor outside"
    order = "the order holds" if gap > 0 else "the order is the other way round"
    if abs(gap) <= room:
        return UNDECIDED, f"{order}, but the intervals overlap"
    return HOLDS if gap > 0 else CONTRADICTED, f"{order}, beyond the intervals"


def _faults(claim: Claim, cells: Mapping[str, Any], controls: Rows) -> list[str]:
    """Why a system cannot be used to test a claim."""
    sign, found = (1 if claim.higher else -1), []
    for row in TRIVIAL:
        control = controls.get(row, {}).get(claim.metric, {})
        if "mean" in control and sign * (cells[claim.metric]["mean"] - control["mean"]) <= 0:
            found.append(f"no better than {row}")
    for metric, what in LIVELY.items():
        recorded = [
            row[metric]["mean"]
            for control, row in controls.items()
            if control.startswith(("ground truth", "recordings")) and "mean" in row.get(metric, {})
        ]
        if recorded and "mean" in cells.get(metric, {}) and cells[metric]["mean"] < LEAST_SHARE * min(recorded):
            found.append(f"{what} below {LEAST_SHARE:.0%} of the recordings'")
    return found


def verdicts(paper_table: PaperTable, part: TableSplit, rows: Rows, controls: Rows) -> list[dict[str, Any]]:
    """Of all claims whose rows were run."""
    found = (verdict(claim, rows, paper_table.columns, controls) for claim in part.claims)
    return [told for told in found if told is not None]
