"""Verdicts on the claims of a table: paired by seed and by test clip, corrected for how many claims there are.

A claim says that row A is better than row B by a metric. It is tested by Student's t, over seeds s = 1 … n and draws k of test
clips, which are the same draws for both rows:

    d_s = A_s − B_s,    D = mean d_s,    V = var(d_s) / n + var_k(mean_s (A_sk − B_sk)),    t = D / √V

The degrees of freedom are those of Satterthwaite: n − 1 for the seeds, no limit for the clips. The p values of a table are
corrected by Holm 1979. Equality within a margin is tested by two one-sided tests (Schuirmann 1987).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from ...errors import say_count
from ...metrics import METRICS, load_metric
from ...metrics._scipy import scipy
from ...metrics.controls import CONTROLS
from ...metrics.holm import correct
from .controls import ORACLE
from .paper_tables import COSTS, HEARING, LIKELIHOOD, Cells, Claim

__all__ = [
    "CONTRADICTED", "HOLDS", "LEAST_SEEDS", "LIFT", "NOT_ASSAYED", "UNDECIDED", "WORDS", "Difference", "Evidence", "below",
    "below_controls", "compare", "headroom", "judge",
]  # fmt: skip

HOLDS, CONTRADICTED, UNDECIDED, NOT_ASSAYED = WORDS = ("holds", "contradicted", "undecided", "not assayed")
LEVEL = 0.05
LEAST_SEEDS = 5  # ours: with 3, an effect of two standard deviations is found in 9 % of cases
LEAST_LIFT = 0.25  # ours: of the recordings' beat lift; a system below it hardly follows the speech
LIFT = "beat_align"


class Difference(NamedTuple):
    """Row A less row B by one metric.

    Args:
        mean: over seeds.
        error: standard error, over seeds and clips.
        freedom: degrees of freedom; inf where clips alone vary.
        seeds: number of seeds.
        over_clips: whether clips were drawn; else the error is over seeds alone, and the test clips are fixed.
    """

    mean: float
    error: float
    freedom: float
    seeds: int
    over_clips: bool = True

    def above(self, limit: float) -> float:
        """One-sided p value for a difference above ``limit``: the null hypothesis is that it is not."""
        if self.error == 0:
            return float(self.mean <= limit)
        return float(scipy("stats").t.sf((self.mean - limit) / self.error, self.freedom))

    def below(self, limit: float) -> float:
        """One-sided p value for a difference below ``limit``: the null hypothesis is that it is not."""
        return Difference(-self.mean, self.error, self.freedom, self.seeds).above(-limit)

    @property
    def differs(self) -> float:
        """Two-sided p value for a difference: the null hypothesis is that there is none."""
        return min(1.0, 2 * min(self.above(0.0), self.below(0.0)))

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the mean."""
        half = self.error * float(scipy("stats").t.ppf(1 - LEVEL / 2, self.freedom)) if self.error else 0.0
        return self.mean - half, self.mean + half


def compare(a: Sequence[Mapping[str, Any]], b: Sequence[Mapping[str, Any]]) -> Difference:
    """The difference of two rows by one metric, from cells of the same seeds in the same order.

    Args:
        a, b: cells with ``value``, and ``draws`` where clips were drawn.
    """
    gaps = np.array([x["value"] - y["value"] for x, y in zip(a, b, strict=True)], np.float64)
    seeds = gaps.var(ddof=1) / len(gaps) if len(gaps) > 1 else 0.0
    draws = [(x.get("draws") or (), y.get("draws") or ()) for x, y in zip(a, b, strict=True)]
    clips, over_clips = 0.0, all(len(x) == len(y) > 1 for x, y in draws)
    if over_clips:
        means = np.mean([np.subtract(x, y) for x, y in draws], 0)
        means = means[np.isfinite(means)]
        clips = float(means.var(ddof=1)) if len(means) > 1 else 0.0
    total = seeds + clips
    freedom = total**2 / (seeds**2 / (len(gaps) - 1)) if seeds > 0 else np.inf
    return Difference(float(gaps.mean()), sqrt(total), float(freedom), len(gaps), over_clips)


@dataclass(frozen=True)
class Evidence:
    """The scores and facts that verdicts are made from.

    Args:
        rows: name of a row → its cells with each seed; rows that were not run are missing. A cell has ``controls``, the
            values of control rows over the same clips, where those are fewer than the table's.
        controls: name of a control row → its cells.
        heads: metric → head of its column.
        faults: metric → what it puts in the wrong order among the control rows.
        leak: why the test says nothing about new speech; "": it does.
    """

    rows: Mapping[str, Sequence[Cells]]
    controls: Mapping[str, Cells]
    heads: Mapping[str, str]
    faults: Mapping[str, Sequence[str]]
    leak: str = ""

    def mean(self, row: str, metric: str) -> float:
        """Mean of a row over its seeds."""
        return float(np.mean([cells[metric]["value"] for cells in self.rows[row]]))

    def values_of_controls(self, row: str, metric: str) -> Mapping[str, float]:
        """Name of a control row → its value, over the clips of ``row`` alone where these are fewer than all."""
        own: Mapping[str, float] | None = self.rows[row][0].get(metric, {}).get("controls")
        return own or self.values_over_all(metric)

    def values_over_all(self, metric: str) -> dict[str, float]:
        """Name of a control row → its value over all clips, where it has one."""
        return {name: cells[metric]["value"] for name, cells in self.controls.items() if "value" in cells.get(metric, {})}


