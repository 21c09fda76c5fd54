"""What a study found: means, differences between systems with Holm's correction, agreement, and who was left out."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from ...errors import say_count
from ...metrics.holm import correct
from ...motion.rotations import Array
from .answers import Answers, Rater
from .plan import Question, StudyPlan, load_plan
from .session import Trial, answer_keys, passes
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
    """

    rater: str
    stimulus: str
    question: str
    systems: tuple[str, ...]
    system: str
    value: int


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
    """

    counted: Counted
    means: dict[str, dict[str, Estimate]] = field(default_factory=dict)
    differences: dict[str, dict[tuple[str, str], Estimate]] = field(default_factory=dict)
    chances: dict[tuple[str, str, str], float] = field(default_factory=dict)
    agreement: dict[str, float] = field(default_factory=dict)


def name_rater(rater: Rater) -> str:
    """A name for tables; nobody can go on with the session by it."""
    return f"R_{hashlib.blake2b(rater.rater.encode(), digest_size=6).hexdigest()}"


def count_raters(plan: StudyPlan, answers: Answers, *, incomplete: bool = False) -> Counted:
    """Who is counted: who has answered all pages (or any, with ``incomplete``) and passed enough attention checks."""
    kept, failed, short, times = [], [], [], []
    for rater, trials, given, seconds in answers.sessions():
        name = name_rater(rater)
        checks = [k for k, trial in enumerate(trials) if trial.check]
        wrong = [k for k in checks if k in given and not passes(plan, trials[k], given[k])]
        if len(given) < len(trials) and not (incomplete and given):
            short.append(name)
        elif len(wrong) > len(checks) - plan.fewest_checks:
            failed.append(name)
        else:
            kept.append(name)
            times.append(sum(seconds.values()) / 60)
    return Counted(kept, failed, short, median(times) if times else float("nan"))


def read_votes(plan: StudyPlan, answers: Answers, raters: Iterable[str]) -> list[Vote]:
    """The answers of some raters, without attention checks."""
    chosen, found = {*raters}, []
    for rater, trials, given, _ in answers.sessions():
        who = name_rater(rater)
        for k, values in given.items() if who in chosen else ():
            trial: Trial = trials[k]
            if trial.check is None:
                for name, place in answer_keys(plan, trial):
                    system = "" if place < 0 else trial.systems[place]
                    found.append(Vote(who, trial.stimulus, name, trial.systems, system, values[name, place]))
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


def study_findings(plan: StudyPlan, votes: list[Vote], counted: Counted) -> Findings:
    """All estimates of a study."""
    found = Findings(counted)
    for question in plan.questions:
        mine = [vote for vote in votes if vote.question == question.name]
        scores = _scores(plan, question, mine)
        found.means[question.name] = {system: estimate(grid(values)) for system, values in scores.items()}
        differences = _differences(question, mine, scores)
        found.differences[question.name] = {pair: estimate(cells) for pair, cells in differences.items()}
        found.agreement[question.name] = _agreement(question, mine)
    tests = [(name, *pair) for name, pairs in found.differences.items() for pair in pairs]
    known = [key for key in tests if np.isfinite(found.differences[key[0]][key[1:]].p)]
    corrected = correct([found.differences[key[0]][key[1:]].p for key in known])
    found.chances.update(zip(known, corrected, strict=True))
    return found


def report_study(study: Path, *, incomplete: bool = False) -> tuple[str, Findings, list[Vote]]:
    """The report of a study's folder as text, as data, and the answers it was made from.

    Raises:
        InputError: no study is there, or scipy is not installed.
    """
    plan = load_plan(study)
    with Answers(study, plan) as answers:
        counted = count_raters(plan, answers, incomplete=incomplete)
        votes = read_votes(plan, answers, counted.kept)
    findings = study_findings(plan, votes, counted)
    return report_text(plan, findings), findings, votes


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
    for question in plan.questions:
        means, pairs = findings.means[question.name], findings.differences[question.name]
        lines += ["", f"## {question.name}", "", question.text, "", f"Score: {_WORDS[question.kind]}.", ""]
        lines += ["| system | mean | 95 % interval | answers |", "|---|---:|---|---:|"]
        lines += [f"| {name} | {e.mean:.3f} | {e.low:.3f} … {e.high:.3f} | {e.cells} |" for name, e in means.items()]
        lines += [
            "",
            "| difference | mean | 95 % interval | p | p (Holm) | p (Wilcoxon) | |",
            "|---|---:|---|---:|---:|---:|---|",
        ]
        for (one, two), e in pairs.items():
            p = findings.chances.get((question.name, one, two), float("nan"))
            word = f"{one if e.mean > 0 else two} is higher" if p < LEVEL else ""
            cells = [f"{one} − {two}", f"{e.mean:+.3f}", f"{e.low:+.3f} … {e.high:+.3f}", _chance(e.p), _chance(p)]
            lines.append(f"| {' | '.join([*cells, _chance(e.wilcoxon), word])} |")
        lines += ["", f"Agreement between raters: Krippendorff's alpha {findings.agreement[question.name]:.3f}."]
    return "\n".join([*lines, ""])


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
            "means": {name: {s: e._asdict() for s, e in means.items()} for name, means in findings.means.items()},
            "differences": [
                {
                    "question": name,
                    "system": pair[0],
                    "other": pair[1],
                    **e._asdict(),
                    "holm": findings.chances.get((name, *pair)),
                }
                for name, pairs in findings.differences.items()
                for pair, e in pairs.items()
            ],
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
