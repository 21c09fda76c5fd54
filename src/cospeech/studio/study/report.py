"""The report of a study: means, differences between systems with Holm's correction, agreement, and excluded raters."""

from __future__ import annotations

import hashlib
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from ...errors import say_count
from ...metrics.holm import correct
from ...motion.rotations import Array
from .answers import Answers, Rater, passes_checks
from .plan import Question, StudyPlan, load_plan
from .session import answer_keys
from .statistics import Estimate, alpha, estimate, grid

__all__ = ["Counted", "Findings", "Vote", "count_raters", "findings_json", "read_votes", "report_study", "study_findings"]

LEVEL = 0.05


class Vote(NamedTuple):
    """An answer with names.

    Args:
        rater, stimulus, question: the rater, the speech and the question.
        systems: the systems whose clips were shown, from left to right.
        system: the system of the clip that the answer is about; "" for all clips.
        value: as the page sent it.
        page: number of the page in the session, from 1.
        seconds: time of the page.
        check: for an attention check, the answer that was asked for; "" for others.
    """

    rater: str
    stimulus: str
    question: str
    systems: tuple[str, ...]
    system: str
    value: int
    page: int = 0
    seconds: float = float("nan")
    check: str = ""


class Counted(NamedTuple):
    """Raters by outcome.

    Args:
        kept: raters whose answers count.
        failed: raters who are left out because they failed attention checks.
        incomplete: raters who are left out because they stopped early.
        minutes: median time of the raters who count.
    """

    kept: list[str]
    failed: list[str]
    incomplete: list[str]
    minutes: float


@dataclass(frozen=True)
class Findings:
    """The report as data.

    Args:
        raters: the raters by outcome.
        means: question → system → estimate of its score.
        differences: question → (system, other) → estimate of the first minus the second.
        chances: (question, system, other) → p value of the difference, corrected over all differences of the study.
        agreement: question → Krippendorff's alpha.
        answers: question → system → number of answers behind its score.
        wins: question of preference → (system, other) → comparisons that the first won, ties, and those that it lost.
        sides: question of preference → share of comparisons that the clip on the left won; a tie counts half.
        coverage: the fewest and the most pages with one speech, of the raters who count.
    """

    raters: Counted
    means: dict[str, dict[str, Estimate]] = field(default_factory=dict)
    differences: dict[str, dict[tuple[str, str], Estimate]] = field(default_factory=dict)
    chances: dict[tuple[str, str, str], float] = field(default_factory=dict)
    agreement: dict[str, float] = field(default_factory=dict)
    answers: dict[str, dict[str, int]] = field(default_factory=dict)
    wins: dict[str, dict[tuple[str, str], tuple[int, int, int]]] = field(default_factory=dict)
    sides: dict[str, Estimate] = field(default_factory=dict)
    coverage: tuple[int, int] = (0, 0)


def name_rater(rater: Rater) -> str:
    """A name of a rater for tables; it gives no access to the session."""
    return f"R_{hashlib.blake2b(rater.rater.encode(), digest_size=6).hexdigest()}"


def count_raters(plan: StudyPlan, answers: Answers, *, incomplete: bool = False) -> Counted:
    """Raters by outcome. One counts who answered all pages (any, with ``incomplete``) and passed enough attention checks."""
    valid, failures, short, times = [], [], [], []
    for session in answers.sessions():
        name = name_rater(session.rater)
        if not session.is_whole and not (incomplete and session.answers):
            short.append(name)
        elif not passes_checks(plan, session):
            failures.append(name)
        else:
            valid.append(name)
            times.append(sum(session.seconds.values()) / 60)
    return Counted(valid, failures, short, median(times) if times else float("nan"))


