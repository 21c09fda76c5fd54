"""Performing a plan: the planner's own decisions, without those that were removed, and with those that were added.

A `_Source` plans from a seed, as if there were no plan. It notes each decision, and the state of the random numbers before it.
The `PlanPlayer` performs those decisions that the plan lists unchanged, with the same random numbers, on its own tracks: so a
plan without an edit gives the same bytes, and an edit changes nothing but its surroundings. What a source does not plan is
performed with random numbers of its own.
"""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import blake2b
from random import Random
from typing import Any, NamedTuple

from ..audio.event_detection import TICK
from ..audio.prosodic_events import Accent, Phrase
from ..audio.speech import Word
from ..errors import CospeechWarning
from ..face.gaze import Gaze, Saccade
from .emotion_modifiers import EmotionModifier
from .gesture import Gesture, GestureOverride
from .hand_state import HandState
from .plan import LEAD, SLACK, Planner
from .plan_edits import Plan
from .plan_locks import find_lock
from .plan_model import SUPERIMPOSED, GazeShift, PlannedGesture, Stretch
from .styles import Style, find_style

__all__ = ["PlanPlayer"]

_DIGITS = 4  # of times in seconds and of places: a tenth of a millisecond, of a millimetre
_DUE = SLACK + TICK - 1e-3  # seconds after a tick before which the next one is too late; a source's own may begin right there
_STRENGTH = 0.6  # of the accent of a gesture that was added ([ours]: the middle of those that get a gesture)


class _States(NamedTuple):
    """States of the random numbers of a planner and of its posture."""

    hands: Any
    posture: Any


@dataclass
class _Decision:
    """A decision of a source."""

    states: _States
    perform: Callable[[PlanPlayer, GestureOverride | None], bool | None]
    time: float
    """That of the stroke, or of the accent of a nod."""
    gesture: PlannedGesture | None = None


class _NotedGaze:
    """A gaze that keeps its last saccade for others to see."""

    def __init__(self, gaze: Gaze) -> None:
        self._gaze, self.averted, self.away = gaze, gaze.averted, False
        self.last: Saccade | None = None

    def decide(self, now: float, phrases: Sequence[Phrase], averted: float = 0.0) -> Saccade | None:
        self.last = self._gaze.decide(now, phrases, averted)
        self.away = self._gaze.away
        return self.last


