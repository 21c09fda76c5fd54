"""A plan as data: what is gestured when, in a form that a person or a program can edit. The file is its JSON.

All parts are frozen. An edit (`plan_edits`) makes another plan, so that a program keeps the old one to undo it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from ..audio.emotions import EMOTIONS, suggest_emotion
from ..audio.speech import Word
from ..errors import InputError, guess, nearest
from ..limits import PLAUSIBLE_SECONDS
from .gesture import CROWDED, RUN_UP
from .lexicon import LEXICON
from .options import INTENSITY_RANGE, SEEDS, TEMPERATURE_RANGE
from .repertoire import FORMS, LEXICAL_FORMS

__all__ = [
    "AFTER_END", "NEAREST", "SUPERIMPOSED", "VERSION", "GazeShift", "HeardAccent", "HeardPhrase", "HeardWord",
    "EmotionMoment", "PlanData",
    "PlannedGesture", "Stretch", "find_form", "words_of", "parse_plan",
]  # fmt: skip

VERSION = 1
SUPERIMPOSED = "superimposed-beat"
"""Name of a beat where the hand already is (McNeill 1992: beats are superimposed on gestures that are held)."""
AFTER_END = 1.0
"""Seconds after the end of a speech in which a gesture may stroke. [ours] The planner's own may stroke after the last word."""
NEAREST = 0.1
"""Seconds from one stroke of a hand to the next, at least; ours: the planner's own are further apart."""
_LONGEST_TEXT = 200

Time = Annotated[float, Field(strict=True, ge=-RUN_UP, le=PLAUSIBLE_SECONDS)]
Moment = Annotated[float, Field(strict=True, ge=0, le=PLAUSIBLE_SECONDS)]
WordTime = Annotated[float, Field(strict=True, ge=-PLAUSIBLE_SECONDS, le=PLAUSIBLE_SECONDS)]
Seed = Annotated[int, Field(strict=True, ge=0, lt=SEEDS)]
Share = Annotated[float, Field(strict=True, ge=0, le=1)]
Intensity = Annotated[float, Field(strict=True, ge=INTENSITY_RANGE[0], le=INTENSITY_RANGE[1])]
Name = Annotated[str, Field(min_length=1, max_length=40)]
Text = Annotated[str, Field(max_length=_LONGEST_TEXT)]
_BOX = ((-0.7, 1.1), (-1.1, 1.1), (-0.5, 1.1))  # arm lengths out, up and forward of a shoulder: what a hand may reach ([ours])
_PLACE_AXES = ("out", "up", "forward")


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)


class HeardPhrase(_Part):
    """A stretch of speech between two pauses, in seconds. It is shown, and not played."""

    start: Moment
    end: Moment


class HeardAccent(_Part):
    """A prosodic accent, see `cospeech.audio.prosodic_events.Accent`. It is shown, and not played."""

    time: Moment
    strength: Annotated[float, Field(strict=True, ge=0, le=2)]


class HeardWord(_Part):
    """A word of the transcript, in seconds; before 0 where it was under way when the speech began.

    Gestures are added at words. Where the speech comes without words, these are played.
    """

    text: Text
    start: WordTime
    end: WordTime
    language: Annotated[str, Field(pattern="^[a-z]{2,3}$")] | None = None
    """See `cospeech.audio.languages`; none: English, or not known."""


