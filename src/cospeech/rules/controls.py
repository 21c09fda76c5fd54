"""The controls of a session of the rules while it runs: style, size, emotion."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..audio.emotions import Moods, emotion_track
from ..errors import InputError
from ..motion.rotations import Array
from .emotion_modifiers import EmotionModifier
from .foresight import Foresight
from .manner import Manner, MannerCourse, make_manner
from .mood import Mood
from .options import INTENSITY_RANGE, check_range
from .plan import Planner
from .styles import Style, find_style

if TYPE_CHECKING:
    from .plan_record import PlanRecord

__all__ = ["SessionControls"]


class SessionControls:
    """The controls of `cospeech.rules.Session`, which has all that they change."""

    seed: int
    gains: Array | None
    foresight: Foresight
    mood: Mood
    planner: Planner
    manners: MannerCourse
    modifier: EmotionModifier
    _ticks: int
    _record: PlanRecord | None
    _feels: object
    """The emotion of the plan that holds now; None without a plan."""

    @property
    def planned_until(self) -> float:
        """Seconds up to which movement is planned."""
        return self._ticks * self.foresight.tick

    def restyle(self, style: object) -> None:
        """Set another style for all frames that are not made yet; it fades in over half a second.

        Raises:
            InputError: there is no such style, or it sits and the old one stands, or the reverse; the old one goes on.
        """
        new = find_style(style)
        if new.seated != self.manners.last.style.seated:
            problem = "a style that sits for a session that stands" if new.seated else "a style that stands for one that sits"
            raise InputError(problem, "open a new session with it")
        self._make(self.planned_until)
        self._perform(new, self.manners.last.intensity)

    def set_intensity(self, intensity: float) -> None:
        """Set another size of all movement, 0 … 2, for what is not planned yet.

        Raises:
            InputError: it is no number, or out of range.
        """
        check_range("intensity", intensity, INTENSITY_RANGE)
        self._make(self.planned_until)
        self._perform(self.manners.last.style, float(intensity))

    def set_emotion(self, emotion: str | Moods) -> None:
        """Set another emotion, or "auto", for all frames that are not made yet; it fades in over half a second.

        Args:
            emotion: as the option of `RuleBasedModel.generate`; times of a track count from the beginning of the session.

        Raises:
            InputError: there is no such emotion.
        """
        track = emotion_track(emotion)
        self._make(self.planned_until)
        self.mood.change(track, self.planned_until)

    if TYPE_CHECKING:

        def _make(self, until: float, total: int | None = None) -> None: ...

    def _perform(self, style: Style, intensity: float, seed: int | None = None) -> None:
        now, last = self.planned_until, self.manners.last
        if (style, intensity) != (last.style, last.intensity):
            self.planner.restyle(now, style, intensity, self.modifier)
        self.manners.change(self._make_manner(style, intensity, last.seed if seed is None else seed), now)

    def _make_manner(self, style: Style, intensity: float, seed: int) -> Manner:
        return make_manner(style, intensity, seed=seed, gains=self.gains, delays=self.foresight.face)

    def _follow_plan(self) -> None:
        """Take over the values that the plan sets from now on."""
        for new in [] if self._record is None else self._record.settings_until(self.planned_until):
            style, last = find_style(new.style), self.manners.last
            if (style, new.intensity, new.seed) != (last.style, last.intensity, last.seed):
                self._perform(style, new.intensity, new.seed)
            if new.feels != self._feels:
                self.set_emotion(new.moods)
            self._feels = new.feels
