"""One session for hours: it speaks, is interrupted, listens and idles, and is steered while it runs; for every model.

A clock counts the seconds that were pushed, sound or none. Frame k is of the time k / fps on this clock. While somebody
speaks, a session of the model makes the frames, and each comes `LiveSession.latency` after its sound. In between, the rules
idle. Whenever one takes over from the other, a `PoseTransition` leads from pose to pose. As long as nothing is steered, the
frames are those of the model's own session, bit for bit.

One thread pushes sound and takes the frames. Any thread may steer or interrupt: a call waits until the one before is done.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from fractions import Fraction
from math import floor, isfinite
from numbers import Real
from threading import RLock
from typing import Any, Protocol

import numpy as np

from ..audio.features.mel import RATE
from ..audio.speech import Speech, count_frames
from ..audio.speech_chunks import PieceTimes
from ..errors import InputError
from ..motion.motion import Motion
from ..motion.rotations import Array, quat_continuous
from ..rules.options import GenerationOptions
from ..rules.session import Session
from ..rules.streaming import check_speech, in_short
from .idle import LONGEST, IdleSource, find_seated_style
from .live_listener import LiveListener
from .one_at_a_time import one_at_a_time
from .part_fades import PartFades
from .pose_transition import PoseTransition
from .session import TrainedSession

__all__ = ["LiveSession"]

_QUIET = 0.004  # peak of a piece that counts as silence: −48 dB of full scale [ours: speech peaks above −30 dB]
_BEFORE = Fraction(1, 2)  # s of quiet sound that an utterance begins with: soft onsets, and time to raise the hands [ours]
_MEMORY = 30.0  # s of frames that were given and can be taken back [ours: longer than a sentence that is pushed at once]
_GRID = 192_000  # [ours] seconds are told apart as finely as samples at the highest rate: 1/60 is a sixtieth


class LiveModel(Protocol):
    """What a live session needs of a model."""

    @property
    def makes(self) -> tuple[str, ...]: ...

    def session(self, options: GenerationOptions | None = None, /) -> Session | TrainedSession: ...


class LiveSession:
    """Speech in, frames out, for hours.

    Args:
        model: what speaks.
        options: of `GenerationOptions`; one take. An emotion that is a track begins anew with every utterance.
        idle_after: seconds of silent sound after which the rules idle in the place of the model; None: the model plays
            silence, too.
        angle: of the person who speaks to the character, see `LiveListener`.

    Raises:
        InputError: an option is out of range or a name unknown.
    """

    def __init__(self, model: Any, options: GenerationOptions, *, idle_after: float | None = None, angle: float = 0.0) -> None:
        if options.takes != 1:
            raise InputError(f"{options.takes} takes in a live session", "open one session for each")
        self.lock = RLock()  # of `one_at_a_time`
        self._model: LiveModel = model
        self._options = options
        self._next_session: Session | TrainedSession | None = model.session(options)  # the session of the next utterance
        self.latency: float = self._next_session.latency
        """Seconds of sound at 16 kHz after a frame's time that must have been pushed, at most, until the frame is given."""
        self.look_ahead: float = self._next_session.look_ahead
        """Seconds of sound after a frame's time on which the frame depends, at most."""
        if idle_after is not None and not (isinstance(idle_after, Real) and idle_after >= self.latency):
            raise InputError(f"idle_after is {idle_after!r:.40}", f"seconds, the latency of {self.latency:g} s or more")
        self._idle_after = idle_after
        self._last_session: Session | TrainedSession = self._next_session  # spoke last; has emotion and arousal
        self._speaking: Session | TrainedSession | None = None
        self._utterances, self._origin, self._skip = 0, 0, Fraction(0)
        """Number of utterances; the first frame of this one; seconds until that frame, which are not heard."""
        self._idle: IdleSource | None = None
        self._waits, self._before = False, deque[Speech]()  # for sound that is not silent; the silence until then
        self._has_sound = False  # whether this utterance has sound
        self._times = PieceTimes()  # on the clock
        self._time = self._quiet = Fraction(0)
        self._frames = self._out = 0  # frames made, and given
        self._ready, self._past = deque[Motion](), deque[Motion]()
        self._source: object = None  # of the frame that was made last
        self._last: Motion | None = None  # one or two frames
        self._transition: PoseTransition | None = None
        self._is_steered = False
        self.listener = LiveListener.of(options, angle, lambda: self.speaks)
        """Hears the person who speaks to the character: ``session.listener.hear(samples, 16000)``, from any thread."""
        self._fades = PartFades(tuple(part for part in options.parts if part in model.makes), options.fps)

    @property
    def time(self) -> float:
        """Seconds on the clock: all that was pushed. The next sound is at this time."""
        return float(self._time)

    @property
    def speaks(self) -> bool:
        """Whether there is sound, or its last frame was given half a second ago or less: viewers hear it until then."""
        return self._speaking is not None and float(self._quiet) <= self.latency + float(_BEFORE)

    @property
    def emotion(self) -> dict[str, float]:
        """Probability of each emotion, over the last utterance."""
        return self._last_session.emotion

    @property
    def arousal(self) -> float | None:
        """Mean arousal of the voice, over the last utterance, −1 … 1; None where an emotion is given."""
        return self._last_session.arousal

    @one_at_a_time
    def push(self, sound: Speech | Array, rate: int | None = None) -> Iterator[Motion]:
        """Hear what is said next, at once.

        Args:
            sound: a `Speech`, whose words count as its ``start`` does; or (n,) samples: floats in −1 … 1, or 16-bit integers.
            rate: samples per second of an array.

        Returns:
            The frames that are certain now. Those that are not taken come first with the next call.

        Raises:
            InputError: no sound, no rate, or another rate within an utterance; it was not heard.
        """
        speech = sound
        if not isinstance(speech, Speech):
            if rate is None:
                raise InputError("samples without a rate", "session.push(samples, 24000)")
            speech = Speech(np.asarray(sound), rate, start=float(self._time))
        check_speech(speech)
        for piece in in_short(self._times.count(speech, float(self._time))):
            self._hear(piece)
        return self._next_frames()

    @one_at_a_time
    def idle(self, seconds: float) -> Iterator[Motion]:
        """Push no sound for so long: an utterance ends, and the character listens and idles.

        Returns:
            All frames up to the end of these seconds: as nothing is to be heard, nothing is waited for.

        Raises:
            InputError: no number of seconds from 0 to 60.
        """
        if not isinstance(seconds, Real) or not (isfinite(seconds) and 0 <= seconds <= LONGEST):
            raise InputError(f"idle for {seconds!r:.40} seconds", f"0 … {LONGEST:g} at once")
        self._end_utterance()
        self._time += Fraction(float(seconds)).limit_denominator(_GRID)
        self._fill(count_frames(self._time, self._options.fps))
        return self._next_frames()

    @one_at_a_time
    def finish(self) -> Iterator[Motion]:
        """The speech is over.

        Returns:
            The rest of the frames, to exactly ceil(time × fps) in all. More may be pushed: it is a new utterance.

        Raises:
            InputError: nothing was pushed at all.
        """
        if not self._time:
            raise InputError("there is no speech", "push at least one sample before finish()")
        return self.idle(0)

    @one_at_a_time
    def interrupt(self, *, at: float | None = None) -> None:
        """Stop speaking: frames that were not given are dropped, the mouth shuts, and the hands come down.

        The next sound that is not silent begins a new utterance.

        Args:
            at: if you push ahead of what is shown: the time of the first frame that is not shown yet. The frames from
                there on are void, and the clock goes back to this time: what comes next belongs there. Without it, the
                first frame that changes is the first that was not given, and the clock stays.

        Raises:
            InputError: a time after the last frame that was given, or more than 30 s before it.
        """
        first = self._out if at is None else self._frame_at(at)
        self._ready, self._before = deque[Motion](), deque[Speech]()
        self._speaking, self._waits, self._source, self._transition = None, True, None, None
        while self._past and (start := self._start_of(self._past[-1])) + len(self._past[-1]) > first:
            piece = self._past.pop()
            if start < first:
                self._past.append(piece[: first - start])
        self._frames = self._out = first
        self._fades.go_back(first)
        self._last = Motion.concatenate(list(self._past)[-2:])[-2:] if self._past else None
        if at is not None:
            self._time = Fraction(first) / Fraction(self._options.fps).limit_denominator(_GRID)
            self.listener.go_back(first / self._options.fps)

    def warm_up(self) -> None:
        """Do in advance what is slow the first time, so that no push is slow: two seconds are played to another session."""
        times = np.arange(round(0.02 * RATE)) / RATE
        session = LiveSession(self._model, self._options)
        for k in range(125):
            hum = np.sin(2 * np.pi * 140 * (times + k * 0.02)) * np.sin(np.pi * 4 * k * 0.02) ** 2
            list(session.push(Speech((0.3 * hum).astype(np.float32), RATE)))
        session.interrupt()
        list(session.idle(0.5))
        self._idle = self._idle or self._open_idle()

    @one_at_a_time
    def restyle(self, style: object) -> None:
        """Another style, faded in over half a second.

        Raises:
            InputError: a style that cannot be used; the old one goes on.
        """
        self._steer("restyle", style=style)

    @one_at_a_time
    def set_emotion(self, emotion: str) -> None:
        """Another emotion, or "auto", faded in over half a second.

        Raises:
            InputError: there is no such emotion.
        """
        self._steer("set_emotion", emotion=emotion)

    @one_at_a_time
    def set_intensity(self, intensity: float) -> None:
        """Another size of all movement, 0 … 2, faded in over half a second.

        Raises:
            InputError: it is no number, or out of range.
        """
        self._steer("set_intensity", intensity=intensity)
        self.listener.set_intensity(intensity)

    @one_at_a_time
    def set_parts(self, parts: Iterable[str]) -> None:
        """The parts that move from the next frame on, of those that the session was opened with.

        The others come to their neutral pose within half a second, and weights of a face to 0.

        Raises:
            InputError: one that there is not, or that the session was not opened with.
        """
        self._fades.set_parts(parts)

    def _steer(self, control: str, **change: Any) -> None:
        """Change an option for the utterance under way, and for those to come."""
        options = replace(self._options, **change)
        if self._speaking is not None:
            getattr(self._speaking, control)(*change.values())
        else:
            self._next_session = self._last_session = self._open(options)
        self._options = options
        if control == "restyle":
            self._idle = None if isinstance(self._last_session, Session) else self._idle  # the next one idles in this style
        elif self._idle is not None:
            getattr(self._idle.session, control)(*change.values())

    def _hear(self, piece: Speech) -> None:
        silent = not len(piece) or float(np.abs(piece.samples).max()) < _QUIET
        self._quiet = self._quiet + piece.duration if silent else Fraction(0)
        began, self._time = self._time, self._time + piece.duration
        if self._speaking is None and silent and (self._waits or not len(piece)):  # an empty piece begins nothing
            self._before.append(replace(piece, samples=piece.samples.copy()))  # the caller may fill its buffer again
            while sum(each.duration for each in self._before) - self._before[0].duration >= _BEFORE:
                self._before.popleft()
            self._fill(self._due())
            return
        if self._speaking is None:
            self._begin_utterance(began)
        self._feed(piece)
        self._fill(min(self._due(), self._origin))
        if self._idle_after is not None and self._quiet >= self._idle_after:
            self._speaking, self._waits = None, True

    def _begin_utterance(self, now: Fraction) -> None:
        """A session for what comes from ``now`` seconds on, and for the silence just before."""
        self._speaking = self._last_session = self._next_session or self._open(self._options)
        self._next_session, self._utterances, self._has_sound = None, self._utterances + 1, False
        before, self._before = list(self._before), deque()
        first = now - sum((piece.duration for piece in before), Fraction(0))
        self._origin = max(count_frames(first, self._options.fps), self._frames)
        self._skip = Fraction(self._origin) / Fraction(self._options.fps).limit_denominator(_GRID) - first
        for piece in before:
            self._feed(piece)

    def _open(self, options: GenerationOptions) -> Session | TrainedSession:
        return self._model.session(replace(options, seed=options.seed + self._utterances))

    def _feed(self, piece: Speech) -> None:
        """Push into the session of the utterance what lies after its first frame."""
        assert self._speaking is not None
        if self._skip > 0:
            cut = min(round(self._skip * piece.rate), len(piece))
            self._skip -= Fraction(cut, piece.rate)
            if cut == len(piece):
                return
            self._skip = Fraction(0)
            piece = piece.window(piece.start + cut / piece.rate, np.inf) if cut else piece
        self._has_sound = self._has_sound or len(piece) > 0
        self._take(self._speaking.push(piece))

    def _take(self, motions: Iterable[Motion]) -> None:
        """Frames of the utterance, after those until it begins."""
        for motion in motions:
            self._fill(self._origin)
            self._queue(motion, self._speaking)

    def _end_utterance(self) -> None:
        if self._speaking is not None and self._has_sound:
            self._take(self._speaking.finish())
        self._speaking, self._waits = None, True
        self._before.clear()

    def _due(self) -> int:
        """Frames whose time lies a latency before the clock."""
        return max(floor((float(self._time) - self.latency) * self._options.fps + 1e-6) + 1, 0)

    def _fill(self, end: int) -> None:
        """Idle up to this frame."""
        if end <= self._frames:
            return
        self._idle = self._idle or self._open_idle()
        if self._source is not self._idle and self._last is not None:  # two frames before tell how fast it moves
            before = self._idle.take(2)
            self._transition = PoseTransition(self._last, before)
        self._is_steered, self._source = True, self._idle
        self._queue(self._idle.take(end - self._frames), self._idle)

    def _open_idle(self) -> IdleSource:
        style = self._options.style if isinstance(self._last_session, Session) else None
        if style is None and self._last is not None:
            style = find_seated_style(self._last)
        parts = tuple(part for part in self._options.parts if part in self._model.makes)
        idle = replace(self._options, style=style, parts=parts)
        return IdleSource(replace(idle, face=None, continue_from=None, look_ahead=None, stance=False))

    def _queue(self, motion: Motion, source: object) -> None:
        """The next frames, of a session or of the idle source."""
        if source is not self._source and self._last is not None:
            self._transition, self._is_steered = PoseTransition(self._last, motion[:1]), True
        self._source = source
        if self._is_steered:
            motion = self._lead_over(motion)
        self._frames += len(motion)
        self._ready.append(motion)
        tail = motion[-2:]
        self._last = tail if len(tail) > 1 or self._last is None else Motion.concatenate([self._last[-1:], tail])

    def _lead_over(self, motion: Motion) -> Motion:
        """The same frames at their places on the clock, led over from what was shown before."""
        motion = replace(motion, start=self._frames / self._options.fps)
        if self._transition is not None:
            motion = self._transition.apply(motion)
            if self._transition.is_over(motion.fps):
                self._transition = None
        if self._last is not None:
            signs = quat_continuous(np.concatenate([self._last.rotations[-1:], motion.rotations]))[1:]
            motion = replace(motion, rotations=signs)
        return motion

    def _next_frames(self) -> Iterator[Motion]:
        """The pieces that are ready; each leaves the queue before it is yielded."""
        while (motion := self._take_next()) is not None:
            yield motion

    @one_at_a_time
    def _take_next(self) -> Motion | None:
        if not self._ready:
            return None
        motion = self._ready.popleft()
        self._out += len(motion)
        self._past.append(motion)
        while len(self._past) > 1 and self._start_of(self._past[1]) < self._out - _MEMORY * motion.fps:
            self._past.popleft()
        return self._fades.apply(self.listener.apply(motion))

    def _start_of(self, motion: Motion) -> int:
        return round(motion.start * motion.fps)

    def _frame_at(self, at: float) -> int:
        """The first frame that is not before this time."""
        first = self._start_of(self._past[0]) if self._past else 0
        oldest = first + 1 if first else 0  # one frame has to be left of those before, unless there were none
        if not isinstance(at, Real) or not isfinite(at) or not oldest <= (k := round(at * self._options.fps)) <= self._out:
            fps = self._options.fps
            hint = f"the frames that can be taken back are those of {oldest / fps:.2f} … {self._out / fps:.2f} s"
            raise InputError(f"interrupted at {at!r:.40}", hint)
        return k