class PlannedGesture(_Part):
    """A gesture: preparation, stroke, hold. Times are seconds; what is not given the planner chooses."""

    id: Name
    form: str
    stroke: Time
    """When the speed of the first stroke peaks. It is before 0 for a gesture on the very first syllable."""
    start: Time | None = None
    """When the preparation begins."""
    end: Time | None = None
    """When the last stroke ends."""
    hold: Annotated[float, Field(strict=True, ge=0, le=3600)] | None = None
    """Seconds for which the hands stay after the end."""
    hands: Literal["left", "right", "both"] | None = None
    size: Annotated[float, Field(strict=True, ge=0, le=3)] = 1.0
    """Factor on the size that the style gives it."""
    place: tuple[float, float, float] | None = None
    """Where the wrist of the leading hand ends its first stroke: out, up and forward of its shoulder, arm lengths."""
    word: Text = ""
    score: Share = 0.1
    """Semantic score, see `cospeech.rules.repertoire.Form`."""
    seed: Seed | None = None
    """Of its details; of the plan's where not given."""

    @field_validator("form")
    @classmethod
    def _check_form(cls, form: str) -> str:
        if form not in FORMS and form not in LEXICAL_FORMS and form != SUPERIMPOSED:
            hint = f"this word has the form {LEXICON[form]!r}" if form in LEXICON else nearest(form[:40], all_forms())
            raise ValueError(f"no form of gesture is called {form[:40]!r}|{hint}")
        return form

    @field_validator("place", mode="before")
    @classmethod
    def _check_place(cls, place: object) -> object:
        if place is None:
            return None
        if not isinstance(place, Sequence) or isinstance(place, str) or len(place) != 3:
            raise ValueError("a place of another kind|three numbers: out, up and forward, arm lengths")
        for value, axis, (low, high) in zip(place, _PLACE_AXES, _BOX, strict=True):
            if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
                raise ValueError(f"{axis} {value!r:.40} is out of reach|{low:g} … {high:g} arm lengths")
        return tuple(float(value) for value in place)

    @property
    def begins(self) -> float:
        """Seconds at which the preparation begins."""
        return max(self.stroke - _LEAD_IN, -RUN_UP) if self.start is None else self.start

    @property
    def over(self) -> float:
        """Seconds at which its hold ends."""
        return (self.stroke + CROWDED if self.end is None else self.end) + (self.hold or 0.0)

    def same_motion(self, other: PlannedGesture) -> bool:
        """Whether it is performed as the other is: words and scores may differ."""
        return self.model_copy(update={"word": other.word, "score": other.score}) == other

    def shares_hand(self, other: PlannedGesture) -> bool:
        """Whether both need one hand; where the planner chooses, they may."""
        return self.hands == other.hands or "both" in (self.hands, other.hands) or None in (self.hands, other.hands)

    def crowds(self, other: PlannedGesture) -> bool:
        """Whether both need one hand at nearly the same time."""
        return abs(self.stroke - other.stroke) < CROWDED and self.shares_hand(other)


_LEAD_IN = 0.8  # seconds from the beginning of a preparation to the stroke, where nothing is asked ([ours]: a usual one)


class GazeShift(_Part):
    """The eyes jump; see `cospeech.face.gaze.Saccade`. Degrees from the listener."""

    id: Name
    time: Moment
    yaw: Annotated[float, Field(strict=True, ge=-60, le=60)]
    up: Annotated[float, Field(strict=True, ge=-45, le=45)]
    length: Annotated[float, Field(strict=True, ge=0.02, le=1)]
    away: bool = False
    """Whether the eyes leave the listener."""


class EmotionMoment(_Part):
    """How much of each emotion there is at a moment; linear in between, and what is left to 1 is neutral."""

    time: Moment
    weights: dict[str, Share]

    @field_validator("weights")
    @classmethod
    def _check_weights(cls, weights: dict[str, float]) -> dict[str, float]:
        for name in weights:
            if name not in EMOTIONS:
                raise ValueError(f"no emotion is called {name[:40]!r}|{suggest_emotion(name[:40], EMOTIONS)}")
        if sum(weights.values()) > 1 + 1e-6:
            raise ValueError(f"the weights have the sum {sum(weights.values()):g}|1 at most")
        return weights


class Stretch(_Part):
    """A stretch of time with values of its own; None: those of the plan. Borders are smooth."""

    start: Moment = Field(alias="from")
    end: Moment = Field(alias="to")
    seed: Seed | None = None
    style: Text | None = None
    emotion: str | None = None
    intensity: Intensity | None = None
    open: bool = False
    """Whether its gestures and gaze are not listed yet: they are planned with its seed, when the plan is played."""

    @field_validator("emotion")
    @classmethod
    def _check_emotion(cls, emotion: str | None) -> str | None:
        return emotion if emotion is None else _check_emotion(emotion)

    @model_validator(mode="after")
    def _check_times(self) -> Stretch:
        if self.end <= self.start:
            raise ValueError(f"to {self.end:g} is not after from {self.start:g}|seconds")
        return self

    def holds(self, time: float) -> bool:
        """Whether a time in seconds lies in it."""
        return self.start <= time < self.end

    @property
    def is_empty(self) -> bool:
        """Whether nothing in it differs from the rest of the plan."""
        return not self.open and (self.seed, self.style, self.emotion, self.intensity) == (None, None, None, None)