class _Source(Planner):
    """Plans from a seed, and notes what it decides."""

    def __init__(self, style: Style, name: str, **options: Any) -> None:
        super().__init__(style, **options)
        self._name = name
        self.gaze = _NotedGaze(self.posture.gaze)
        self.posture.gaze = self.gaze
        self.decisions = list[_Decision]()
        self._count = 0
        self._looks = 0
        self.at_start = self.states()
        self.schedule = self.posture.schedule()
        self.saccade: GazeShift | None = None

    def states(self) -> _States:
        """The states of the random numbers now."""
        return _States(self._random.getstate(), self.posture.random.getstate())

    def decide(self, now: float, **events: Any) -> list[Gesture]:
        self.at_start, self.decisions, self.schedule = self.states(), [], self.posture.schedule()
        gestures = super().decide(now, **events)
        last, self.saccade = self.gaze.last, None
        if last is not None:
            shift = {"time": last.time, "yaw": last.yaw, "up": last.up, "length": last.length}
            values = {name: round(value, _DIGITS) for name, value in shift.items()}
            self.saccade = GazeShift(id=f"e{self._looks}{self._name}", away=self.gaze.away, **values)
            self._looks += 1
        return gestures

    def _nod(self, now: float, accent: Accent, modifier: EmotionModifier, has_stroke: bool) -> None:
        states = self.states()
        super()._nod(now, accent, modifier, has_stroke)

        def nod(player: PlanPlayer, _: GestureOverride | None) -> None:
            Planner._nod(player, now, accent, player.modifier, has_stroke)

        self.decisions.append(_Decision(states, nod, accent.time))

    def _perform(
        self, now: float, at: float, strength: float, name: str, modifier: EmotionModifier, word: Word | None,
        override: GestureOverride | None = None,
    ) -> bool:  # fmt: skip
        states = self.states()
        fits = super()._perform(now, at, strength, name, modifier, word, override)
        if fits:

            def perform(player: PlanPlayer, override: GestureOverride | None) -> bool:
                return Planner._perform(player, now, at, strength, name, player.modifier, word, override)

            self._note(states, perform)
        return fits

    def _beat(self, now: float, accent: Accent, beating: list[HandState], modifier: EmotionModifier, scale: float) -> bool:
        states = self.states()
        hands = [hand for hand, state in enumerate(self.hands) if any(state is each for each in beating)]
        fits = super()._beat(now, accent, beating, modifier, scale)
        if fits:

            def beat(player: PlanPlayer, _: GestureOverride | None) -> bool:
                return player.beat_in_place(now, accent, hands, scale)

            self._note(states, beat)
            self.decisions[-1].gesture = self.decisions[-1].gesture.model_copy(  # type: ignore[union-attr]
                update={"form": SUPERIMPOSED, "place": None, "hold": None}
            )
        return fits

    def _note(self, states: _States, perform: Callable[[PlanPlayer, GestureOverride | None], bool | None]) -> None:
        last, (hold, *place) = self._strokes[-1], self.placed
        entry = PlannedGesture.model_construct(
            id=f"g{self._count}{self._name}", form=last.form, hands=last.hands, word=last.word[:200], score=last.score,
            start=round(last.start, _DIGITS), stroke=round(last.stroke, _DIGITS), end=round(last.end, _DIGITS),
            hold=round(max(hold, 0.0), _DIGITS), place=tuple(round(value, _DIGITS) for value in place),
        )  # fmt: skip
        self._count += 1
        self.decisions.append(_Decision(states, perform, entry.stroke, entry))


class _PlannedGaze:
    """The gaze of a `PlanPlayer`: that of the source to which the time belongs, and that of the plan's list."""

    def __init__(self, player: PlanPlayer, averted: float) -> None:
        self._player, self.averted, self.away = player, averted, False

    def decide(self, now: float, phrases: Sequence[Phrase], averted: float = 0.0) -> Saccade | None:
        shift = self._player.next_shift(now)
        if shift is None:
            return None
        self.away = shift[1]
        return shift[0]


