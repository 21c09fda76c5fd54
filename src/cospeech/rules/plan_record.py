"""A plan while it is played: its player, and notes for the plan that is written."""

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
        InputError: a stretch has an unknown style, or one that sits where the other stands.
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
        """The settings that begin up to this time in seconds, and were not returned before."""
        due = []
        while self._settings and self._settings[0].time <= now + 1e-9:
            due.append(self._settings.popleft())
        return due

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
        """End the speech. A note says if the plan is of another speech or has other words, and which gestures were not played.

        Args:
            seconds: length of the speech.
        """
        plan = self.player.plan()
        late = ", ".join(each.id for each in _split_at_end(plan.gestures, seconds)[1])
        note = f"gestures after the end of the speech are left out: {late}" if late else ""
        other = describe_length(plan.seconds, seconds) or self.words.describe_difference(seconds)
        note = "; ".join(part for part in (other, note) if part)
        if note:
            warnings.warn(note, CospeechWarning, stacklevel=2)

    def plan(self, seconds: float) -> Plan:
        """The plan as it was played so far; what is after the end of the speech is left out.

        Args:
            seconds: length of the speech.
        """
        phrases = [
            HeardPhrase(start=round(max(start, 0.0), _DIGITS), end=round(end, _DIGITS)) for start, end in self._phrases.items()
        ]
        plan = self.player.plan()
        return plan.model_copy(update={
            "style": plan.style or next(iter(STYLES)), "gestures": tuple(_split_at_end(plan.gestures, seconds)[0]),
            "seconds": round(seconds, _DIGITS), "words": words_of(self.words.heard), "phrases": tuple(phrases),
            "accents": tuple(self._accents.values()),
        })  # fmt: skip


def _check_style(where: str, name: str, usual: Style) -> None:
    """Check that a stretch may have a style; ``where`` is its place, for the error."""
    try:
        style = find_style(name)
    except InputError as error:
        raise InputError(f"{where}: {error.problem}", error.hint) from None
    if style.seated != usual.seated:
        raise InputError(f"{where}: {name!r} sits where the plan stands, or stands", "another style")


def _split_at_end(gestures: Sequence[PlannedGesture], seconds: float) -> tuple[list[PlannedGesture], list[PlannedGesture]]:
    """Gestures that a plan of so long a speech may have, and those after its end."""
    within = [each for each in gestures if each.stroke <= seconds + AFTER_END]
    return within, [each for each in gestures if each.stroke > seconds + AFTER_END]


def _latest(events: Any) -> list[Any]:
    return list(islice(reversed(events), 64))[::-1]