def _check_emotion(emotion: str) -> str:
    if emotion != "auto" and emotion not in EMOTIONS:
        raise ValueError(f"no emotion is called {emotion[:40]!r}|{suggest_emotion(emotion[:40], ('auto', *EMOTIONS))}")
    return emotion


class PlanData(_Part):
    """The fields of a plan; `cospeech.rules.plan_edits.Plan` has its edits.

    Raises:
        InputError: a field is wrong; the message names it.
    """

    cospeech_plan: Literal[1] = 1
    seconds: Moment | None = None
    """Length of the speech, where it is known."""
    style: Text | None = None
    emotion: str | tuple[EmotionMoment, ...] = "auto"
    seed: Seed = 0
    intensity: Intensity = 1.0
    temperature: Annotated[float, Field(strict=True, ge=TEMPERATURE_RANGE[0], le=TEMPERATURE_RANGE[1])] = 1.0
    open: bool = True
    """Whether gestures and gaze outside of the stretches are not listed yet: they are planned when the plan is played."""
    phrases: tuple[HeardPhrase, ...] = ()
    accents: tuple[HeardAccent, ...] = ()
    words: tuple[HeardWord, ...] = ()
    gestures: tuple[PlannedGesture, ...] = ()
    gaze: tuple[GazeShift, ...] = ()
    stretches: tuple[Stretch, ...] = ()
    locked: tuple[Stretch, ...] = ()
    """Stretches in which edits are refused."""

    def __init__(self, /, **fields: Any) -> None:
        try:
            super().__init__(**fields)
        except ValidationError as error:
            raise _describe_error(error) from None

    @field_validator("emotion")
    @classmethod
    def _check_emotion(cls, emotion: str | tuple[EmotionMoment, ...]) -> str | tuple[EmotionMoment, ...]:
        if isinstance(emotion, str):
            return _check_emotion(emotion)
        for k, (a, b) in enumerate(pairwise(emotion), start=1):
            if b.time <= a.time:
                raise ValueError(f"emotion[{k}].time: {b.time:g} is not after {a.time:g}|each later than the one before")
        if not emotion:
            raise ValueError("an emotion track without a moment|a name, or moments with weights")
        return emotion

    @model_validator(mode="after")
    def _check_entries(self) -> PlanData:
        for what, ids in (("gestures", [each.id for each in self.gestures]), ("gaze", [each.id for each in self.gaze])):
            places: dict[str, int] = {}
            for k, name in enumerate(ids):
                if name in places:
                    raise ValueError(f"{what}[{k}].id: {name!r} is that of {what}[{places[name]}]|every id once")
                places[name] = k
        for k, word in enumerate(self.words):
            if word.end < word.start:
                raise ValueError(f"words[{k}].end: {word.end:g} is before the start at {word.start:g}|seconds")
        for k, gesture in enumerate(self.gestures):
            _check_gesture(gesture, f"gestures[{k}]", self.seconds)
        _check_distances(self.gestures)
        order = sorted(range(len(self.stretches)), key=lambda k: self.stretches[k].start)
        for a, b in pairwise(order):
            if self.stretches[b].start < self.stretches[a].end:
                raise ValueError(f"stretches[{b}].from: it begins inside stretches[{a}]|stretches do not overlap")
        return self


def _check_gesture(gesture: PlannedGesture, place: str, seconds: float | None) -> None:
    if gesture.start is not None and gesture.start >= gesture.stroke:
        raise ValueError(f"{place}.stroke: {gesture.stroke:g} is not after the start at {gesture.start:g}|seconds")
    if gesture.end is not None and gesture.end <= gesture.stroke:
        raise ValueError(f"{place}.end: {gesture.end:g} is not after the stroke at {gesture.stroke:g}|seconds")
    if seconds is not None and gesture.stroke > seconds + AFTER_END:
        raise ValueError(f"{place}.stroke: {gesture.stroke:g} is after the end of the speech|{seconds:g} s")


def _check_distances(gestures: tuple[PlannedGesture, ...]) -> None:
    """No hand strokes twice at once."""
    order = sorted(range(len(gestures)), key=lambda k: gestures[k].stroke)
    for a, b in pairwise(order):
        one, two = gestures[a], gestures[b]
        if two.stroke - one.stroke < NEAREST and one.shares_hand(two):
            problem = f"gestures[{b}].stroke: {two.stroke:g} is within {NEAREST:g} s of gestures[{a}] at {one.stroke:g}"
            raise ValueError(f"{problem}|move or remove one of them")


