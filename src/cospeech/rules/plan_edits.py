"""Plans and their edits. Each edit gives another plan and leaves the old one as it was."""

from __future__ import annotations

import os
from collections.abc import Iterable
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from ..audio.emotions import EMOTIONS, EmotionTrack
from ..audio.speech import Word
from ..errors import InputError, guess, nearest
from ..files import atomic, parse_json, read_regular
from ..limits import PLAN_BYTES, PLAN_VALUES
from ..motion.named_numbers import read_number, read_seconds
from .gesture import RUN_UP
from .options import SEEDS, GenerationOptions
from .plan_locks import beats_on, check_free, find_lock, start_after_lock
from .plan_model import SUPERIMPOSED, EmotionMoment, PlanData, PlannedGesture, find_form, parse_plan, words_of
from .plan_stretches import cut_out, lay_over
from .repertoire import FORMS, LEXICAL_FORMS

__all__ = ["VALUES", "Plan", "Setting"]

_MOST_IDS = 40  # ids in a message, at most [ours: some lines of a terminal]
VALUES = ("style", "emotion", "intensity")
"""The values that a stretch may have of its own, and that `Plan.clear` takes away."""


class Setting(NamedTuple):
    """The values that hold from a time on."""

    time: float
    style: str | None
    feels: str | tuple[EmotionMoment, ...]
    intensity: float
    seed: int

    @property
    def moods(self) -> str | EmotionTrack:
        """The emotion, as an option of a model."""
        return _moods(self.feels)


