"""Edits of a plan as text: what the options of ``cospeech generate`` say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import isfinite
from os import PathLike
from typing import TYPE_CHECKING, Any

from ..audio.speech import open_speech
from ..errors import InputError, nearest
from ..motion.named_numbers import read_number
from .options import GenerationOptions

if TYPE_CHECKING:
    from .plan_edits import Plan

__all__ = ["NO_EDITS", "PlanCommands", "read_stretch", "with_plan"]


@dataclass(frozen=True)
class PlanCommands:
    """Edits of a plan, done in this order; each is text, as on the command line."""

    lock: Sequence[str] = ()
    """``0:3.2``: stretches that no other edit changes."""
    remove: Sequence[str] = ()
    """``g3``, or ``@2.4``: the gesture whose stroke is the nearest to 2.4 s."""
    move: Sequence[str] = ()
    """``g3@2.6``: the gesture, and the time of its stroke."""
    stretch: Sequence[str] = ()
    """``3.2:5:style=lively,intensity=1.3,emotion=anger,seed=7``: values of a stretch."""
    reseed: Sequence[str] = ()
    """``3.2:5`` or ``3.2:5:7``: a stretch, and its seed."""
    gesture: Sequence[str] = ()
    """``huge@2.4`` or ``point_left@word:there``: what is added, and when."""

    @property
    def any(self) -> bool:
        """Whether there is an edit."""
        return any(getattr(self, field.name) for field in fields(self))

    @property
    def needs_words(self) -> bool:
        """Whether an edit names a word of the transcript."""
        return any("@word:" in text for text in self.gesture)

    def apply(self, plan: Plan) -> Plan:
        """The plan with all edits.

        Raises:
            InputError: one of them cannot be understood or done.
        """
        for text in self.lock:
            plan = plan.lock(*read_stretch(text)[:2])
        for text in self.remove:
            plan = plan.remove(text)
        for text in self.move:
            name, time = _halves(text, "g3@2.6")
            plan = plan.move(name, _time(time))
        for text in self.stretch:
            low, high, rest = read_stretch(text)
            plan = plan.set(low, high, **_values(rest, text))
        for text in self.reseed:
            low, high, rest = read_stretch(text)
            plan = plan.reseed(low, high, None if not rest else _whole(rest))
        for text in self.gesture:
            form, time = _halves(text, "huge@2.4, or point_left@word:there")
            at = {"word": time[5:]} if time.startswith("word:") else {"at": _time(time)}
            plan = plan.add(form, **at)  # type: ignore[arg-type]
        return plan


NO_EDITS = PlanCommands()


def with_plan(
    options: GenerationOptions, plan: str | PathLike[str] | Plan | None, edits: PlanCommands,
    audio: str | PathLike[str], transcript: str | PathLike[str] | None, *, wanted: bool,
) -> GenerationOptions:  # fmt: skip
    """Options with the plan that is played; as they are where nobody asks for one.

    Args:
        options: of the performance.
        plan: a plan, or the file of one.
        edits: what is changed of it.
        audio, transcript: files whose words are read, if an edit names one.
        wanted: whether a plan is wanted, although none is given.

    Raises:
        InputError: the plan cannot be read, edited or played with these options.
    """
    if plan is None and not edits.any and not wanted:
        return options
    from .plan_edits import Plan

    played = plan if isinstance(plan, Plan) else Plan.of(options) if plan is None else Plan.load(plan)
    if edits.needs_words and not played.words:
        with open_speech(audio, transcript=transcript) as source:
            played = played.with_words(source.words or ())
    return replace(options, plan=edits.apply(played))


def read_stretch(text: str) -> tuple[float, float, str]:
    """From and to in seconds, and what comes behind: ``3.2:5:seed=7``.

    Raises:
        InputError: no stretch of time.
    """
    low, _, rest = text.partition(":")
    high, _, more = rest.partition(":")
    try:
        times = float(low or "0"), float(high)
    except ValueError:
        times = (float("nan"), 0.0)
    if not (isfinite(times[0]) and isfinite(times[1]) and 0 <= times[0] < times[1]):
        raise InputError(f"{text[:40]!r} is no stretch of time", "seconds from and to: 3.2:5")
    return *times, more


def _halves(text: str, hint: str) -> tuple[str, str]:
    name, at, time = text.rpartition("@")
    if not at or not name or not time:
        raise InputError(f"{text[:40]!r} does not say what and when", hint)
    return name, time


def _time(text: str) -> float:
    return read_number(text, f"{text[:40]!r} is no time", "seconds: 2.4")


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise InputError(f"{text[:40]!r} is no seed", "a whole number") from None


_READ = {"style": str, "emotion": str, "seed": _whole, "intensity": _time}


def _values(text: str, whole: str) -> dict[str, Any]:
    """What a stretch sets: ``style=calm:0.7,lively:0.3,seed=7``; a comma may be a part of a style."""
    found: dict[str, Any] = {}
    name = ""
    for part in text.split(","):
        key, sign, value = part.partition("=")
        if sign and key.strip() in _READ:
            name = key.strip()
            found[name] = value.strip()
        elif name == "style" and not sign:
            found[name] += f",{part}"
        else:
            raise InputError(f"{whole[:40]!r} sets nothing that is known", f"3.2:5:style=lively; {nearest(key[:40], _READ)}")
    values = {key: _READ[key](value) for key, value in found.items()}  # type: ignore[operator]
    return values | ({"open": True} if "seed" in values else {})