def read_votes(plan: StudyPlan, answers: Answers, raters: Iterable[str] | None = None, *, checks: bool = False) -> list[Vote]:
    """The answers of some raters, or of all; with ``checks``, also those to attention checks."""
    names, votes = None if raters is None else {*raters}, []
    for session in answers.sessions():
        who = name_rater(session.rater)
        for k, values in session.answers.items() if names is None or who in names else ():
            trial = session.trials[k]
            if trial.check is None or checks:
                for name, place in answer_keys(plan, trial):
                    system = "" if place < 0 else trial.systems[place]
                    facts = (who, trial.stimulus, name, trial.systems, system, values[name, place])
                    votes.append(Vote(*facts, k + 1, session.seconds[k], trial.check or ""))
    return votes


Scores = dict[str, list[tuple[str, str, float]]]
"""System → (rater, speech, score)."""


def _scores(plan: StudyPlan, question: Question, votes: Iterable[Vote]) -> Scores:
    """The score of each system by one question.

    For a scale, it is the rating. For a favourite, it is 1 if the system was chosen. For a style, it is 1 if the answer is
    right: different for the systems that transfer, the same for others. For a preference, it is 1 for a win, ½ for a tie.
    """
    result: Scores = {system: [] for system in plan.systems}
    for vote in votes:
        where = (vote.rater, vote.stimulus)
        if question.kind == "scale":
            result[vote.system].append((*where, vote.value))
        elif question.kind == "favourite":
            for place, system in enumerate(vote.systems):
                result[system].append((*where, float(place == vote.value)))
        elif question.kind == "same":
            for system in vote.systems:
                if system != plan.reference:
                    result[system].append((*where, float(vote.value != (system in plan.transfer))))
        else:
            left, right = vote.systems
            result[left].append((*where, 0.5 - 0.5 * np.sign(vote.value)))
            result[right].append((*where, 0.5 + 0.5 * np.sign(vote.value)))
    return {system: scores for system, scores in result.items() if scores}


def _differences(question: Question, votes: list[Vote], scores: Scores) -> dict[tuple[str, str], Array]:
    """(system, other) → array of differences, for each rater and speech with scores of both."""
    result = {}
    if question.kind == "prefer":
        direct: defaultdict[tuple[str, str], list[tuple[str, str, float]]] = defaultdict(list)
        systems = [*scores]
        for vote in votes:
            left, right = vote.systems
            order = systems.index(left) < systems.index(right)
            key = (left, right) if order else (right, left)
            direct[key].append((vote.rater, vote.stimulus, float(-vote.value if order else vote.value)))
        return {pair: grid(values) for pair, values in direct.items()}
    for pair in combinations(scores, 2):
        one, two = (_cells(scores[system]) for system in pair)
        both = [(*where, one[where] - two[where]) for where in one.keys() & two.keys()]
        if both:
            result[pair] = grid(both)
    return result


def _cells(scores: Iterable[tuple[str, str, float]]) -> dict[tuple[str, str], float]:
    """(rater, speech) → mean score."""
    groups: defaultdict[tuple[str, str], list[float]] = defaultdict(list)
    for rater, stimulus, value in scores:
        groups[rater, stimulus].append(value)
    return {where: float(np.mean(values)) for where, values in groups.items()}


def _agreement(question: Question, votes: list[Vote]) -> float:
    """Krippendorff's alpha. Units are clips or comparisons; answers about a pair are made independent of the sides."""
    units = []
    for vote in votes:
        value, systems = vote.value, tuple(sorted(vote.systems))
        if question.kind == "prefer" and vote.systems != systems:
            value = -value
        if question.kind == "favourite":
            value = systems.index(vote.systems[value])
        units.append(
            (vote.rater, "\0".join((vote.stimulus, *(systems if vote.system == "" else (vote.system,)))), float(value))
        )
    if not units:
        return float("nan")
    nominal = question.kind in ("same", "favourite")
    return alpha(grid(units), (lambda a, b: (a != b).astype(float)) if nominal else None)


