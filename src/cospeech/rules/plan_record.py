"""A plan while it is played: who performs it, and what is noted for the plan that is written."""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Sequence
from itertools import islice
from typing import Any

from ..audio.emotions import Moods
from ..audio.event_detection import EventDetector
from ..errors import CospeechWarning, InputError
from .arousal import arouse
from .emotion_modifiers import EmotionModifier, blend_modifiers
from .mood import Mood
from .plan_edits import Plan, Setting
from .plan_model import AFTER_END, HeardAccent, HeardPhrase, PlannedGesture, words_of
from .plan_player import PlanPlayer
from .planned_words import PlannedWords, describe_length
from .styles import STYLES, Style, find_style

__all__ = ["PlanRecord"]

_DIGITS = 4


class PlanRecord:
    """A plan under way.

    Args:
        plan: what is played.
        style: of the beginning.
        emotion: of the plan, outside of its stretches.
        intensity, temperature: as of `Planner`.

    Raises:
        InputError: a stretch with a style that there is not, or one that sits where the other stands.
    """

    def __init__(self, plan: Plan, style: Style, emotion: Moods | None, *, intensity: float, temperature: float) -> None:
        for k, stretch in enumerate(plan.stretches):
            if stretch.style is not None:
                _check_style(f"stretches[{k}].style, {stretch.start:g} to {stretch.end:g} s", stretch.style, style)
        self.player = PlanPlayer(style, plan, intensity=intensity, temperature=temperature)
        self.words = PlannedWords(plan.speech_words)
        self._settings = deque(plan.settings())
        self._usual = Mood(emotion) if any(each.emotion is not None for each in plan.stretches) else None
        self._accents: dict[float, HeardAccent] = {}
        self._phrases: dict[float, float] = {}

    def settings_until(self, now: float) -> list[Setting]:
        """What begins to hold up to this time in seconds, and was not told yet."""
        found = []
        while self._settings and self._settings[0].time <= now + 1e-9:
            found.append(self._settings.popleft())
        return found

    def note(self, now: float, modifier: EmotionModifier, mood: Mood, detector: EventDetector) -> None:
        """One tick, before it is planned."""
        self.player.base_modifier = modifier
        if self._usual is not None:  # what a source decides must not depend on the emotion of a stretch
            if self._usual.track is None:
                usual, level = mood.category, mood.arousal.level
            else:
                self._usual.keep(now)
                usual, level = self._usual.probabilities, 0.0
            self.player.base_modifier = arouse(blend_modifiers(usual), level)
        for accent in _latest(detector.accents):
            strength = min(round(accent.strength, _DIGITS), 2.0)
            self._accents.setdefault(accent.time, HeardAccent(time=round(accent.time, _DIGITS), strength=strength))
        for phrase in _latest(detector.phrases):
            self._phrases[phrase.start] = phrase.end

    def finish(self, seconds: float) -> None:
        """The speech is over: a note says if the plan is of another one or has other words, and what of it was not played.

        Args:
            seconds: length of the speech.
        """
        known = self.player.plan()
        left = ", ".join(each.id for each in _split_at_end(known.gestures, seconds)[1])
        told = f"gestures after the end of the speech are left out: {left}" if left else ""
        other = describe_length(known.seconds, seconds) or self.words.describe_difference(seconds)
        told = "; ".join(part for part in (other, told) if part)
        if told:
            warnings.warn(told, CospeechWarning, stacklevel=2)

    def plan(self, seconds: float) -> Plan:
        """The plan as it was played so far; what is after the end of the speech is left out.

        Args:
            seconds: length of the speech.
        """
        phrases = [
            HeardPhrase(start=round(max(start, 0.0), _DIGITS), end=round(end, _DIGITS)) for start, end in self._phrases.items()
        ]
        played = self.player.plan()
        return played.model_copy(update={
            "style": played.style or next(iter(STYLES)), "gestures": tuple(_split_at_end(played.gestures, seconds)[0]),
            "seconds": round(seconds, _DIGITS), "words": words_of(self.words.heard), "phrases": tuple(phrases),
            "accents": tuple(self._accents.values()),
        })  # fmt: skip


def _check_style(where: str, asked: str, usual: Style) -> None:
    """Whether a stretch may have a style; ``where`` it stands is for the error."""
    try:
        found = find_style(asked)
    except InputError as error:
        raise InputError(f"{where}: {error.problem}", error.hint) from None
    if found.seated != usual.seated:
        raise InputError(f"{where}: {asked!r} sits where the plan stands, or stands", "another style")


def _split_at_end(gestures: Sequence[PlannedGesture], seconds: float) -> tuple[list[PlannedGesture], list[PlannedGesture]]:
    """Gestures that a plan of so long a speech may have, and those after its end."""
    within = [each for each in gestures if each.stroke <= seconds + AFTER_END]
    return within, [each for each in gestures if each.stroke > seconds + AFTER_END]


def _latest(events: Any) -> list[Any]:
    return list(islice(reversed(events), 64))[::-1]
