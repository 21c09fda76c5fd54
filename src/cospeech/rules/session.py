"""One performance: speech in, piece by piece; motion out, a bounded time later."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np

from ..audio.emotions import EMOTIONS, Moods
from ..audio.event_detection import EventDetector
from ..audio.features.at_16_khz import At16kHz, HeldSamples
from ..audio.features.mel import RATE as SAMPLE_RATE
from ..audio.features.shared_prosody import SharedProsody
from ..audio.speech import Speech, Word, count_frames
from ..audio.speech_chunks import MOST_AT_ONCE, PieceTimes
from ..audio.voice_emotion import LOOKS
from ..errors import InputError
from ..face.composition import Face
from ..face.gaze import direction_of, eye_angles, look, toward
from ..face.mouth import Mouth, Sharing
from ..motion.motion import Motion
from ..motion.part_joints import eye_joints, select_parts
from ..motion.rotations import Array, QuatStream, quat_identity
from ..motion.skeleton import humanoid
from .arousal import arouse
from .controls import SessionControls
from .emotion_modifiers import MANNERS, blend_modifiers
from .foresight import AROUSAL_DELAY, USUAL, Foresight
from .gesture import Gesture
from .manner import Manner, MannerCourse, mix_frames
from .mood import Mood
from .plan import Planner
from .realise import Pieces, gaze_only, realise
from .streaming import check_speech
from .styles import Style

if TYPE_CHECKING:
    from .plan_edits import Plan

__all__ = ["KEPT", "Session"]

KEPT = 300.0  # seconds for which planned strokes are kept; ours: an annotator of a stream reads them more often
_AT_ONCE = 4 * SAMPLE_RATE  # samples that are heard before the next decision, at most (ours)


class Session(SessionControls):
    """A performance under way.

    Args:
        style: the speaker.
        emotion: the emotions over time, or None to follow the voice.
        seed: of this take.
        intensity, temperature: see `RuleBasedModel.generate`.
        fps: of the motion.
        parts: of ``("face", "body", "hands")``, what is generated; the rest stays in its neutral pose. Of none: the
            session listens to the mood alone.
        mouth: makes the mouth of the face; rules make it where there is none.
        gains: (52,) factors of the face's channels; all 1 where not given.
        aimed: whether the eyes are turned against the head. Else they stand as planned in the world, and the face waits for
            `aim`, because another system turns the head. Such a session of the face alone plans no gestures.
        foresight: how much of the coming speech it hears.
        plan: what is performed; it has its own seed, and words for pieces of speech that have none.
    """

    def __init__(
        self,
        style: Style,
        *,
        emotion: Moods | None,
        seed: int,
        intensity: float,
        temperature: float,
        fps: float,
        parts: tuple[str, ...],
        mouth: Mouth | None = None,
        gains: Array | None = None,
        aimed: bool = True,
        foresight: Foresight = USUAL,
        plan: Plan | None = None,
    ) -> None:
        self.seed, self.fps, self.parts, self.gains, self.foresight = seed, fps, parts, gains, foresight
        self.manners = MannerCourse(self._make_manner(style, intensity, seed))
        self.mood = Mood(emotion)
        self.detector = EventDetector(
            self.mood.voice.push, tick=foresight.tick, level_delay=foresight.level_delay, peak_delay=foresight.peak_delay
        )  # fmt: skip
        self._look = round(LOOKS / foresight.tick)  # ticks
        size: Any = {"intensity": intensity, "temperature": temperature}
        self._record, self._feels = None, None
        if plan is not None:  # plans are pydantic's, which takes 20 MB
            from .plan_record import PlanRecord

            self._record, self._feels = PlanRecord(plan, style, emotion, **size), plan.emotion
        self.planner = Planner(style, seed=seed, **size) if self._record is None else self._record.player
        self.planner.horizon, self.planner.late = foresight.horizon, foresight.late
        self.mouth, self._aimed = mouth, aimed
        self._eyes_only = parts == ("face",) and not aimed  # nobody asks for hands, trunk or head
        self.gestures: deque[Gesture] = deque()
        """Strokes in the order of planning: those to come, and those that ended in the last five minutes (`KEPT`)."""
        self._sound, self._short_pieces = At16kHz(), HeldSamples()
        self._times = PieceTimes()
        self._words: list[Word] = []
        self._ticks = 0
        self._frame = 0
        self._moods: deque[tuple[float, Array]] = deque()
        self._signs = QuatStream()
        self.modifier = MANNERS["neutral"]
        self._ready: deque[Motion] = deque()

    def share(self, prosody: SharedProsody) -> None:
        """Share the prosody with other listeners; call it before the first push."""
        self.detector.share(prosody)
        if isinstance(self.mouth, Sharing):
            self.mouth.share(prosody)

    @property
    def emotion(self) -> dict[str, float]:
        """Probability of each emotion over the speech so far; of a track, its mean."""
        return self.mood.guess

    @property
    def expression(self) -> dict[str, float]:
        """Mean weight of each emotion that was played: that of the track, else that of the voice where it was clear."""
        return self.mood.expression

    @property
    def arousal(self) -> float | None:
        """Mean arousal of the voice that was played, −1 … 1; None where an emotion is given."""
        return self.mood.arousal.mean if self.mood.listens else None

    def arousal_at(self, times: Array) -> Array:
        """(n,) arousal to play at ``times (n,)`` seconds, for a system that makes the body; 0 where an emotion is given.

        It is that of `AROUSAL_DELAY` before, so that it is known as soon as the speech of these times was pushed.
        """
        if not self.mood.listens:
            return np.zeros(len(times))
        return self.mood.arousal.at(times - AROUSAL_DELAY) * self.mood.voice_share(times)

    @property
    def speaker(self) -> None:
        """Rules do not tell speakers apart."""

    @property
    def style_mixture(self) -> None:
        """Styles of rules are numbers of their own, and no mixtures of speakers."""

    @property
    def latency(self) -> float:
        """Seconds of sound at 16 kHz after a frame's time that must have been pushed, at most, until the frame is given."""
        return self.foresight.latency

    @property
    def look_ahead(self) -> float:
        """Seconds of sound after a frame's time on which the frame depends, at most."""
        return self.foresight.look_ahead

    @property
    def plan(self) -> Plan:
        """The plan as it was performed, with all gestures so far; of a session that was opened with a plan.

        Raises:
            InputError: it was opened without one.
        """
        if self._record is None:
            raise InputError("a session without a plan", "open it with one: model.session(plan=cospeech.Plan())")
        return self._record.plan(float(self._sound.duration))

    def is_quiet(self, samples: int) -> bool:
        """Whether a push up to this many samples at 16 kHz, in all, would decide nothing and make no frames."""
        return samples < self.detector.needs and self._frame >= self._end(self.planned_until)

    def push(self, chunk: Speech) -> Iterator[Motion]:
        """Hear a piece, at once.

        Returns:
            The motion that has become certain, in pieces of some seconds. Pieces that are not taken are kept, and come
            first with the next call: every frame is given once, whether pieces are taken at once, later, or in part.

        Raises:
            InputError: no speech, or at another rate than before, or after `finish`; it was not heard.
        """
        check_speech(chunk)
        before = float(self._sound.duration)
        samples = self._sound.push(chunk)
        self._make(self.planned_until)  # the rest of the piece before; not if this one is refused
        words: Sequence[Word] | None = self._times.count(chunk, before).words
        if self._record is not None:
            words = self._record.words.hear(words, float(self._sound.duration))
        self._words.extend(words or ())
        if self._short_pieces.is_short(samples, self.detector.needs):
            return self._next_frames()
        samples = self._short_pieces.take(samples)
        for first in range(0, len(samples), _AT_ONCE):  # the listener forgets what is long past
            if not self.foresight.is_usual:
                self._follow(samples[first : first + _AT_ONCE])
                continue
            self._hear(samples[first : first + _AT_ONCE])
            self.detector.catch_up()
            self._decide_what_is_certain()
            if self.planned_until - self._frame / self.fps >= MOST_AT_ONCE:
                self._make(self.planned_until)
        if float(chunk.duration) > self.foresight.wait + 1e-9:
            self._make(self.planned_until)
        return self._next_frames()

    def _follow(self, samples: Array) -> None:
        """With little foresight: make the frames of each tick before more is heard, so that they depend on that tick alone."""
        self._make(self.planned_until)
        self._hear(samples)
        while self.detector.is_ready:
            self._make(self.planned_until)
            self.detector.step()
            self._decide_what_is_certain()

    def _decide_what_is_certain(self) -> None:
        end = self.detector.certain_until + self.foresight.level_delay
        while self.planned_until + self.foresight.look_ahead <= end + 1e-9 * (not self.foresight.is_usual):
            self._decide()

    def finish(self) -> Iterator[Motion]:
        """End the speech.

        Returns:
            The rest of the motion, to exactly ceil(duration × fps) frames in all; as of `push`.

        Raises:
            InputError: there was no speech at all.
        """
        total = count_frames(self._sound.duration, self.fps)
        if total == 0:
            raise InputError("there is no speech to gesture to", "give at least one sample")
        if self._sound.finished:
            return self._next_frames()
        self._hear(self._short_pieces.take(self._sound.finish()))
        self.detector.finish()
        if self.mouth is not None:
            self.mouth.finish()
        if self._record is not None:
            self._record.finish(float(self._sound.duration))
        while self._frame < total:
            end = min((self._ticks + 20) * self.foresight.tick, (total + 0.5) / self.fps)
            while self.planned_until < end:
                self._decide()
            self._make(end, total)
        return self._next_frames()

    def push_takes(self, chunk: Speech) -> Iterator[list[Motion]]:
        """As `push`, in lists, as sessions of several takes give it; here of one."""
        return ([piece] for piece in self.push(chunk))

    def finish_takes(self) -> Iterator[list[Motion]]:
        """As `finish`, in lists."""
        return ([piece] for piece in self.finish())

    def _next_frames(self) -> Iterator[Motion]:
        """The pieces that are ready; each leaves the queue before it is yielded."""
        while self._ready:
            yield self._ready.popleft()

    def hear_rest(self) -> None:
        """Hear the samples that wait for more, before the owner of the shared prosody ends it."""
        self._hear(self._short_pieces.take(np.zeros(0, np.float32)))

    def _hear(self, samples: Array) -> None:
        """Give samples at 16 kHz to all listeners."""
        self.detector.hear(samples)
        if self.mouth is not None:
            self.mouth.push(samples)

    def _decide(self) -> None:
        self._follow_plan()
        now = self.planned_until
        horizon, visible = now + self.foresight.horizon, now + self.foresight.look_ahead
        detector = self.detector
        accents = [a for a in detector.accents if now - 1.5 < a.time <= horizon]
        phrases = [p for p in detector.phrases if p.start <= horizon]
        words = [w for w in self._words if w.start <= visible - self.foresight.tick and w.end > now - 2]
        if self.mood.track is not None:
            self.mood.keep(now)
        if self.mood.listens and self._ticks % self._look == 0:
            listen = self.mood.follow if self.mood.track is None else self.mood.listen
            listen(horizon)
        if self.mood.track is not None or self._ticks % self._look == 0:
            level = self.mood.arousal.level * float(self.mood.voice_share(np.array(now)))
            self.modifier = arouse(blend_modifiers(self.mood.probabilities), level)
        if self._record is not None:
            self._record.note(self.planned_until, self.modifier, self.mood, detector)
        self._moods.append((now, self.mood.probabilities.copy()))
        if self._eyes_only:
            self.planner.posture.look(now, phrases, self.modifier)
        elif self.parts:
            self.gestures += self.planner.decide(now, accents=accents, phrases=phrases, words=words, modifier=self.modifier)
        self._ticks += 1

    def _make(self, until: float, total: int | None = None) -> None:
        """Make the frames before ``until`` seconds that have not been made; none ever where no part is wanted."""
        end = self._end(until) if total is None else min(self._end(until), total)
        if end <= self._frame:
            return
        times = np.arange(self._frame, end) / self.fps
        if self.parts:
            self._ready.append(self._realise(times))
        self._frame = end
        self._forget(times[-1])

    def _end(self, until: float) -> int:
        """The first frame that is not before ``until`` seconds."""
        return ceil(until * self.fps - 1e-9)

    def _forget(self, last: float) -> None:
        """Drop what no frame after ``last`` seconds needs."""
        for track in (self.planner.body, *(s.track for s in self.planner.hands)):
            track.forget(last - 0.5)
        self.manners.forget(last)
        while len(self._moods) > 1 and self._moods[1][0] < last - 1.5:
            self._moods.popleft()
        if "body" in self.parts or "hands" in self.parts:  # no other system makes them, and asks for the arousal
            self.mood.arousal.forget(last)
        if self._words:  # a long one may begin before a short one that is over
            self._words = [word for word in self._words if word.end >= last - 3]
        while self.gestures and self.gestures[0].end < last - KEPT:
            self.gestures.popleft()

    def _realise(self, times: Array) -> Motion:
        mood, layers = self._mood_at(times), self.manners.layers(times)
        poses = [(self._pose(times, mood, manner), share) for manner, share in layers]
        face = None
        if "face" in self.parts:
            faces = self._faces(times, mood, [manner.face for manner, _ in layers])
            face = mix_frames([(each, share) for each, (_, share) in zip(faces, layers, strict=True)]).astype(np.float32)
        root = mix_frames([(pose.root, share) for pose, share in poses]).astype(np.float32)
        rotations, root = self._turn(poses, root)
        motion = Motion(self.fps, rotations, root, face, humanoid(), float(times[0]))
        return self.aim(motion) if self._aimed else motion

    def _turn(self, poses: list[tuple[Pieces, Array]], root: Array) -> tuple[Array, Array]:
        """(n, J, 4) float32 and (n, 3): several manners as one, with the parts that are wanted; eyes stand in the world."""
        if self._eyes_only:
            eyes = toward(mix_frames([(pose.gaze, share) for pose, share in poses]))[:, None]
            rotations = quat_identity(len(eyes), len(humanoid()), dtype=np.float32)
            rotations[:, eye_joints()] = self._signs.push(eyes.astype(np.float32))
            return rotations, root
        rotations, root = select_parts(mix_frames([(pose.rotations, share) for pose, share in poses]), root, self.parts)
        if "face" in self.parts:
            rotations[:, eye_joints()] = toward(mix_frames([(pose.gaze, share) for pose, share in poses]))[:, None]
        return self._signs.push(rotations.astype(np.float32)), root

    def _pose(self, times: Array, mood: Array, manner: Manner) -> Pieces:
        if self._eyes_only:
            return gaze_only(times, self.planner.body)
        tracks = None if self.parts == ("face",) else [s.track for s in self.planner.hands]
        fear = mood[:, EMOTIONS.index("fear")]
        return realise(times, self.planner.body, tracks, manner.style, seed=manner.seed, size=manner.intensity, tremor=fear)

    def _faces(self, times: Array, mood: Array, faces: list[Face]) -> list[Array]:
        """(n, 52) weights of each of these faces."""
        features = self.detector.window(times[0] - 0.6, times[-1] + 0.6)
        accents = [a for a in self.detector.accents if times[0] - 1.5 < a.time < times[-1] + 1.0]
        words = [w for w in self._words if w.start < min(times[-1] + 1.0, self.planned_until + self.foresight.mouth_waits)]
        shifts = [shift for shift in self.planner.posture.gaze_shifts if times[0] - 0.6 < shift[0] < times[-1] + 0.6]
        mouth = None if self.mouth is None else self.mouth.at(times)
        strokes = None if self._eyes_only else list(self.planner.stroke_accents)
        signals: dict[str, Any] = {"words": words, "emotion": mood, "shifts": shifts, "spoken": mouth, "strokes": strokes}
        return [face.weights(times, features, accents=accents, **signals) for face in faces]

    def aim(self, motion: Motion) -> Motion:
        """A finished body with the planned eyes, turned against its head, whichever system moved it; lids and gains follow.

        Args:
            motion: of our humanoid. Its eyes stand as planned in the world; its face is that of a session that does not aim.
        """
        if motion.face is None:
            return motion
        angles = eye_angles(motion.rotations, motion.root, direction_of(motion.rotations[:, eye_joints()[0]].astype(float)))
        face = self.manners.last.face.finish(motion.face.astype(float), angles).astype(np.float32)
        return replace(motion, rotations=look(motion.rotations, angles), face=face)

    def _mood_at(self, times: Array) -> Array:
        """(N, 8): of the track; or linear between ticks and one tick late, so that the later one has always been decided."""
        if self.mood.track is not None:
            return self.mood.track.at(times)
        values = np.array([p for _, p in self._moods])
        if (values == values[0]).all():
            return np.repeat(values[:1], len(times), 0)
        at = np.array([t for t, _ in self._moods])
        return np.stack([np.interp(times - self.foresight.tick, at, values[:, k]) for k in range(values.shape[1])], -1)