def _rivals(metric: str, controls: Mapping[str, Cells]) -> list[str]:
    """Control rows that a system has to beat by a metric: those without information, or without relation to the speech."""
    truth, frozen, noise, shuffled, another = CONTROLS
    about = load_metric(metric).about if metric in METRICS else None
    rivals = {frozen, noise}
    if about is not None and about.hears:
        rivals |= {shuffled, another}
    if about is not None and about.paired:
        rivals |= {another}
    standard = {truth, frozen, noise, shuffled, another}
    others = [name for name in controls if name not in standard and not name.startswith(("ground truth", "recordings", ORACLE))]
    return [name for name in controls if name in rivals] + others


def below_controls(metric: str, higher: bool, row: str, evidence: Evidence) -> str | None:
    """The control row that a row does not beat by a metric; None: it beats all."""
    return _unbeaten(evidence.mean(row, metric), metric, higher, evidence.values_of_controls(row, metric), evidence)


def _unbeaten(value: float, metric: str, higher: bool, values: Mapping[str, float], evidence: Evidence) -> str | None:
    """The best of the control rows with these values, if ``value`` is not better than it; else None."""
    sign = 1 if higher else -1
    rivals = [name for name in _rivals(metric, evidence.controls) if name in values]
    best = max(rivals, key=lambda name: sign * values[name], default=None)
    return None if best is None or sign * value > sign * values[best] else best


def below(claims: Sequence[Claim], evidence: Evidence) -> dict[str, dict[str, str]]:
    """Row → metric → the control row that it does not beat, for the metrics of the claims."""
    rows: dict[str, dict[str, str]] = {}
    for metric, higher in dict.fromkeys((claim.metric, claim.higher) for claim in claims):
        for row, scores in evidence.rows.items():
            if metric in evidence.heads and all("value" in cells.get(metric, {}) for cells in scores):
                control = below_controls(metric, higher, row, evidence)
                if control is not None:
                    rows.setdefault(row, {})[metric] = control
    return rows


def _lack_headroom(metric: str, evidence: Evidence) -> str | None:
    """Why a metric cannot tell real motion from a control row; None: it can.

    The recordings must be better than the control rows, but they are compared with themselves. An oracle, another real
    performance of the same speech, must be better, too.
    """
    metric = COSTS[metric][0] if metric in COSTS else metric
    faults = [fault for fault in evidence.faults.get(metric, ()) if fault.endswith(CONTROLS[0])]
    why = faults[0] if faults else _weak_oracle(metric, evidence)
    return f"the metric has no headroom: {why}" if why else None


def _weak_oracle(metric: str, evidence: Evidence) -> str | None:
    """The control row that an oracle does not beat, and both values; None: it beats all, or there is no oracle."""
    better = load_metric(metric).about.better if metric in METRICS else ""
    values = evidence.values_over_all(metric)
    oracle = next((name for name in values if name.startswith(ORACLE)), None)
    if oracle is None or better not in ("higher", "lower"):
        return None
    best = _unbeaten(values[oracle], metric, better == "higher", values, evidence)
    return None if best is None else f"the oracle ({values[oracle]:.3g}) is not better than {best} ({values[best]:.3g})"


def headroom(evidence: Evidence) -> dict[str, str]:
    """Metric → the values of the recordings, of an oracle and of the control rows; or why the metric cannot tell them apart."""
    texts = {}
    for metric in evidence.heads:
        values = evidence.values_over_all(metric)
        best = [name for name in values if name.startswith((CONTROLS[0], ORACLE))]
        why = _lack_headroom(metric, evidence)
        if why is None and best:
            rivals = ", ".join(f"{name} {values[name]:.3g}" for name in _rivals(metric, evidence.controls) if name in values)
            why = f"{', '.join(f'{name} {values[name]:.3g}' for name in best)} against {rivals}"
        if why is not None:
            texts[metric] = why
    return texts


def _whole(row: str, metric: str, evidence: Evidence) -> str:
    """The row that must follow the speech: the row itself; for the cost of a missing input, the system with all inputs."""
    whole = f"{row.partition(': ')[0]}: all"
    return whole if metric in COSTS and whole in evidence.rows else row


def _deaf(row: str, evidence: Evidence) -> str | None:
    """Why the likelihood of a row does not depend on the speech; None: its hearing gain is above 0, over seeds and clips."""
    gains = [cells.get(HEARING, {"why": ""}) for cells in evidence.rows[row]]
    if any("value" not in gain for gain in gains):
        return None
    nothing = [{"value": 0.0, "draws": [0.0] * len(gain.get("draws", ()))} for gain in gains]
    gain = compare(gains, nothing)
    if gain.above(0.0) < LEVEL:
        return None
    return f"{row} does not hear: hearing gain {gain.mean:.3g} nats per frame, 95 % interval from {gain.interval[0]:+.3g}"


