"""A trained model with values of their own for stretches of the speech: style, emotion, intensity, seed."""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction

import numpy as np

from ..audio.speech import Speech
from ..audio.speech_chunks import PieceTimes
from ..errors import CospeechWarning, InputError
from ..motion.motion import Motion
from ..motion.rotations import Array
from ..rules.foresight import DECISION
from ..rules.options import GenerationOptions
from ..rules.plan_edits import Plan, Setting
from ..rules.plan_model import words_of
from ..rules.planned_words import PlannedWords
from ..rules.streaming import check_speech
from .motion_switch import MotionSwitch
from .session import TrainedSession

__all__ = ["StretchedSession"]


class StretchedSession:
    """As `TrainedSession`, for one take; its values change at the borders of the stretches of a plan.

    Style, emotion and intensity fade in the session itself. For each seed there is a session that hears the whole speech; where
    another seed begins, its motion takes over without a jump.

    Args:
        start: opens a session with these options.
        options: with the plan.

    Raises:
        InputError: a plan with gestures, which trained models do not plan; or an option is wrong.
    """

    def __init__(self, start: Callable[[GenerationOptions], TrainedSession], options: GenerationOptions) -> None:
        plan: Plan = options.plan
        if plan.gestures or plan.gaze:
            what = "gestures[0]" if plan.gestures else "gaze[0]"
            raise InputError(
                f"{what}: a trained model plays no listed gestures", "only `rules` does; stretches are for all models"
            )
        settings = plan.settings()
        changes = [(each.time, each, False) for each in settings] + [(each.time + DECISION, each, True) for each in settings]
        self._plan, self._settings = plan, deque(sorted(changes, key=lambda change: change[0]))
        self._holds = self._faces_hold = Setting(0.0, plan.style, plan.emotion, plan.intensity, plan.seed)
        seeds = dict.fromkeys([plan.seed, *(each.seed for each in settings)])
        own = replace(options, plan=None)
        self._sessions = {seed: start(replace(own, seed=seed)) for seed in seeds}
        self._first = self._sessions[plan.seed]
        self._courses = [(-np.inf, 0), *((each.time, list(seeds).index(each.seed)) for each in settings)]
        styles = [each.style for each in plan.stretches]
        for k, style in enumerate(styles):
            if style in (None, plan.style, *styles[:k]):
                continue
            try:
                start(replace(own, style=style))  # an error comes now, and not in the middle of the speech
            except InputError as error:
                where = f"stretches[{k}].style, {plan.stretches[k].start:g} to {plan.stretches[k].end:g} s"
                raise InputError(f"{where}: {error.problem}", error.hint) from None
        self._waiting: list[list[Motion]] = [[] for _ in seeds]
        self._switch, self._time, self._fps = MotionSwitch(), Fraction(0), options.fps
        self._words, self._times = PlannedWords(plan.speech_words), PieceTimes()

    emotion = property(lambda self: self._first.emotion, doc="See `TrainedSession.emotion`.")
    expression = property(lambda self: self._first.expression, doc="See `TrainedSession.expression`.")
    arousal = property(lambda self: self._first.arousal, doc="See `TrainedSession.arousal`.")
    speaker = property(lambda self: self._first.speaker, doc="See `TrainedSession.speaker`.")
    style_mixture = property(lambda self: self._first.style_mixture, doc="See `TrainedSession.style_mixture`.")
    latency = property(lambda self: self._first.latency, doc="See `TrainedSession.latency`.")
    look_ahead = property(lambda self: self._first.look_ahead, doc="See `TrainedSession.look_ahead`.")

    @property
    def plan(self) -> Plan:
        """The plan, with the length and the words of the speech."""
        return self._plan.model_copy(update={"seconds": round(float(self._time), 4), "words": words_of(self._words.heard)})

    def restyle(self, style: object) -> None:
        """See `TrainedSession.restyle`."""
        for session in self._sessions.values():
            session.restyle(style)

    def set_emotion(self, emotion: object) -> None:
        """See `TrainedSession.set_emotion`."""
        for session in self._sessions.values():
            session.set_emotion(emotion)  # type: ignore[arg-type]

    def set_intensity(self, intensity: float) -> None:
        """See `TrainedSession.set_intensity`."""
        for session in self._sessions.values():
            session.set_intensity(intensity)

    def push(self, chunk: Speech) -> Iterator[Motion]:
        """See `TrainedSession.push`."""
        return (takes[0] for takes in self.push_takes(chunk))

    def finish(self) -> Iterator[Motion]:
        """See `TrainedSession.finish`."""
        return (takes[0] for takes in self.finish_takes())

    def push_takes(self, chunk: Speech) -> Iterator[list[Motion]]:
        """See `TrainedSession.push_takes`."""
        check_speech(chunk)
        end = self._time + chunk.duration
        chunk = self._times.count(chunk, float(self._time))
        words = self._words.hear(chunk.words, float(end))
        chunk = chunk if words is chunk.words else replace(chunk, words=tuple(words or ()))
        while self._settings and self._settings[0][0] < end:
            border = round((max(Fraction(self._settings[0][0]) - self._time, Fraction(0))) * chunk.rate)
            if 0 < border < len(chunk):
                before = chunk.window(chunk.start, chunk.start + border / chunk.rate)
                words = None if chunk.words is None else tuple(w for w in chunk.words if w not in (before.words or ()))
                rest = chunk.window(chunk.start + border / chunk.rate, np.inf)
                chunk = replace(rest, words=words) if rest.words != words else rest
                self._feed(before)
            elif border >= len(chunk):
                break
            _, new, faces = self._settings.popleft()
            (self._change_faces if faces else self._change)(new)
        self._feed(chunk)
        return self._give()

    def finish_takes(self) -> Iterator[list[Motion]]:
        """See `TrainedSession.finish_takes`."""
        for _, new, faces in self._settings:
            if faces:
                self._change_faces(new)
        self._settings.clear()
        if different := self._words.describe_difference(float(self._time)):
            warnings.warn(different, CospeechWarning, stacklevel=2)
        for waiting, session in zip(self._waiting, self._sessions.values(), strict=True):
            waiting += session.finish()
        return self._give()

    def _feed(self, chunk: Speech) -> None:
        self._time += chunk.duration
        for waiting, session in zip(self._waiting, self._sessions.values(), strict=True):
            waiting += session.push(chunk)

    def _change(self, new: Setting) -> None:
        if new.style != self._holds.style:
            self.restyle(new.style)
        for session in self._sessions.values():
            if new.feels != self._holds.feels:
                session.set_emotion(new.moods, faces=False)
            if new.intensity != self._holds.intensity:
                session.set_intensity(new.intensity, faces=False)
        self._holds = new

    def _change_faces(self, new: Setting) -> None:
        """What faces show: they are made later than bodies, see `TrainedSession.set_emotion`."""
        emotion = new.moods if new.feels != self._faces_hold.feels else None
        intensity = new.intensity if new.intensity != self._faces_hold.intensity else None
        for session in self._sessions.values():
            session.change_faces(emotion=emotion, intensity=intensity)
        self._faces_hold = new

    def _give(self) -> Iterator[list[Motion]]:
        """The frames that all sessions have made."""
        if not all(self._waiting):
            return iter(())
        whole = [Motion.concatenate(waiting) for waiting in self._waiting]
        count = min(map(len, whole))
        self._waiting = [[motion[count:]] if count < len(motion) else [] for motion in whole]
        ready = [motion[:count] for motion in whole]
        return iter([[self._switch.push(ready, self._active(ready[0]))]])

    def _active(self, motion: Motion) -> Array:
        starts = np.array([start for start, _ in self._courses])
        indices = np.searchsorted(starts, motion.times + 1e-9, side="right") - 1
        return np.array([self._courses[k][1] for k in indices])
