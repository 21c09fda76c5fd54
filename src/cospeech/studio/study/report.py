"""What a study found: means, differences between systems with Holm's correction, agreement, and who was left out."""

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
        rater, stimulus, question: what was asked whom about which speech.
        systems: whose clips were shown, from left to right.
        system: whose clip it is about; "" for all.
        value: as the page sent it.
        page: number of the page in the session, from 1.
        seconds: that the page took.
        check: of an attention check, what was asked for; "" of others.
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
    """Raters by what became of them.

    Args:
        kept: whose answers count.
        failed: left out for their attention checks.
        incomplete: left out because they stopped early.
        minutes: median time of those who are kept.
    """

    kept: list[str]
    failed: list[str]
    incomplete: list[str]
    minutes: float


@dataclass(frozen=True)
class Findings:
    """The report as data.

    Args:
        counted: the raters.
        means: question → system → estimate of its score.
        differences: question → (system, other) → estimate of the first less the second.
        chances: the same, corrected over all differences of the study.
        agreement: question → Krippendorff's alpha.
        answers: question → system → how many answers its score is of.
        wins: question of preference → (system, other) → comparisons that the first won, that were ties, and that it lost.
        sides: question of preference → share of comparisons that the clip on the left won, a tie counts half.
        coverage: the fewest and the most pages that a speech was on, of those who are counted.
    """

    counted: Counted
    means: dict[str, dict[str, Estimate]] = field(default_factory=dict)
    differences: dict[str, dict[tuple[str, str], Estimate]] = field(default_factory=dict)
    chances: dict[tuple[str, str, str], float] = field(default_factory=dict)
    agreement: dict[str, float] = field(default_factory=dict)
    answers: dict[str, dict[str, int]] = field(default_factory=dict)
    wins: dict[str, dict[tuple[str, str], tuple[int, int, int]]] = field(default_factory=dict)
    sides: dict[str, Estimate] = field(default_factory=dict)
    coverage: tuple[int, int] = (0, 0)


def name_rater(rater: Rater) -> str:
    """A name for tables; nobody can go on with the session by it."""
    return f"R_{hashlib.blake2b(rater.rater.encode(), digest_size=6).hexdigest()}"


def count_raters(plan: StudyPlan, answers: Answers, *, incomplete: bool = False) -> Counted:
    """Who is counted: who has answered all pages (or any, with ``incomplete``) and passed enough attention checks."""
    kept, failed, short, times = [], [], [], []
    for session in answers.sessions():
        name = name_rater(session.rater)
        if not session.is_whole and not (incomplete and session.given):
            short.append(name)
        elif not passes_checks(plan, session):
            failed.append(name)
        else:
            kept.append(name)
            times.append(sum(session.seconds.values()) / 60)
    return Counted(kept, failed, short, median(times) if times else float("nan"))


def read_votes(plan: StudyPlan, answers: Answers, raters: Iterable[str] | None = None, *, checks: bool = False) -> list[Vote]:
    """The answers of some raters, or of all; attention checks are among them only where ``checks``."""
    chosen, found = None if raters is None else {*raters}, []
    for session in answers.sessions():
        who = name_rater(session.rater)
        for k, values in session.given.items() if chosen is None or who in chosen else ():
            trial = session.trials[k]
            if trial.check is None or checks:
                for name, place in answer_keys(plan, trial):
                    system = "" if place < 0 else trial.systems[place]
                    asked = (who, trial.stimulus, name, trial.systems, system, values[name, place])
                    found.append(Vote(*asked, k + 1, session.seconds[k], trial.check or ""))
    return found


Scores = dict[str, list[tuple[str, str, float]]]
"""System → (rater, speech, score)."""


def _scores(plan: StudyPlan, question: Question, votes: Iterable[Vote]) -> Scores:
    """The score of each system by one question.

    Of a scale, the rating. Of a favourite, 1 where it was chosen. Of a style, 1 where the answer is right: different for the
    systems that transfer, the same for others. Of a preference, 1 where it won, ½ for a tie.
    """
    found: Scores = {system: [] for system in plan.systems}
    for vote in votes:
        where = (vote.rater, vote.stimulus)
        if question.kind == "scale":
            found[vote.system].append((*where, vote.value))
        elif question.kind == "favourite":
            for place, system in enumerate(vote.systems):
                found[system].append((*where, float(place == vote.value)))
        elif question.kind == "same":
            for system in vote.systems:
                if system != plan.reference:
                    found[system].append((*where, float(vote.value != (system in plan.transfer))))
        else:
            left, right = vote.systems
            found[left].append((*where, 0.5 - 0.5 * np.sign(vote.value)))
            found[right].append((*where, 0.5 + 0.5 * np.sign(vote.value)))
    return {system: scores for system, scores in found.items() if scores}


def _differences(question: Question, votes: list[Vote], scores: Scores) -> dict[tuple[str, str], Array]:
    """Of each two systems, the difference in each (rater, speech) that has both."""
    found = {}
    if question.kind == "prefer":
        direct: defaultdict[tuple[str, str], list[tuple[str, str, float]]] = defaultdict(list)
        known = [*scores]
        for vote in votes:
            left, right = vote.systems
            order = known.index(left) < known.index(right)
            key = (left, right) if order else (right, left)
            direct[key].append((vote.rater, vote.stimulus, float(-vote.value if order else vote.value)))
        return {pair: grid(values) for pair, values in direct.items()}
    for pair in combinations(scores, 2):
        one, two = (_cells(scores[system]) for system in pair)
        both = [(*where, one[where] - two[where]) for where in one.keys() & two.keys()]
        if both:
            found[pair] = grid(both)
    return found


