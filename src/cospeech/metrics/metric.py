"""The one signature of the table `cospeech.metrics.METRICS`, and the decorator that checks the arguments of a metric.

    score = metric(generated, reference, tools)

``generated`` and ``reference`` are sequences of `Sample`. ``tools`` holds what the caller passes in: a feature network, a
classifier, cluster centres. ``metric.about`` says which fields the metric needs and how its values are read (`About`).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import update_wrapper
from inspect import signature
from math import isclose

import numpy as np

from ..errors import InputError, nearest
from ..motion.rotations import Array
from .sample import Sample, Score, Tools

__all__ = ["BETTER", "About", "Metric", "metric", "pair_samples"]

BETTER = ("higher", "lower", "reference")
"""Which way is better: a higher value, a lower one, or the one nearest to that of the reference (diversity, jerk)."""

SAME = ("rate", "joints")
"""What a metric may want to be the same in all clips."""
RATE = 1e-4  # ours: relative; files round their frame time (0.033333 s), and 29.97 is not 30

Function = Callable[[Sequence[Sample], Sequence[Sample], Tools], Score]


@dataclass(frozen=True)
class About:
    """What a metric needs, and how its values are read.

    Args:
        needs: fields of `Sample` or `Tools`; ``"a|b"``: one of the two.
        better: one of `BETTER`.
        paired: it compares each clip with the reference of the same condition.
        hears: it uses the speech.
        unit: of the value.
        chance: chance gives 0; another clip need then not be better than noise.
        same: what all clips must have the same: ``"rate"`` (the metric counts in frames), ``"joints"``.
    """

    needs: tuple[str, ...]
    better: str
    paired: bool = False
    hears: bool = False
    unit: str = ""
    chance: bool = False
    same: tuple[str, ...] = ()


class Metric:
    """A function of the one signature that checks its arguments; `metric` makes it."""

    def __init__(self, function: Function, about: About) -> None:
        update_wrapper(self, function)
        self.function, self.about = function, about

    def __call__(self, generated: Sequence[Sample], reference: Sequence[Sample] = (), tools: Tools | None = None) -> Score:
        """A finite score.

        Raises:
            InputError: something that the metric needs is missing, rates or joints differ, or the value is not a number.
        """
        tools = Tools() if tools is None else tools
        name = getattr(self, "__name__", "metric")
        if not generated or (self.about.paired and not reference):
            raise InputError(f"{name} of {len(generated)} generated and {len(reference)} reference clips", "give some")
        for need in self.about.needs:
            if hasattr(tools, need):
                if getattr(tools, need) is None:
                    raise InputError(f"{name} needs {need}", f"pass Tools({need}=…)")
                continue
            either = need.split("|")
            lacking = [s.name for s in (*generated, *reference) if all(getattr(s, field) is None for field in either)]
            if lacking:
                raise InputError(f"{name} needs {' or '.join(either)}, and {lacking[0]!r} has none")
        empty = next((s.name for s in (*generated, *reference) if not len(s)), None)
        if empty is not None:
            raise InputError(f"{empty!r} has no frames")
        samples = (*reference, *generated)
        for sample in samples:
            if "rate" in self.about.same:
                _check_rates(sample, samples[0])
            if "joints" in self.about.same:
                _check_joints(sample, samples[0])
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the value is checked below
            score = self.function(generated, reference, tools)
        if not isinstance(score, Score):
            raise InputError(f"{name} gives {_describe(score)}", "a Score: cospeech.metrics.interval.mean_score makes one")
        if np.ndim(score.value) or not isinstance(score.value, int | float | np.integer | np.floating):
            raise InputError(f"the value of the score of {name} is {_describe(score.value)}", "one real number")
        if not np.isfinite(score.value):
            raise InputError(f"{name} comes out as {score.value} for these clips", "they hardly move, or are too few")
        ends = score.interval
        return score if ends is None or np.isfinite(ends).all() else replace(score, interval=None)


def metric(
    *needs: str,
    better: str,
    paired: bool = False,
    hears: bool = False,
    unit: str = "",
    chance: bool = False,
    same: tuple[str, ...] = (),
) -> Callable[[Function], Metric]:
    """Decorator that makes a `Metric` of a function; see `About`.

    Raises:
        InputError: a name in ``needs``, ``better`` or ``same`` that does not exist, or a function with other arguments.
    """
    available = {field.name for kind in (Sample, Tools) for field in fields(kind)}
    names = {name for need in needs for name in need.split("|")}
    if better not in BETTER:
        raise InputError(f"better={better!r} of a metric", f"one of {', '.join(BETTER)}")
    if names - available:
        raise InputError(f"a metric needs {min(names - available)!r}", nearest(min(names - available), available))
    if not isinstance(same, tuple) or {*same} - {*SAME}:
        raise InputError(f"same={same!r} of a metric", f"a tuple of some of {', '.join(SAME)}")
    about = About(needs, better, paired, hears, unit, chance, same)

    def make(function: Function) -> Metric:
        try:
            signature(function).bind((), (), None)
        except TypeError as error:
            raise InputError(f"the metric {function.__name__!r}: {error}", "it takes (generated, reference, tools)") from None
        return Metric(function, about)

    return make


def _describe(value: object) -> str:
    shape = f" of shape {value.shape}" if isinstance(value, np.ndarray) else ""
    return "nothing" if value is None else f"{type(value).__name__}{shape}"


def _check_rates(sample: Sample, other: Sample) -> None:
    """Raise an InputError where two clips have different frame rates."""
    if not isclose(sample.fps, other.fps, rel_tol=RATE):
        problem = f"{sample.name!r} has {sample.fps:g} frames per second, the clip that it is compared with {other.fps:g}"
        raise InputError(problem, "bring both to one rate first: motion.resample(fps)")


def _check_joints(sample: Sample, other: Sample) -> None:
    """Raise an InputError where two clips have different joints or key points."""
    for field in ("positions", "points"):
        a, b = getattr(sample, field), getattr(other, field)
        if a is not None and b is not None and a.shape[1:] != b.shape[1:]:
            problem = f"{field} of {sample.name!r} have shape {a.shape}, the clip that it is compared with {b.shape}"
            raise InputError(problem, "clips of the same joints")


def pair_samples(
    generated: Sequence[Sample], reference: Sequence[Sample], field: str
) -> list[tuple[Sample, Sample, Array, Array]]:
    """Each generated sample, the reference of its condition, and the array ``field`` of both, of equal shape and rate.

    Raises:
        InputError: a sample has no reference, or the shapes or the rates differ.
    """
    truth = {sample.condition: sample for sample in reference}
    pairs = []
    for sample in generated:
        if sample.condition not in truth:
            raise InputError(f"{sample.name!r} has no reference clip {sample.condition!r}")
        _check_rates(sample, truth[sample.condition])
        a, b = getattr(sample, field), getattr(truth[sample.condition], field)
        if a.shape != b.shape:
            raise InputError(f"{field} of {sample.name!r} have shape {a.shape}, the reference {b.shape}")
        pairs.append((sample, truth[sample.condition], np.asarray(a, np.float64), np.asarray(b, np.float64)))
    return pairs