def _side(votes: list[Vote]) -> Estimate:
    """Share of comparisons that the clip on the left won. Far from ½, it shows a habit of raters, not a merit of systems."""
    return estimate(
        grid([(v.rater, f"{v.stimulus}\0{sorted(v.systems)}", 0.5 - 0.5 * np.sign(v.value)) for v in votes]), chance=0.5
    )


def _wins(votes: list[Vote], pairs: Iterable[tuple[str, str]]) -> dict[tuple[str, str], tuple[int, int, int]]:
    """(system, other) → comparisons that the first won, ties, and those that it lost."""
    counts = {pair: [0, 0, 0] for pair in pairs}
    for vote in votes:
        (left, right), sign = vote.systems, (vote.value > 0) - (vote.value < 0)
        if (left, right) in counts:
            counts[left, right][1 + sign] += 1
        else:
            counts[right, left][1 - sign] += 1
    return {pair: (wins, ties, losses) for pair, (wins, ties, losses) in counts.items()}


def study_findings(plan: StudyPlan, votes: list[Vote], raters: Counted) -> Findings:
    """Compute all estimates of a study."""
    pages = Counter(stimulus for stimulus, _, _ in {(vote.stimulus, vote.rater, vote.page) for vote in votes})
    times = [pages[stimulus] for stimulus in plan.stimuli]
    findings = Findings(raters, coverage=(min(times), max(times)))
    for question in plan.questions:
        mine = [vote for vote in votes if vote.question == question.name]
        scores = _scores(plan, question, mine)
        chance = {"prefer": 0.5, "same": 0.5, "favourite": 1 / len(plan.systems)}.get(question.kind)
        findings.means[question.name] = {system: estimate(grid(values), chance=chance) for system, values in scores.items()}
        findings.answers[question.name] = {system: len(values) for system, values in scores.items()}
        differences = _differences(question, mine, scores)
        findings.differences[question.name] = {pair: estimate(cells) for pair, cells in differences.items()}
        if question.kind == "prefer":
            findings.sides[question.name], findings.wins[question.name] = _side(mine), _wins(mine, differences)
        findings.agreement[question.name] = _agreement(question, mine)
    tests = [(name, *pair) for name, pairs in findings.differences.items() for pair in pairs]
    keys = [key for key in tests if np.isfinite(findings.differences[key[0]][key[1:]].p)]
    p_values = correct([findings.differences[key[0]][key[1:]].p for key in keys])
    findings.chances.update(zip(keys, p_values, strict=True))
    return findings


def report_study(study: Path, *, incomplete: bool = False) -> tuple[str, Findings]:
    """Report the study of a folder, as text and as data.

    Raises:
        InputError: no study is there, or scipy is not installed.
    """
    plan = load_plan(study)
    with Answers(study, plan) as answers:
        raters = count_raters(plan, answers, incomplete=incomplete)
        votes = read_votes(plan, answers, raters.kept)
    findings = study_findings(plan, votes, raters)
    return report_text(plan, findings), findings


def _chance(p: float) -> str:
    return "–" if np.isnan(p) else "< .001" if p < 0.001 else f"{p:.3f}"


def report_text(plan: StudyPlan, findings: Findings) -> str:
    """The report, in Markdown."""
    raters = findings.raters
    sizes = f"{say_count(len(plan.systems), 'system')}, {say_count(len(plan.stimuli), 'speech', 'speeches')}"
    minutes = f"; median time {raters.minutes:.1f} minutes" if raters.kept else ""
    lines = [
        f"# {plan.title}",
        "",
        f"{sizes}, template {plan.template}, variant {plan.variant}.",
        f"{say_count(len(raters.kept), 'rater counts', 'raters count')}; {len(raters.failed)} failed attention checks; "
        f"{len(raters.incomplete)} did not finish{minutes}.",
    ]
    if not raters.kept:
        return "\n".join([*lines, "There is nothing to report yet.", ""])
    fewest, most = findings.coverage
    lines.append(f"Each speech was on {fewest if fewest == most else f'{fewest} to {most}'} of their pages.")
    for question in plan.questions:
        lines += _question_text(question, findings)
    return "\n".join([*lines, ""])


