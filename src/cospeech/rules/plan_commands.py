"""Edits of a plan as text: the values of options of ``cospeech generate``."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from os import PathLike
from typing import TYPE_CHECKING, Any

from ..audio.speech import open_speech
from ..errors import CospeechWarning, InputError, nearest
from ..motion.named_numbers import read_seconds
from .gesture import CROWDED
from .options import GenerationOptions

if TYPE_CHECKING:
    from .plan_edits import Plan

__all__ = ["NO_EDITS", "PlanCommands", "read_stretch", "with_plan"]


@dataclass(frozen=True)
class PlanCommands:
    """Edits of a plan, done in this order; each is text, as on the command line."""

    lock: Sequence[str] = ()
    """``0:3.2``: stretches whose gestures no other edit changes."""
    remove: Sequence[str] = ()
    """``g3``, or ``@2.4``: the gesture whose stroke is the nearest to 2.4 s; ``15:30``: all that stroke in this stretch."""
    move: Sequence[str] = ()
    """``g3@2.6``: the gesture, and the time of its stroke."""
    stretch: Sequence[str] = ()
    """``3.2:5:style=lively,intensity=1.3,emotion=anger,seed=7``: values of a stretch."""
    reseed: Sequence[str] = ()
    """``3.2:5`` or ``3.2:5:7``: a stretch, and its seed."""
    gesture: Sequence[str] = ()
    """``huge@2.4``, ``huge@37:10`` or ``point_left@word:there``: what is added, and when."""

    @property
    def any(self) -> bool:
        """Whether there is an edit."""
        return any(getattr(self, field.name) for field in fields(self))

    @property
    def names_gestures(self) -> bool:
        """Whether an edit names a gesture of the plan."""
        return bool(self.remove or self.move)

    @property
    def needs_words(self) -> bool:
        """Whether an edit names a word of the transcript."""
        return any("@word:" in text for text in self.gesture)

    def apply(self, plan: Plan, seconds: float | None = None) -> Plan:
        """The plan with all edits. A note names each gesture of an edit that a later edit takes away.

        Args:
            plan: what is edited.
            seconds: length of the speech, where it is known; else the plan may know it.

        Raises:
            InputError: one of them cannot be understood or done; the message names the option.
        """
        seconds = plan.seconds if seconds is None else seconds
        requests: dict[str, str] = {}
        for name, edit in _EDITS.items():
            for text in getattr(self, name):
                option = f"--{name} {text[:40]}"
                with _name_in_errors(option):
                    new_plan, gesture = edit(plan, text, seconds)
                ids = {each.id for each in new_plan.gestures}
                for absent in [each for each in requests if each not in ids]:
                    warnings.warn(f"{requests.pop(absent)} is left out: {option} {_WHY[name]}", CospeechWarning, stacklevel=2)
                requests |= {gesture: option} if gesture else {}
                plan = new_plan
        return plan


NO_EDITS = PlanCommands()


def with_plan(
    options: GenerationOptions, plan: str | PathLike[str] | Plan | None, edits: PlanCommands,
    audio: str | PathLike[str], transcript: str | PathLike[str] | None, *, writes_plan: bool,
    list_gestures: Callable[[GenerationOptions], Plan],
) -> GenerationOptions:  # fmt: skip
    """Options with the plan that is played; unchanged if no plan is wanted.

    Args:
        options: of the performance.
        plan: a plan, or the file of one.
        edits: of the plan.
        audio, transcript: files whose words are read, if an edit names one.
        writes_plan: whether a plan is written; then there is one, although none was given.
        list_gestures: gives the plan of a performance with all its gestures; used if an edit names one and no plan is given.

    Raises:
        InputError: the plan cannot be read, edited or played with these options.
    """
    if plan is None and not edits.any and not writes_plan:
        return options
    from .plan_edits import Plan

    if plan is None:
        open_plan = Plan.of(options)
        new_plan = list_gestures(replace(options, plan=open_plan)) if edits.names_gestures else open_plan
    else:
        new_plan = plan if isinstance(plan, Plan) else Plan.load(plan)
    if edits.any:
        read, own_words = transcript if edits.needs_words else None, new_plan.words
        with open_speech(audio, transcript=read) as source:
            new_plan = new_plan if read is None else new_plan.with_words(source.words or ())
            new_plan = edits.apply(new_plan, source.expected_seconds)
        new_plan = new_plan.model_copy(update={"words": own_words}) if own_words else new_plan  # others bring a note
    return replace(options, plan=new_plan)


def read_stretch(text: str) -> tuple[float, float, str]:
    """From and to in seconds, and what comes behind: ``3.2:5:seed=7``. Minutes have their letter: ``37m10s:37m25s``.

    Raises:
        InputError: no stretch of time.
    """
    low, _, rest = text.partition(":")
    high, _, more = rest.partition(":")
    wrong = f"{text[:40]!r} is no stretch of time", "seconds from and to: 3.2:5; with minutes: 37m10s:37m25s"
    start, end = read_seconds(low or "0", *wrong), read_seconds(high, *wrong)
    if not 0 <= start < end:
        raise InputError(*wrong)
    return start, end, more


@contextmanager
def _name_in_errors(option: str) -> Iterator[None]:
    """Put the option before the text of an error."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{option}: {error.problem}", error.hint) from None