def _gate(claim: Claim, evidence: Evidence) -> str | None:
    """Why the systems of a claim cannot test it; None: they can."""
    reason = evidence.leak or _lack_headroom(claim.metric, evidence)
    if reason:
        return reason
    both = (claim.follows,) if claim.follows in evidence.rows else (claim.better, claim.worse)
    rows = [_whole(row, claim.metric, evidence) for row in both]
    for row in rows if claim.metric not in COSTS else ():
        control = below_controls(claim.metric, claim.higher, row, evidence)
        if control is not None:
            return f"{row} is not better than the control row {control!r}"
    if claim.metric == LIKELIHOOD:
        return next((why for row in rows if (why := _deaf(row, evidence)) is not None), None)
    return next((why for row in rows if (why := _follows_not(row, evidence)) is not None), None)


def _follows_not(row: str, evidence: Evidence) -> str | None:
    """Why a row does not follow the speech, or why nobody knows; None: it follows, or the table has no beat lift."""
    if LIFT not in evidence.heads or CONTROLS[0] not in evidence.controls:
        return None
    lifts = [cells.get(LIFT, {}) for cells in (evidence.controls[CONTROLS[0]], *evidence.rows[row])]
    lacking = next((cell.get("why", "it has no beat lift") for cell in lifts if "value" not in cell), None)
    if lacking is not None:
        return f"it is not known whether {row} follows the speech: {lacking}"
    lift, truth = evidence.mean(row, LIFT), evidence.values_of_controls(row, LIFT)[CONTROLS[0]]
    if lift >= LEAST_LIFT * truth:
        return None
    return f"{row} hardly follows the speech: beat lift {lift:.3f}, of the recordings {truth:.3f}"


def _text(claim: Claim, heads: Mapping[str, str]) -> str:
    sign = "is about" if claim.alike else ">" if claim.higher else "<"
    return f"{heads[claim.metric].rstrip(' ↑↓→')}: {claim.better} {sign} {claim.worse} ({claim.source})"


def _reason(difference: Difference, p: float) -> str:
    low, high = difference.interval
    chance = "p < .001" if p < 0.001 else f"p = {p:.3f}"
    what = "" if difference.over_clips else " (over seeds alone: no clips were drawn)"
    return (
        f"difference {difference.mean:+.3g}, 95 % interval {low:+.3g} … {high:+.3g}, {chance} (Holm), {difference.seeds} seeds"
        + what
    )


def _decide(claim: Claim, difference: Difference, p: float, against: float) -> str:
    """The verdict: ``p`` is the p value for the claim, ``against`` that for the opposite; both are corrected."""
    if claim.alike:
        return HOLDS if p < LEVEL else CONTRADICTED if against < LEVEL else UNDECIDED
    if p >= LEVEL:
        return UNDECIDED
    return HOLDS if (difference.mean > 0) == claim.higher else CONTRADICTED


def _chances(claim: Claim, difference: Difference) -> tuple[float, float]:
    """p values for the claim, and, where it is an equality, for the opposite; else 1."""
    if not claim.alike:
        return difference.differs, 1.0
    outside = min(1.0, 2 * min(difference.above(claim.margin), difference.below(-claim.margin)))
    return max(difference.below(claim.margin), difference.above(-claim.margin)), outside


def judge(claims: Sequence[Claim], evidence: Evidence) -> list[dict[str, Any]]:
    """A verdict, one of four words, and its reason, for each claim whose rows were run.

    Returns:
        For each claim ``claim``, ``verdict``, ``because``, and ``expected`` where a verdict was expected before the run.
    """
    verdicts: list[dict[str, Any]] = []
    tests: list[tuple[Claim, dict[str, Any], Difference, float, float]] = []
    for claim in claims:
        if claim.metric not in evidence.heads or not {claim.better, claim.worse} <= {*evidence.rows}:
            continue
        verdict: dict[str, Any] = {"claim": _text(claim, evidence.heads)} | (
            {"expected": claim.expected} if claim.expected else {}
        )
        verdicts.append(verdict)
        pair = [[cells[claim.metric] for cells in evidence.rows[row]] for row in (claim.better, claim.worse)]
        lacking = next((cell["why"] for cells in pair for cell in cells if "value" not in cell), None)
        why = lacking or _gate(claim, evidence)
        if why is not None:
            verdict |= {"verdict": NOT_ASSAYED, "because": why}
        elif len(pair[0]) < LEAST_SEEDS:
            verdict |= {"verdict": UNDECIDED, "because": f"{say_count(len(pair[0]), 'seed')}; a verdict takes {LEAST_SEEDS}"}
        else:
            difference = compare(*pair)
            tests.append((claim, verdict, difference, *_chances(claim, difference)))
    chances = correct([p for *_, p, _ in tests])
    against = correct([p for *_, p in tests])
    for (claim, verdict, difference, *_), p, q in zip(tests, chances, against, strict=True):
        word = _decide(claim, difference, p, q)
        verdict |= {"verdict": word, "because": _reason(difference, q if word == CONTRADICTED and claim.alike else p)}
    return verdicts