def words_of(words: Iterable[Word]) -> tuple[HeardWord, ...]:
    """Words of a transcript, as a plan has them: with exact times, so that the plan alone gives the same bytes."""
    return tuple(
        HeardWord(
            text=word.text[:_LONGEST_TEXT], start=float(word.start), end=float(word.end),
            language=None if word.language in ("", "en") else word.language,
        )
        for word in words
    )  # fmt: skip


def all_forms() -> list[str]:
    """Names of the forms of gestures."""
    return [*FORMS, *(name for name in LEXICAL_FORMS if name not in FORMS), SUPERIMPOSED]


def find_form(name: str) -> tuple[str, str | None]:
    """A form and the hands that a name asks for: ``big``, ``point_left``; or a word that has a form: ``huge``.

    Raises:
        InputError: there is no such form.
    """
    forms = all_forms()
    stem, _, side = name.strip().lower().rpartition("_")
    hands = side if stem and side in ("left", "right", "both") else None
    word = stem if hands else name.strip().lower()
    if word in forms:
        return word, hands
    if word in LEXICON:
        return LEXICON[word], hands
    words = [each for each in LEXICON if each not in forms]
    hint = f"{guess(word[:40], [*forms, *words])}known: {', '.join(forms)}; words that have a form: {' '.join(words)}"
    raise InputError(f"no form of gesture is called {name[:40]!r}", hint)


T = TypeVar("T", bound=PlanData)
_WORDS = {
    "missing": ("is missing", ""),
    "extra_forbidden": ("is no field of a plan", ""),
    "literal_error": ("is {value}", "expected {expected}"),
    "greater_than_equal": ("{value} is too small", "from {ge} on"),
    "less_than_equal": ("{value} is too large", "{le} at most"),
    "less_than": ("{value} is too large", "less than {lt}"),
    "string_too_long": ("is a text of more than {max_length} characters", ""),
    "string_too_short": ("is empty", ""),
    "finite_number": ("is not finite", "a number"),
}
"""Kind of an error → its text, and the hint."""
_KINDS = {
    "float": "a number",
    "int": "a whole number",
    "string": "text",
    "bool": "true or false",
    "tuple": "a list",
    "model": "an object",
}


def parse_plan(kind: type[T], data: Any, name: str) -> T:
    """A plan from what JSON holds.

    Args:
        kind: the class.
        data: parsed JSON.
        name: of the file, for messages.

    Raises:
        InputError: an entry is wrong; the message names it.
    """
    if not isinstance(data, dict) or "cospeech_plan" not in data:
        raise InputError(f"{name} is no plan", '`cospeech generate --plan-out` writes one; it has "cospeech_plan": 1')
    if data["cospeech_plan"] != VERSION or isinstance(data["cospeech_plan"], bool):
        raise InputError(f"{name}: cospeech_plan is {data['cospeech_plan']!r:.40}", f"this version reads {VERSION}")
    try:
        return kind(**data)
    except InputError as error:
        raise InputError(f"{name}: {error.problem}" if name else error.problem, error.hint) from None


def _describe_error(error: ValidationError) -> InputError:
    """The first thing that is wrong, in our words, with a hint."""
    errors = error.errors(include_url=False)
    first = next((each for each in errors if "str" not in each["loc"]), errors[0])  # of a track, not that it is no name
    where = ""
    for part in first["loc"]:
        if isinstance(part, int):
            where += f"[{part}]"
        elif part not in ("str", "tuple[EmotionMoment, ...]", "[key]"):
            where += f".{part}" if where else str(part)
    kind, value, facts = first["type"], f"{first['input']!r:.40}", first.get("ctx", {})
    if kind == "value_error":
        problem, _, hint = str(facts["error"]).partition("|")
    elif kind in _WORDS:
        problem, hint = (text.format(value=value, **facts) for text in _WORDS[kind])
    else:
        problem, hint = f"{value} is of another kind", _KINDS.get(kind.split("_")[0], "see docs/guides/plan.md")
    own_path = not where or problem.startswith(("gestures[", "gaze[", "emotion[", "stretches[", "words["))
    return InputError(problem if own_path else f"{where}: {problem}", hint)