def _lock(plan: Plan, text: str, seconds: float | None) -> tuple[Plan, str]:
    low, high, _ = _stretch(text, seconds)
    return plan.lock(low, high), ""


def _remove(plan: Plan, text: str, seconds: float | None) -> tuple[Plan, str]:
    if text.startswith("@"):
        _moment(text[1:], seconds)
    if text[:1] in ":.0123456789" and ":" in text and text not in {each.id for each in plan.gestures}:
        low, high, rest = _stretch(text, seconds)
        if rest:
            raise InputError(f"{text[:40]!r} is no stretch of time", "seconds from and to: 15:30; with minutes: 37m10s:37m25s")
        return plan.remove_between(low, high), ""
    return plan.remove(text), ""


def _move(plan: Plan, text: str, seconds: float | None) -> tuple[Plan, str]:
    name, time = _halves(text, "g3@2.6")
    gesture = plan.find(name).id
    return plan.move(gesture, _moment(time, seconds)), gesture


def _set(plan: Plan, text: str, seconds: float | None) -> tuple[Plan, str]:
    low, high, rest = _stretch(text, seconds)
    return plan.set(low, high, **_values(rest, text)), ""


def _reseed(plan: Plan, text: str, seconds: float | None) -> tuple[Plan, str]:
    low, high, rest = _stretch(text, seconds)
    return plan.reseed(low, high, None if not rest else _whole(rest)), ""


def _add(plan: Plan, text: str, seconds: float | None) -> tuple[Plan, str]:
    form, time = _halves(text, "huge@2.4, or point_left@word:there")
    at = {"word": time[5:]} if time.startswith("word:") else {"at": _moment(time, seconds)}
    new_plan = plan.add(form, **at)  # type: ignore[arg-type]
    before = {each.id for each in plan.gestures}
    return new_plan, next(each.id for each in new_plan.gestures if each.id not in before)


_EDITS = {"lock": _lock, "remove": _remove, "move": _move, "stretch": _set, "reseed": _reseed, "gesture": _add}
"""Option → its function: from a plan, a text and the length of the speech to the next plan, and the id of the gesture it names.

They are done in this order."""
_ANEW = "plans this stretch anew"
_WHY = {"stretch": _ANEW, "reseed": _ANEW, "gesture": f"needs the same hand less than {CROWDED:g} s away"}
"""Option → why a gesture gives way to it."""


def _halves(text: str, hint: str) -> tuple[str, str]:
    name, at, time = text.rpartition("@")
    if not at or not name or not time:
        raise InputError(f"{text[:40]!r} does not say what and when", hint)
    return name, time


def _time(text: str) -> float:
    return read_seconds(text, f"{text[:40]!r} is no time", "seconds: 2.4; or 37:10, 37m10s")


def _moment(text: str, seconds: float | None) -> float:
    """A time within the speech."""
    time = _time(text)
    if time < 0:
        raise InputError(f"{time:g} is before the speech", "seconds, from 0 on")
    if seconds is not None and time > seconds:
        raise InputError(f"{time:g} is after the end of the speech", f"{seconds:g} s")
    return time


def _stretch(text: str, seconds: float | None) -> tuple[float, float, str]:
    """As `read_stretch`; a part of it, at least, is in the speech."""
    low, high, rest = read_stretch(text)
    if seconds is not None and low >= seconds:
        raise InputError(f"{low:g} is after the end of the speech", f"{seconds:g} s")
    return low, high, rest


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise InputError(f"{text[:40]!r} is no seed", "a whole number") from None


_READ = {"style": str, "emotion": str, "seed": _whole, "intensity": _time}


def _values(text: str, whole: str) -> dict[str, Any]:
    """The values that a stretch sets: ``style=calm:0.7,lively:0.3,seed=7``; a comma may be a part of a style."""
    texts: dict[str, Any] = {}
    name = ""
    for part in text.split(","):
        key, sign, value = part.partition("=")
        if sign and key.strip() in _READ:
            name = key.strip()
            texts[name] = value.strip()
        elif name == "style" and not sign:
            texts[name] += f",{part}"
        else:
            raise InputError(f"{whole[:40]!r} sets nothing that is known", f"3.2:5:style=lively; {nearest(key[:40], _READ)}")
    values = {key: _READ[key](value) for key, value in texts.items()}  # type: ignore[operator]
    return values | ({"open": True} if "seed" in values else {})
