"""The session of a rater: its pages and their order. They are counterbalanced over raters, and depend on seed and number alone.

Speeches are assigned to raters in turn, so that each is seen equally often. A session has a round for every comparison. In a
round, each speech comes once. A cyclic Latin square decides which comparison of a speech comes in which round. The order of
clips on a page follows a square in which each clip also stands beside each other clip equally often (Williams 1949, Australian
Journal of Scientific Research A 2). So each pair is seen as often with one clip on the left as with the other: on every speech,
and, over as many raters as there are comparisons and speeches, in every round.
"""

from __future__ import annotations

from itertools import combinations
from random import Random
from typing import Any, NamedTuple

from .plan import StudyPlan

__all__ = ["Trial", "answer_keys", "describe_study", "describe_trial", "make_session", "passes"]


class Trial(NamedTuple):
    """One page of a session.

    Args:
        stimulus: the speech.
        systems: the systems whose clips are shown, from left to right.
        check: ``first`` or ``last``: the rater is told to choose this answer everywhere; ``same``: the same clip stands there
            twice, and the answer must be that the styles are the same; None: no check.
    """

    stimulus: str
    systems: tuple[str, ...]
    check: str | None = None


def comparisons(plan: StudyPlan) -> list[tuple[str, ...]]:
    """The groups of systems that are shown together."""
    if plan.shows == "single":
        return [(system,) for system in plan.systems]
    if plan.shows == "group":
        return [tuple(plan.systems)]
    if plan.mismatched:
        return [(system, other) for other, system in plan.mismatched.items()]
    if plan.reference is not None:
        return [(plan.reference, system) for system in plan.systems if system != plan.reference]
    return list(combinations(plan.systems, 2))


def order_clips(unit: tuple[str, ...], row: int) -> tuple[str, ...]:
    """Order the clips of a page from left to right, by a row of Williams' square."""
    size, first = len(unit), [0]
    for k in range(1, len(unit)):  # 0, 1, n − 1, 2, n − 2, …: all differences of neighbours occur once
        first.append((k + 1) // 2 if k % 2 else size - k // 2)
    order = [(place + row) % size for place in first]
    return tuple(unit[k] for k in (reversed(order) if size % 2 and row // size % 2 else order))


def make_session(plan: StudyPlan, number: int) -> list[Trial]:
    """Make the trials of a rater.

    Args:
        number: of the rater, from 0.
    """
    stimuli = Random(f"{plan.seed}/stimuli").sample(plan.stimuli, len(plan.stimuli))
    units, draw = comparisons(plan), Random(f"{plan.seed}/{number}")
    each = min(plan.stimuli_each, len(stimuli))
    visits = [divmod(number * each + k, len(stimuli)) for k in range(each)]  # how often a speech was seen before, and its index
    trials: list[Trial] = []
    for turn in range(len(units)):
        batch = []
        for visit, which in visits:
            unit = (which + visit + turn) % len(units)
            row = visit + which + unit
            if len(units) % 2 == 0:  # else a comparison would have the same clip on the left whenever it comes in this round
                row += visit // len(units)
            batch.append(Trial(stimuli[which], order_clips(units[unit], row)))
        draw.shuffle(batch)
        if trials and len(batch) > 1 and trials[-1].stimulus == batch[0].stimulus:
            batch.append(batch.pop(0))
        trials += batch
    return _with_checks(plan, trials, draw)


def _with_checks(plan: StudyPlan, trials: list[Trial], draw: Random) -> list[Trial]:
    """Insert attention checks among the trials, at equal distances."""
    result, length = list(trials), len(trials)
    alike = plan.reference is not None and any(question.kind == "same" for question in plan.questions)
    for k in reversed(range(plan.checks)):
        place = 1 + (k + 1) * length // (plan.checks + 1)
        beside = {trial.stimulus for trial in result[place - 1 : place + 1]}
        like = draw.choice([trial for trial in trials if trial.stimulus not in beside] or trials)
        check = Trial(like.stimulus, like.systems, draw.choice(("first", "last")))
        if alike and k % 2 == 0 and plan.reference is not None:
            check = Trial(like.stimulus, (plan.reference,) * len(like.systems), "same")
        result.insert(place, check)
    return result


def answer_keys(plan: StudyPlan, trial: Trial) -> dict[tuple[str, int], list[int]]:
    """(question, place of the clip, or −1 for a question about all clips) → the possible values."""
    keys = {}
    for question in plan.questions:
        values = [value for value, _ in question.options(len(trial.systems))]
        for place in range(len(trial.systems)) if question.kind == "scale" else (-1,):
            keys[question.name, place] = values
    return keys


def passes(plan: StudyPlan, trial: Trial, answers: dict[tuple[str, int], int]) -> bool:
    """Whether the answers to an attention check are right."""
    if trial.check == "same":
        alike = {question.name for question in plan.questions if question.kind == "same"}
        return all(value == 1 for (name, _), value in answers.items() if name in alike)
    end = 0 if trial.check == "first" else -1
    return all(answers.get(key) == values[end] for key, values in answer_keys(plan, trial).items())


def describe_trial(plan: StudyPlan, trial: Trial) -> dict[str, Any]:
    """The description of a trial for the page: ids of clips, and the text of a check; never a name."""
    ids = {(clip.system, clip.stimulus): clip.file for clip in plan.clips}
    notice = ""
    if trial.check in ("first", "last"):
        notice = f"Attention check: choose the {trial.check} answer to every question on this page."
    return {"clips": [ids[system, trial.stimulus] for system in trial.systems], "notice": notice}


def describe_study(plan: StudyPlan) -> dict[str, Any]:
    """The description of the study for the page, without its systems."""
    count = len(comparisons(plan)[0])
    questions = [
        {"name": q.name, "text": q.text, "each": q.kind == "scale", "options": [[v, w] for v, w in q.options(count)]}
        for q in plan.questions
    ]
    words = {key: getattr(plan, key) for key in ("title", "consent", "instructions", "thanks", "shows")}
    return {**words, "muted": plan.variant == "mute", "questions": questions, "study": plan.digest}
