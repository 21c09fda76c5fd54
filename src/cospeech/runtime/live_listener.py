"""A live character that listens: it hears who speaks to it, and nods where that person pauses or lowers the voice."""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock

import numpy as np

from ..audio.backchannel_cues import BackchannelCue, CueDetector
from ..audio.features.at_16_khz import At16kHz
from ..audio.speech import Speech
from ..errors import InputError
from ..motion.motion import Motion
from ..motion.rotations import Array
from ..rules.options import INTENSITY_RANGE, GenerationOptions, check_range
from .attention import AttentionShift
from .listening import ListeningLayer, ResponsePlanner

__all__ = ["LiveListener"]

_ECHO = 0.3  # s after own speech in which its echo may be heard [ours: a large room]
_TALKS = 1.2  # s of silence in which somebody still has the turn, as in `cospeech.runtime.listening`
_ABSENT = 3.0  # s of frames without any piece of sound, silent or not, after which nobody is there [ours: longer than pieces]
_LATE = 2.0  # s after a cue in which it can be answered [ours: .7 s until it is known, and pieces of a second]


class LiveListener:
    """Hears a person, and shows that in frames of a live session.

    One thread may hear, and another one may take frames.

    >>> listener = LiveListener(seed=1)
    >>> listener.hear(np.zeros(16_000, np.float32), 16_000)

    Args:
        seed: another one, other responses.
        intensity: size of what is shown, 0 … 2.
        angle: degrees to the character's left at which the person is.
        turns_head: whether the body is one of the parts that move.
        speaks: tells whether the character itself is speaking: then it answers nothing (`LiveSession.speaks`).

    Raises:
        InputError: intensity or angle are out of range.
    """

    def __init__(
        self,
        *,
        seed: int = 0,
        intensity: float = 1.0,
        angle: float = 0.0,
        turns_head: bool = True,
        speaks: Callable[[], bool] = lambda: False,
    ) -> None:
        check_range("intensity", intensity, INTENSITY_RANGE)
        self._layer = ListeningLayer(
            [], [], seed=seed, intensity=intensity, shifts=[AttentionShift(0.0, angle)], turns_head=turns_head
        )
        self._planner, self._detector, self._sound = ResponsePlanner(seed), CueDetector(), At16kHz()
        self._lock = Lock()
        self._end = 0.0  # s: end of the frames that were given
        self._last_sound = 0.0  # the same, when something was heard last
        self._speaks, self._listens = speaks, False
        self._own = -np.inf  # s: until then the character spoke; what is heard may be its own voice
        self._has_sound = angle != 0.0  # without sound of anybody, frames stay as they are, bit for bit

    @classmethod
    def of(cls, options: GenerationOptions, angle: float, speaks: Callable[[], bool]) -> LiveListener:
        """The listener of a session with these options."""
        turns_head = "body" in options.parts
        return cls(seed=options.seed, intensity=options.intensity, angle=angle, turns_head=turns_head, speaks=speaks)

    def hear(self, sound: Speech | Array, rate: int | None = None) -> None:
        """Hear what the person says next, as it comes, silence too.

        Args:
            sound: a `Speech`, or (n,) samples: floats in −1 … 1, or 16-bit integers.
            rate: samples per second of an array.

        Raises:
            InputError: no rate, or another one than before.
        """
        if not isinstance(sound, Speech):
            if rate is None:
                raise InputError("samples without a rate", "listener.hear(samples, 16000)")
            sound = Speech(np.asarray(sound), rate)
        cues = self._detector.push(self._sound.push(sound))
        self._detector.forget()
        self._has_sound = True
        with self._lock:
            now, self._last_sound = float(self._sound.duration), self._end
            if self._speaks():
                self._own = now
            for cue in cues:
                if cue.time > max(self._own + _ECHO, now - _LATE):
                    self._answer(cue._replace(time=self._end + cue.time - now))
            last = self._detector.phrases[-1].end if self._detector.phrases else -np.inf
            self._note_turn(last > self._own + _ECHO and now - last < _TALKS)

    def _answer(self, cue: BackchannelCue) -> None:
        """Answer a cue, on the clock of the frames; the response begins at the next frame that is made, at the earliest."""
        response = self._planner.answer(cue, earliest=self._end)
        if response is not None:
            self._layer.add(response)

    def set_intensity(self, intensity: float) -> None:
        """Another size of what is shown, 0 … 2, faded in over half a second.

        Raises:
            InputError: it is no number, or out of range.
        """
        check_range("intensity", intensity, INTENSITY_RANGE)
        with self._lock:
            self._layer.set_intensity(intensity, self._end)

    def go_back(self, time: float) -> None:
        """Drop the frames from this moment on, in seconds, and what was to be shown in them."""
        with self._lock:
            if time < self._end:
                self._end = self._last_sound = time
                self._layer.go_back(time)
                self._planner.go_back(time)
                if self._listens:
                    self._layer.begin(time)

    def apply(self, motion: Motion) -> Motion:
        """The next frames of a live session, with what is shown of listening."""
        with self._lock:
            self._end = motion.start + motion.duration
            if not self._has_sound:
                return motion
            if self._listens and self._end > self._last_sound + _ABSENT:
                self._listens = False
                self._layer.end(max(self._last_sound + _ABSENT, motion.start))
            self._layer.forget(motion.start)
            return self._layer.apply(motion)

    def _note_turn(self, listens: bool) -> None:
        if listens != self._listens:
            self._listens = listens
            (self._layer.begin if listens else self._layer.end)(self._end)