def _question_text(question: Question, findings: Findings) -> list[str]:
    """The part of the report about a question."""
    name, pairs = question.name, findings.differences[question.name]
    lines = ["", f"## {name}", "", question.text, "", f"Score: {_WORDS[question.kind]}.", ""]
    has_test = question.kind != "scale"
    head = ["system", "mean", "95 % interval", *(["p (chance)"] if has_test else []), "answers"]
    rows = [
        [
            system, f"{e.mean:.3f}", f"{e.low:.3f} … {e.high:.3f}", *([_chance(e.p)] if has_test else []),
            str(findings.answers[name][system]),
        ]
        for system, e in findings.means[name].items()
    ]  # fmt: skip
    lines += _table(head, rows)
    wins = findings.wins.get(name)
    head = ["difference", "mean", "95 % interval", "p", "p (Holm)", "p (Wilcoxon)", *(["won, tied, lost"] if wins else []), ""]
    rows = []
    for pair, e in pairs.items():
        p = findings.chances.get((name, *pair), float("nan"))
        word = f"{pair[0] if e.mean > 0 else pair[1]} is higher" if p < LEVEL else ""
        cells = [" − ".join(pair), f"{e.mean:+.3f}", f"{e.low:+.3f} … {e.high:+.3f}", _chance(e.p), _chance(p)]
        counts = [", ".join(map(str, wins[pair]))] if wins else []
        rows.append([*cells, _chance(e.wilcoxon), *counts, word])
    if rows:
        lines += ["", *_table(head, rows)]
    if name in findings.sides:
        side = findings.sides[name]
        lines += [
            "",
            f"The video on the left won {100 * side.mean:.0f} % of the comparisons (p = {_chance(side.p)} against 50 %).",
        ]
    agreement = findings.agreement[name]
    word = "cannot be told" if np.isnan(agreement) else f"{agreement:.3f}"
    return [*lines, "", f"Agreement between raters: Krippendorff's alpha {word}."]


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """A table in Markdown; columns of numbers lie to the right."""
    line = ["---" if title in ("system", "difference", "95 % interval", "") else "---:" for title in head]
    return [f"| {' | '.join(cells)} |" for cells in (head, line, *rows)]


_WORDS: Mapping[str, str] = {
    "scale": "the rating",
    "prefer": "share of comparisons that it won, a tie counts half; differences are degrees of preference",
    "same": "share of right answers: the same style, or a different one where the system transfers style",
    "favourite": "share of groups in which it was chosen",
}


def findings_json(findings: Findings) -> dict[str, Any]:
    """The report for programs."""
    return _without_nan(
        {
            "raters": findings.raters._asdict() | {"minutes": round(findings.raters.minutes, 3)},
            "coverage": dict(zip(("fewest", "most"), findings.coverage, strict=True)),
            "means": {
                name: {s: e._asdict() | {"answers": findings.answers[name][s]} for s, e in means.items()}
                for name, means in findings.means.items()
            },
            "differences": [
                {
                    "question": name,
                    "system": pair[0],
                    "other": pair[1],
                    **e._asdict(),
                    "holm": findings.chances.get((name, *pair)),
                    **({"won_tied_lost": findings.wins[name][pair]} if name in findings.wins else {}),
                }
                for name, pairs in findings.differences.items()
                for pair, e in pairs.items()
            ],
            "left": {name: e._asdict() for name, e in findings.sides.items()},
            "alpha": findings.agreement,
        }
    )


def _without_nan(value: Any) -> Any:
    """A copy with None in place of numbers that are not finite, which JSON does not have."""
    if isinstance(value, dict):
        return {key: _without_nan(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(one) for one in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