class PlanPlayer(Planner):
    """Decides for one take as a plan says.

    Args:
        style: the speaker at the beginning.
        plan: what is performed.
        intensity, temperature: as of `Planner`.
    """

    def __init__(self, style: Style, plan: Plan, *, intensity: float, temperature: float) -> None:
        own: dict[str, Any] = {"intensity": intensity, "temperature": temperature}
        super().__init__(style, seed=plan.seed, **own)
        self._plan = plan
        self._base = _Source(style, "", seed=plan.seed, **own)
        self._stretches: list[tuple[Stretch, _Source]] = []
        for stretch in (each for each in plan.stretches if each.seed is not None):
            other = style if stretch.style is None else find_style(stretch.style)
            size = intensity if stretch.intensity is None else stretch.intensity
            source = _Source(other, _name_source(stretch), seed=stretch.seed, intensity=size, temperature=temperature)
            self._stretches.append((stretch, source))
        self.posture.gaze = _PlannedGaze(self, style.averted)
        self._waiting = {each.id: each for each in plan.gestures}
        self._shifts = {each.id: each for each in plan.gaze}
        self._next = deque(sorted(plan.gestures, key=lambda each: each.begins))
        self._next_looks = deque(sorted(plan.gaze, key=lambda each: each.time))
        self._new_gestures, self._new_shifts = list[PlannedGesture](), list[GazeShift]()
        self.modifier = self.base_modifier = EmotionModifier()

    def plan(self) -> Plan:
        """The plan with all that was listed or planned so far."""
        gestures = sorted([*self._plan.gestures, *self._new_gestures], key=lambda each: each.stroke)
        gaze = sorted([*self._plan.gaze, *self._new_shifts], key=lambda each: each.time)
        stretches = [each.model_copy(update={"open": False}) for each in self._plan.stretches]
        fields = {"gestures": tuple(gestures), "gaze": tuple(gaze), "stretches": tuple(stretches), "open": False}
        return self._plan.model_copy(update=fields)

    def restyle(self, now: float, style: Style, intensity: float, modifier: EmotionModifier) -> None:
        self._set(self._source_at(now).states())
        super().restyle(now, style, intensity, modifier)

    def decide(
        self,
        now: float,
        *,
        accents: Sequence[Accent],
        phrases: Sequence[Phrase],
        words: Sequence[Word],
        modifier: EmotionModifier,
    ) -> list[Gesture]:
        speaking = any(p.start <= now + 0.5 and p.end >= now - 0.1 for p in phrases)
        self._accents, self.modifier = list(accents), modifier
        self._base.decide(now, accents=accents, phrases=phrases, words=words, modifier=self.base_modifier)
        for _, other in self._stretches:
            other.decide(now, accents=accents, phrases=phrases, words=words, modifier=modifier)
        source = self._source_at(now)
        self._set(self._base.at_start)  # feet, weight and trunk go on as they were: a stretch ends where the rest begins
        self.posture.follow(self._base.schedule)
        self.posture.decide(now, phrases=phrases, modifier=modifier, speaking=speaking)
        for each in (self._base, *(other for _, other in self._stretches)):
            for decision in each.decisions:
                if self._belongs(decision, each):
                    self._follow(decision)
        self._perform_due(now)
        self.bouts = source.bouts  # hands that come down draw nothing: their last strokes drew for them
        self._let_go(now, phrases, modifier)
        self._rest_as(source, now, modifier)
        gestures, self._strokes = self._strokes, []
        return gestures

    def _rest_as(self, source: _Source, now: float, modifier: EmotionModifier) -> None:
        """Hands that rest go where those of the source rest; else the effect of an edit would last until the next gesture."""
        for hand, (state, other) in enumerate(zip(self.hands, source.hands, strict=True)):
            free = now > max(state.busy, other.busy) + _DUE
            if free and {state.place, other.place} == {"rest", "idle"}:
                self._retract(now, hand, other.place, modifier, state.dice())

    def beat_in_place(self, now: float, accent: Accent, hands: list[int], scale: float) -> bool:
        """A superimposed beat of those of these hands that do not hang."""
        beating = [self.hands[hand] for hand in hands if self.hands[hand].place != "idle"]
        return bool(beating) and self._beat(now, accent, beating, self.modifier, scale)

    def next_shift(self, now: float) -> tuple[Saccade, bool] | None:
        """The saccade of this tick, and whether it leaves the listener."""
        source = self._source_at(now)
        shift, saccade = source.saccade, source.gaze.last
        if shift is not None and saccade is not None:
            if self._shifts.get(shift.id) == shift:
                del self._shifts[shift.id]
                return saccade, shift.away
            if self._is_open(now) and shift.id not in self._shifts:
                self._new_shifts.append(shift)
                return saccade, shift.away
        last: GazeShift | None = None
        while self._next_looks and self._next_looks[0].time < now + _DUE:
            last = self._shifts.pop(self._next_looks.popleft().id, last)
        return None if last is None else (Saccade(max(last.time, now + SLACK), last.yaw, last.up, last.length), last.away)

    # ------------------------------------------------------------------------------------------------ parts of it

    def _source_at(self, time: float) -> _Source:
        return next((source for stretch, source in self._stretches if stretch.holds(time)), self._base)

    def _is_open(self, time: float) -> bool:
        """Whether the plan leaves this time to a source, and does not list its gestures."""
        stretch = next((each for each in self._plan.stretches if each.holds(time)), None)
        if stretch is not None and stretch.seed is not None:
            return stretch.open
        return self._plan.open or (stretch is not None and stretch.open)  # a stretch without a seed has that of the plan

    def _time_of(self, decision: _Decision) -> float:
        """The time whose stretch rules a decision: of a gesture that reaches into a lock, one in the lock."""
        lock = None if decision.gesture is None else find_lock(decision.gesture, self._plan.locked)
        return decision.time if lock is None else max(min(decision.time, lock.end - 1e-9), lock.start)

    def _lists(self, gesture: PlannedGesture | None) -> bool:
        """Whether the plan lists it, unchanged, and it was not performed yet."""
        entry = None if gesture is None else self._waiting.get(gesture.id)
        return gesture is not None and entry is not None and entry.same_motion(gesture)

    def _belongs(self, decision: _Decision, source: _Source) -> bool:
        """Whether this source is the one that takes this decision."""
        return self._lists(decision.gesture) or source is self._source_at(self._time_of(decision))

    def _is_in_the_way(self, gesture: PlannedGesture) -> bool:
        """Whether it would meet a listed gesture, or, outside of a lock, one that stays because of the lock."""
        locked = self._plan.locked
        stays = [] if find_lock(gesture, locked) else [each for each in self._new_gestures if find_lock(each, locked)]
        return any(_meet(gesture, each) for each in (*self._plan.gestures, *stays))

    def _is_still(self, time: float) -> bool:
        """Whether a stretch without intensity holds then; the sources outside of it do not know of it."""
        return any(each.intensity == 0 and each.holds(time) for each in self._plan.stretches)

    def _set(self, states: _States) -> None:
        self._random.setstate(states.hands)
        self.posture.random.setstate(states.posture)

    def _follow(self, decision: _Decision) -> None:
        """Perform what a source decided, if it is a part of the plan."""
        gesture = decision.gesture
        if gesture is not None:
            is_listed, still = self._lists(gesture), self._is_still(gesture.stroke)
            if is_listed:
                del self._waiting[gesture.id]
            if still or not (is_listed or (self._is_open(self._time_of(decision)) and not self._is_in_the_way(gesture))):
                return
            if not is_listed:
                self._new_gestures.append(gesture)
        self._set(decision.states)
        if decision.perform(self, None) is False and gesture is not None:  # an edit before it has taken its time
            self._set(decision.states)
            decision.perform(self, GestureOverride(gesture.stroke, gesture.begins))

    def _perform_due(self, now: float) -> None:
        """Listed gestures that no source plans, each at the last tick before it begins."""
        while self._next and self._next[0].begins < now + _DUE:
            each = self._next.popleft()
            if self._waiting.pop(each.id, None) is None:  # it is a source's
                continue
            key = f"{self._plan.seed if each.seed is None else each.seed}/{each.id}"
            self._set(_States(Random(f"{key}/hands").getstate(), Random(f"{key}/posture").getstate()))
            still = self._is_still(each.stroke)
            if still or not self._perform_entry(now, each):
                why = "its stretch has intensity 0" if still else "there is no time for it"
                problem = f"gesture {each.id!r} at {each.stroke:g} s is left out: {why}"
                warnings.warn(problem, CospeechWarning, stacklevel=2)

    def _perform_entry(self, now: float, entry: PlannedGesture) -> bool:
        if entry.form == SUPERIMPOSED:
            hands = [0, 1] if entry.hands == "both" else [0 if entry.hands == "left" else 1]
            self.beat_in_place(now, Accent(entry.stroke + LEAD, _STRENGTH), hands, entry.size)
            return True
        override = GestureOverride(entry.stroke, entry.begins, entry.end, entry.hold, entry.hands, entry.size, entry.place)
        word = Word(entry.word, entry.stroke, entry.stroke) if entry.word else None
        return self._perform(now, entry.stroke + LEAD, _STRENGTH, entry.form, self.modifier, word, override)


def _name_source(stretch: Stretch) -> str:
    """What the ids of a stretch's gestures end in: it depends on nothing outside of the stretch, nor on its borders."""
    own = [stretch.style, stretch.intensity]
    return f"-{stretch.seed}" + ("" if own == [None, None] else f".{blake2b(repr(own).encode(), digest_size=3).hexdigest()}")


def _meet(gesture: PlannedGesture, other: PlannedGesture) -> bool:
    return gesture.crowds(other) and other.form != SUPERIMPOSED