def _cells(scores: Iterable[tuple[str, str, float]]) -> dict[tuple[str, str], float]:
    """(rater, speech) → mean score."""
    held: defaultdict[tuple[str, str], list[float]] = defaultdict(list)
    for rater, stimulus, value in scores:
        held[rater, stimulus].append(value)
    return {where: float(np.mean(values)) for where, values in held.items()}


def _agreement(question: Question, votes: list[Vote]) -> float:
    """Krippendorff's alpha: units are clips or comparisons; answers about a pair do not depend on the sides."""
    units = []
    for vote in votes:
        value, shown = vote.value, tuple(sorted(vote.systems))
        if question.kind == "prefer" and vote.systems != shown:
            value = -value
        if question.kind == "favourite":
            value = shown.index(vote.systems[value])
        units.append((vote.rater, "\0".join((vote.stimulus, *(shown if vote.system == "" else (vote.system,)))), float(value)))
    if not units:
        return float("nan")
    nominal = question.kind in ("same", "favourite")
    return alpha(grid(units), (lambda a, b: (a != b).astype(float)) if nominal else None)


def _side(votes: list[Vote]) -> Estimate:
    """Share of comparisons that the clip on the left won; what is far from ½ is a habit of raters, not a merit of systems."""
    return estimate(
        grid([(v.rater, f"{v.stimulus}\0{sorted(v.systems)}", 0.5 - 0.5 * np.sign(v.value)) for v in votes]), chance=0.5
    )


def _wins(votes: list[Vote], pairs: Iterable[tuple[str, str]]) -> dict[tuple[str, str], tuple[int, int, int]]:
    """(system, other) → comparisons that the first won, ties, and those it lost."""
    found = {pair: [0, 0, 0] for pair in pairs}
    for vote in votes:
        (left, right), sign = vote.systems, (vote.value > 0) - (vote.value < 0)
        if (left, right) in found:
            found[left, right][1 + sign] += 1
        else:
            found[right, left][1 - sign] += 1
    return {pair: (won, tied, lost) for pair, (won, tied, lost) in found.items()}


def study_findings(plan: StudyPlan, votes: list[Vote], counted: Counted) -> Findings:
    """All estimates of a study."""
    seen = Counter(stimulus for stimulus, _, _ in {(vote.stimulus, vote.rater, vote.page) for vote in votes})
    times = [seen[stimulus] for stimulus in plan.stimuli]
    found = Findings(counted, coverage=(min(times), max(times)))
    for question in plan.questions:
        mine = [vote for vote in votes if vote.question == question.name]
        scores = _scores(plan, question, mine)
        chance = {"prefer": 0.5, "same": 0.5, "favourite": 1 / len(plan.systems)}.get(question.kind)
        found.means[question.name] = {system: estimate(grid(values), chance=chance) for system, values in scores.items()}
        found.answers[question.name] = {system: len(values) for system, values in scores.items()}
        differences = _differences(question, mine, scores)
        found.differences[question.name] = {pair: estimate(cells) for pair, cells in differences.items()}
        if question.kind == "prefer":
            found.sides[question.name], found.wins[question.name] = _side(mine), _wins(mine, differences)
        found.agreement[question.name] = _agreement(question, mine)
    tests = [(name, *pair) for name, pairs in found.differences.items() for pair in pairs]
    known = [key for key in tests if np.isfinite(found.differences[key[0]][key[1:]].p)]
    corrected = correct([found.differences[key[0]][key[1:]].p for key in known])
    found.chances.update(zip(known, corrected, strict=True))
    return found


def report_study(study: Path, *, incomplete: bool = False) -> tuple[str, Findings]:
    """The report of a study's folder as text, and as data.

    Raises:
        InputError: no study is there, or scipy is not installed.
    """
    plan = load_plan(study)
    with Answers(study, plan) as answers:
        counted = count_raters(plan, answers, incomplete=incomplete)
        votes = read_votes(plan, answers, counted.kept)
    findings = study_findings(plan, votes, counted)
    return report_text(plan, findings), findings


def _chance(p: float) -> str:
    return "–" if np.isnan(p) else "< .001" if p < 0.001 else f"{p:.3f}"


def report_text(plan: StudyPlan, findings: Findings) -> str:
    """The report, in Markdown."""
    counted = findings.counted
    shown = f"{say_count(len(plan.systems), 'system')}, {say_count(len(plan.stimuli), 'speech', 'speeches')}"
    minutes = f"; median time {counted.minutes:.1f} minutes" if counted.kept else ""
    lines = [
        f"# {plan.title}",
        "",
        f"{shown}, template {plan.template}, variant {plan.variant}.",
        f"{say_count(len(counted.kept), 'rater counts', 'raters count')}; {len(counted.failed)} failed attention checks; "
        f"{len(counted.incomplete)} did not finish{minutes}.",
    ]
    if not counted.kept:
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
    tested = question.kind != "scale"
    head = ["system", "mean", "95 % interval", *(["p (chance)"] if tested else []), "answers"]
    rows = [
        [
            system, f"{e.mean:.3f}", f"{e.low:.3f} … {e.high:.3f}", *([_chance(e.p)] if tested else []),
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
            "raters": findings.counted._asdict() | {"minutes": round(findings.counted.minutes, 3)},
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
    """A copy in which None stands for numbers that are not finite, which JSON does not have."""
    if isinstance(value, dict):
        return {key: _without_nan(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(one) for one in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value