class Plan(PlanData):
    """Which gestures a performance has, and when: gestures, gaze, phrases, accents, emotions, seeds.

    A plan never changes: each edit returns a new plan. A new plan is *open*: it lists no gestures, and the model plans them
    from the seed when it plays the plan. `RuleBasedModel.plan` returns the plan of a speech, which lists all gestures. Each
    gesture has an ``id`` that no edit changes.

    >>> plan = Plan(seed=3).add("huge", at=2.4).add("point_left", at=5.0, size=1.3)
    >>> [(gesture.id, gesture.form, gesture.stroke, gesture.hands) for gesture in plan.gestures]
    [('a1', 'big', 2.4, None), ('a2', 'point', 5.0, 'left')]
    >>> [gesture.form for gesture in plan.remove("a1").gestures]
    ['point']
    """

    # ------------------------------------------------------------------------------------------------ files

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Plan:
        """Read a plan from a JSON file.

        Raises:
            InputError: it cannot be read; or an entry is wrong, which the message names.
        """
        if not isinstance(path, (str, PathLike)):
            raise InputError(f"{type(path).__name__} where a plan belongs", "give a Plan, or the path of a file of one")
        name = repr(os.fsdecode(path)[-80:])
        text = read_regular(path, "a plan", PLAN_BYTES)
        try:
            return parse_plan(cls, parse_json(text, name, PLAN_VALUES), name)
        except RecursionError:
            raise InputError(f"{name} is nested too deeply", "is it a plan?") from None

    def save(self, path: str | PathLike[str]) -> None:
        """Write the plan as JSON, with a line for each entry, so that you can edit it in any editor.

        Raises:
            InputError: it cannot be written.
        """
        with atomic(path) as temporary:
            temporary.write_text(self.to_json(), "utf-8", newline="\n")

    def to_json(self) -> str:
        """The plan as JSON, without fields that are None."""
        import json

        data = self.model_dump(by_alias=True, exclude_none=True)
        lines = []
        for key, value in data.items():
            if isinstance(value, tuple | list) and value:
                rows = ",\n".join(f"    {json.dumps(row, ensure_ascii=False)}" for row in value)
                lines.append(f"  {json.dumps(key)}: [\n{rows}\n  ]")
            else:
                lines.append(f"  {json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}")
        return "{\n" + ",\n".join(lines) + "\n}\n"

    @classmethod
    def of(cls, options: GenerationOptions) -> Plan:
        """An open plan with the style, emotion, seed, intensity and temperature of these options.

        Raises:
            InputError: a style or an emotion that cannot be written down, such as an example.
        """
        if options.style is not None and not isinstance(options.style, str):
            raise InputError("a style that is no text cannot be a part of a plan", "give it by name: calm:0.7,lively:0.3")
        values: dict[str, Any] = {"style": options.style, "emotion": _emotion_data(options.emotion), "seed": options.seed}
        return cls(**values, intensity=options.intensity, temperature=options.temperature)

    def options(self) -> dict[str, Any]:
        """The options of `GenerationOptions` that the plan has."""
        own = {"style": self.style, "emotion": self.moods, "seed": self.seed}
        return own | {"intensity": self.intensity, "temperature": self.temperature}

    @property
    def moods(self) -> str | EmotionTrack:
        """The emotion, as an option of a model."""
        return _moods(self.emotion)

    def settings(self) -> list[Setting]:
        """The values from each time on: style, emotion, intensity and seed at each border of a stretch."""
        usual = Setting(0.0, self.style, self.emotion, self.intensity, self.seed)
        settings = list[Setting]()
        stretches = sorted(self.stretches, key=lambda each: each.start)
        for k, each in enumerate(stretches):
            own: dict[str, Any] = {"style": each.style, "feels": each.emotion, "intensity": each.intensity, "seed": each.seed}
            settings.append(usual._replace(time=each.start, **{n: value for n, value in own.items() if value is not None}))
            if k + 1 == len(stretches) or stretches[k + 1].start > each.end:
                settings.append(usual._replace(time=each.end))
        return settings

    # ------------------------------------------------------------------------------------------------ gestures

    def find(self, gesture: str) -> PlannedGesture:
        """A gesture of this plan.

        Args:
            gesture: its id, ``"g3"``; or a time, ``"@2.4"``, for the gesture whose stroke is nearest to 2.4 s.

        Raises:
            InputError: the plan has no such gesture.
        """
        if not isinstance(gesture, str):
            hint = 'such as "g3", or "@2.4" for the one nearest to 2.4 s'
            raise InputError(f"{str(gesture)[:40]} is no id of a gesture", hint)
        if gesture.startswith("@") and self.gestures:
            time = read_seconds(gesture[1:], f"{gesture[1:41]!r} is not a time in seconds", "such as 2")
            return min(self.gestures, key=lambda each: abs(each.stroke - time))
        for each in self.gestures:
            if each.id == gesture:
                return each
        ids = [each.id for each in self.gestures]
        hint = nearest(gesture[:40], ids) if ids else "no gesture is listed: save the plan of a speech first"
        if len(ids) > _MOST_IDS:  # that of an hour has a thousand
            hint = f"{guess(gesture[:40], ids)}known: {ids[0]} … {ids[-1]}; @37:10 is the one nearest to this time"
        raise InputError(f"no gesture of the plan is called {gesture[:40]!r}", hint)

    def add(
        self, form: str, *, at: float | None = None, word: str | None = None, hands: str | None = None, **fields: Any
    ) -> Plan:
        """This plan with one more gesture. It replaces gestures of the same hands that are less than 0.6 s away.

        Args:
            form: a form, with ``_left``, ``_right`` or ``_both`` if you like; or a word of the lexicon (see `find_form`).
            at: time of its stroke in seconds. Give this or ``word``.
            word: the word of the transcript on which the stroke comes: ``"there"``; the second one is ``"there:2"``.
            hands: left, right or both; None: the form or the planner decides.
            fields: other fields of `PlannedGesture`.

        Raises:
            InputError: no such form or word, a value out of range, or a locked time.
        """
        name, side = find_form(form)
        if (at is None) == (word is None):
            raise InputError("a gesture needs a time or a word", "at=2.4, or word='there'")
        text = "" if word is None else self._word(word)[0]
        stroke = at if at is not None else self._word(word or "")[1]
        ids, number = {each.id for each in self.gestures}, 1
        while f"a{number}" in ids:
            number += 1
        kind = FORMS.get(name) or LEXICAL_FORMS.get(name)
        score = kind.score if kind else 0.1
        entry = {"id": f"a{number}", "form": name, "stroke": stroke, "hands": hands or side, "word": text, "score": score}
        gesture = start_after_lock(self._with_fields(gestures=[entry | fields]).gestures[0], self.locked)
        near = [each for each in self.gestures if each.crowds(gesture)] if name != SUPERIMPOSED else []
        for each in (gesture, *near):
            check_free(each, self.locked, () if each is gesture else self.gestures)
        return self._with([*(each for each in self.gestures if each not in near), gesture])

    def remove(self, gesture: str) -> Plan:
        """This plan without a gesture, and without the beats on it. ``gesture`` is named as for `find`.

        Raises:
            InputError: there is no such gesture, or it is locked.
        """
        old = self.find(gesture)
        check_free(old, self.locked, self.gestures)
        targets = [old, *(beats_on(old, self.gestures) if old.form != SUPERIMPOSED else [])]
        return self._with(each for each in self.gestures if each not in targets)

    def remove_between(self, start: float, end: float) -> Plan:
        """This plan without the gestures whose stroke is from ``start`` to ``end`` seconds, and the beats on them.

        Locked gestures stay.

        Raises:
            InputError: no stretch of time, all of it is locked, or the plan lists no gesture at all.
        """
        if not self.gestures:
            raise InputError("no gesture is listed", "save the plan of a speech first")
        free = self._free_parts(start, end, {})
        there = [each for each in self.gestures if any(low <= each.stroke < high for low, high in free)]
        targets = [each for each in there if not find_lock(each, self.locked, self.gestures)]
        targets += [beat for each in targets if each.form != SUPERIMPOSED for beat in beats_on(each, self.gestures)]
        return self._with(each for each in self.gestures if each not in targets)

    def move(self, gesture: str, to: float) -> Plan:
        """This plan with the stroke of a gesture at the time ``to``, seconds. The gesture keeps its length.

        Raises:
            InputError: there is no such gesture, another gesture has the same hands at that time, or a time is locked.
        """
        old = self.find(gesture)
        by = to - old.stroke
        times = {"start": old.start, "end": old.end}
        new_times = {name: round(max(value + by, -RUN_UP), 4) for name, value in times.items() if value is not None}
        return self.change(old.id, stroke=to, **new_times)

    def change(self, gesture: str, **fields: Any) -> Plan:
        """This plan with other fields of a gesture, see `PlannedGesture`. If the form changes, the place is that of the form.

        Raises:
            InputError: there is no such gesture or field, a value is out of range, or a time is locked.
        """
        old = self.find(gesture)
        check_free(old, self.locked, self.gestures)
        if "form" in fields:
            form, side = find_form(str(fields["form"]))
            usual = {"start": None, "place": None, "end": None, "hold": None} if form != old.form else {}
            fields = {**usual, **fields, "form": form} | ({"hands": side} if side else {})
        data = [each.model_dump() | (fields if each.id == old.id else {}) for each in self.gestures]
        plan = self._with_fields(gestures=data)
        new = next(each for each in plan.gestures if each.id == fields.get("id", old.id))
        check_free(new, self.locked, plan.gestures)
        return self._with(plan.gestures)

    # ------------------------------------------------------------------------------------------------ stretches

    def reseed(self, start: float, end: float, seed: int | None = None) -> Plan:
        """This plan with new gestures and gaze from ``start`` to ``end`` seconds. Locked gestures stay.

        Args:
            start, end: seconds.
            seed: of the stretch; None: one more than the largest seed of the plan and its stretches.

        Raises:
            InputError: no stretch of time, or all of it is locked.
        """
        if seed is None:
            seed = (max([self.seed, *(each.seed for each in self.stretches if each.seed is not None)]) + 1) % SEEDS
        return self.set(start, end, seed=seed, open=True)

    def set(self, start: float, end: float, **values: Any) -> Plan:
        """This plan with own values for a stretch: seed, style, emotion, intensity. Locked parts of it do not change.

        Raises:
            InputError: no stretch of time, all of it is locked, or a value is out of range.
        """
        free = self._free_parts(start, end, values)
        stretches = list(self.stretches)
        for low, high in free:
            stretches = lay_over(stretches, low, high, values)

        def is_planned_anew(time: float) -> bool:
            return "seed" in values and any(low <= time < high for low, high in free)

        return self._with_fields(
            stretches=[each.model_dump() for each in stretches],
            gestures=[
                each.model_dump()
                for each in self.gestures
                if not is_planned_anew(each.stroke) or find_lock(each, self.locked, self.gestures)
            ],
            gaze=[each.model_dump() for each in self.gaze if not is_planned_anew(each.time)],
        )

    def clear(self, start: float, end: float, names: Iterable[str] = VALUES) -> Plan:
        """This plan with the values of the plan again in a stretch. Locked parts of it do not change.

        Args:
            start, end: seconds.
            names: the values to clear: style, emotion, intensity, seed. With ``"seed"``, parts that had a seed of their own are
                planned anew with the seed of the plan.

        Raises:
            InputError: no stretch of time, all of it is locked, or no such value.
        """
        keys = tuple(names)
        for name in keys:
            if name not in (*VALUES, "seed"):
                raise InputError(f"a stretch has no value {name[:40]!r} to clear", nearest(name[:40], (*VALUES, "seed")))
        free = self._free_parts(start, end, {})
        plan, stretches = self, list(self.stretches)
        if "seed" in keys:
            own = [(each.start, each.end) for each in stretches if each.seed is not None]
            for low, high in cut_out(free, cut_out([(start, end)], own)):
                plan = plan.set(low, high, seed=None, open=True)
            stretches = list(plan.stretches)
        for low, high in free:
            stretches = lay_over(stretches, low, high, dict.fromkeys(keys))
        return plan._with_fields(stretches=[each.model_dump() for each in stretches if not each.is_empty])

    def lock(self, start: float, end: float) -> Plan:
        """This plan with locked gestures from ``start`` to ``end`` seconds: edits refuse them, and `reseed` keeps them.

        A gesture is locked if any part of it lies there, from its preparation to the end of its hold or of the last beat on it.
        No new gesture reaches into the stretch.

        Raises:
            InputError: no stretch of time.
        """
        return self._with_fields(locked=[*(each.model_dump() for each in self.locked), {"from": start, "to": end}])

    def unlock(self) -> Plan:
        """This plan without locks."""
        return self._with_fields(locked=())

    def with_words(self, words: Iterable[Word]) -> Plan:
        """This plan with the words of a transcript."""
        return self.model_copy(update={"words": words_of(words)})

    @property
    def speech_words(self) -> tuple[Word, ...]:
        """The words of the plan, as `Word`."""
        return tuple(Word(word.text, word.start, word.end, word.language or "") for word in self.words)

    # ------------------------------------------------------------------------------------------------ parts of them

    def _with_fields(self, **fields: Any) -> Plan:
        return parse_plan(type(self), self.model_dump() | fields, "")

    def _with(self, gestures: Iterable[PlannedGesture]) -> Plan:
        return self._with_fields(gestures=[each.model_dump() for each in sorted(gestures, key=lambda each: each.stroke)])

    def _free_parts(self, start: float, end: float, values: dict[str, Any]) -> list[tuple[float, float]]:
        """The parts of a stretch that are not locked; the values are checked, too."""
        stretch = self._with_fields(stretches=[{"from": start, "to": end, **values}]).stretches[0]
        free = cut_out([(stretch.start, stretch.end)], ((each.start, each.end) for each in self.locked))
        if not free:
            raise InputError(f"{start:g} to {end:g} s is locked", "unlock it, or choose another stretch")
        return free

    def _word(self, query: str) -> tuple[str, float]:
        """A word and the time of a stroke on it."""
        text, _, number = query.partition(":")
        key = text.strip().lower().strip(".,;:!?\"'")
        matches = [each for each in self.words if each.text.lower().strip(".,;:!?\"'") == key]
        count = 1 if not number else int(_number(number, "which of them"))
        if not self.words:
            raise InputError(f"no words are known, so none is {text[:40]!r}", "give a transcript, with times or without")
        if not matches:
            raise InputError(
                f"the word {text[:40]!r} is not there", nearest(key[:40], dict.fromkeys(w.text for w in self.words))
            )
        if not 1 <= count <= len(matches):
            times = "once" if len(matches) == 1 else f"{len(matches)} times"
            hint = text[:40] + (f":1 … {text[:40]}:{len(matches)}" if len(matches) > 1 else "")
            raise InputError(f"there is no word {query[:40]!r}: {text[:40]!r} is said {times}", hint)
        word = matches[count - 1]
        return word.text, round(word.start + 0.4 * (word.end - word.start), 4)  # as `Planner` strokes on words


def _number(text: str, what: str) -> float:
    return read_number(text, f"{text[:40]!r} is not {what}", "such as 2")


def _moods(emotion: str | tuple[EmotionMoment, ...]) -> str | EmotionTrack:
    if isinstance(emotion, str):
        return emotion
    weights = np.array([[mood.weights.get(name, 0.0) for name in EMOTIONS] for mood in emotion])
    weights[:, 0] += np.maximum(1.0 - weights.sum(1), 0.0)  # neutral
    weights /= weights.sum(1, keepdims=True)
    return EmotionTrack(np.array([mood.time for mood in emotion]), weights)


def _emotion_data(emotion: object) -> object:
    """An emotion as a plan has it."""
    if not isinstance(emotion, EmotionTrack):
        if not isinstance(emotion, str):
            raise InputError("an emotion that is heard cannot be a part of a plan", "auto, a name or an EmotionTrack")
        return emotion
    track = emotion.without_past()
    return tuple(
        {"time": time, "weights": {name: share for name, share in zip(EMOTIONS, row, strict=True) if share > 0}}
        for time, row in zip(track.times.tolist(), track.weights.tolist(), strict=True)
    )
