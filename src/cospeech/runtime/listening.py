"""Somebody who listens: nods, a smile now and then, brows, a head held a little aslant, and eyes on the one who speaks.

`ResponsePlanner` decides when and how; `ListeningLayer` shows it, over the motion of any model. The hands are the model's: they
rest, because it hears silence.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from random import Random
from typing import NamedTuple

import numpy as np

from ..audio.backchannel_cues import BackchannelCue
from ..audio.conversation import HeardSpeaker, merge_speakers
from ..audio.prosodic_events import Phrase
from ..audio.speech import File, SpeechSource, add_words, open_speech
from ..errors import InputError
from ..face.gaze import direction_of, head_rotation, limit_eyes, look, write_looks
from ..motion.curves import smoothstep
from ..motion.motion import Motion
from ..motion.noise import smooth_noise
from ..motion.rotations import Array, euler_to_quat, quat_conjugate, quat_multiply
from ..motion.skeleton import humanoid
from ..motion.skeletons.arkit import ARKIT_INDEX
from ..rules.options import GenerationOptions
from .attention import Attention, AttentionShift, plan_attention
from .crossfade import FADE
from .nods import nod_curve

__all__ = [
    "AHEAD", "ANGLE_RANGE", "DialogueRole", "ListeningLayer", "Response", "ResponsePlanner", "find_listening", "plan_responses",
]  # fmt: skip

ANGLE_RANGE = (-60.0, 60.0)  # degrees [ours: beyond, people turn the body, and the user should turn the character]
AHEAD = AttentionShift(0.0, 0.0)
"""All the time, the other person is straight ahead."""
_CHANCES = {"pause": 0.62, "low": 0.30}  # [ours: so that there are some 10 responses in a minute of the other one's speech]
_AFTER = {"pause": (0.05, 0.45), "low": (0.55, 0.85)}  # s from the cue on [ours; low: Ward & Tsukahara 2000, 700 ms]
_APART = 2.2  # s between responses at least [ours]
_BEFORE_OWN = 0.7  # s before own speech in which no response begins [ours: the turn is taken, then]
_SHORT = 0.8  # s; own speech that is no longer, while the other one goes on, is a response by voice: "mhm" [ours]
_WITH_VOICE = 0.85  # chance that such a response is nodded, too [ours: the two go together, Dittmann & Llewellyn 1968]
_COUNTS = (1, 1, 1, 2, 2, 3)  # nods in a row [ours]
_PACE = (0.34, 0.50)  # s of a nod: 2 to 3 a second (Hadar et al. 1985: ordinary nods, 1.8 to 3.7 Hz)
_SIZE = (3.0, 8.0)  # degrees [ours: of listeners; those on own accents have up to 12]
_SMILES, _SMILE, _SMILE_LASTS = 0.22, (0.18, 0.42), (1.2, 2.4)  # chance, weight, seconds [ours]
_BROWS, _BROW, _BROW_LASTS = 0.25, (0.15, 0.40), (0.5, 0.9)  # of raised brows, the same [ours]
_RISE = 0.3  # s in which a smile or a brow comes, and goes twice as slowly [ours]

_JOINS = 1.2  # s of silence of the other one in which a listener goes on listening [ours: a longer pause offers the turn]
_TURNS = 0.9  # s in which a listener's posture comes and goes [ours]
_ASLANT, _SLOW = np.radians([3.0, 1.2, 1.5]), 0.10  # sd of roll, yaw and pitch while listening; points a second [ours]
_ATTENDS = 0.05  # browInnerUp while listening [ours: just visible]
_NECK, _HEAD = 0.35, 0.40  # share of the angle to the other person; the eyes do the rest [ours: the head goes most
# of the way to a target that is looked at for long]
_MOST_YAW, _EASES = np.radians([66.0, 4.0])  # of neck and head together, at most, and where it slows down [ours: necks turn 70]
_MEMORY = 40.0  # s for which a live session can take frames back, and the length of what a response shows [ours]
_STREAM = 4211  # of the noise
_ROLL, _YAW, _PITCH = range(3)
_SMILE_COLUMNS = [ARKIT_INDEX["mouthSmileLeft"], ARKIT_INDEX["mouthSmileRight"]]
_CHEEK_COLUMNS = [ARKIT_INDEX["cheekSquintLeft"], ARKIT_INDEX["cheekSquintRight"]]
_BROW_COLUMNS = [ARKIT_INDEX[name] for name in ("browInnerUp", "browOuterUpLeft", "browOuterUpRight")]


class Response(NamedTuple):
    """What a listener does at one moment."""

    time: float
    """Seconds at which it begins."""
    nods: int
    size: float
    """Radians of the first nod."""
    pace: float
    """Seconds of a nod."""
    smile: float
    """0 … 1."""
    smile_seconds: float
    brows: float
    """0 … 1."""
    brow_seconds: float


class ResponsePlanner:
    """Decides, cue by cue in the order of their times, what a listener does.

    Args:
        seed: of the take.
    """

    def __init__(self, seed: int) -> None:
        self._random = Random(seed * 2 + 1)
        self._last = -_APART

    def answer(self, cue: BackchannelCue, *, earliest: float = -np.inf) -> Response | None:
        """The response to a cue, if there is one.

        Args:
            cue: the next one.
            earliest: seconds before which nothing can begin any more.
        """
        late, answers = self._random.uniform(*_AFTER[cue.kind]), self._random.random() < _CHANCES[cue.kind]
        return self._respond(max(cue.time + late, earliest)) if answers else None

    def go_back(self, time: float) -> None:
        """Drop what was to come from this moment on, in seconds."""
        self._last = min(self._last, time)

    def accompany(self, time: float) -> Response | None:
        """The response that goes with one by voice, if there is one."""
        return self._respond(time) if self._random.random() < _WITH_VOICE else None

    def _respond(self, time: float) -> Response | None:
        draw = self._random
        response = Response(
            time, draw.choice(_COUNTS), float(np.radians(draw.uniform(*_SIZE))), draw.uniform(*_PACE),
            draw.uniform(*_SMILE) * (draw.random() < _SMILES), draw.uniform(*_SMILE_LASTS),
            draw.uniform(*_BROW) * (draw.random() < _BROWS), draw.uniform(*_BROW_LASTS),
        )  # fmt: skip
        if time < self._last + _APART:
            return None
        self._last = time
        return response


def plan_responses(listener: HeardSpeaker, speaker: HeardSpeaker, seed: int) -> list[Response]:
    """All responses of one person to the other, in the order of their times.

    Nobody nods in own speech, or begins to just before it. Short own speech, while the other one goes on, is a response.
    """
    planner, own = ResponsePlanner(seed), listener.phrases
    busy = [phrase for phrase in own if not _is_response(phrase, speaker.phrases)]
    vocal = [phrase for phrase in own if _is_response(phrase, speaker.phrases)]
    moments: list[tuple[float, BackchannelCue | None]] = [(cue.time, cue) for cue in speaker.cues]
    moments += [(phrase.start, None) for phrase in vocal]
    responses = list[Response]()
    for time, cue in sorted(moments, key=lambda moment: moment[0]):
        response = planner.accompany(time) if cue is None else planner.answer(cue)
        if response is not None:
            lasts = max(_BEFORE_OWN, response.nods * response.pace)
            if not _overlaps(busy, response.time, response.time + lasts):
                responses.append(response)
    return sorted(responses)


def _is_response(phrase: Phrase, other: Sequence[Phrase]) -> bool:
    """Whether it is short, and the other one speaks just before it and goes on after it."""
    if phrase.end - phrase.start > _SHORT:
        return False
    before = any(each.start < phrase.start and each.end > phrase.start - _JOINS for each in other)
    return before and any(each.end > phrase.end and each.start < phrase.end + _JOINS for each in other)


def _overlaps(phrases: Sequence[Phrase], start: float, end: float) -> bool:
    """Whether one of some phrases, in order, has a part between two moments."""
    first = bisect_right(phrases, start, key=lambda phrase: phrase.end)
    return first < bisect_left(phrases, end, key=lambda phrase: phrase.start)


def find_listening(listener: HeardSpeaker, speaker: HeardSpeaker) -> list[tuple[float, float]]:
    """Stretches, in seconds, in which one person listens to the other: that one speaks, and pauses for a moment at most."""
    turns = list[tuple[float, float]]()
    for phrase in speaker.phrases:
        if turns and phrase.start < turns[-1][1] + _JOINS:
            turns[-1] = (turns[-1][0], max(turns[-1][1], phrase.end))
        else:
            turns.append((phrase.start, phrase.end))
    stretches = list[tuple[float, float]]()
    own = [phrase for phrase in listener.phrases if not _is_response(phrase, speaker.phrases)]
    for low, high in turns:
        for phrase in own[bisect_right(own, low, key=lambda each: each.end) :]:
            if phrase.start >= high:
                break
            if phrase.start > low:
                stretches.append((low, phrase.start))
            low = max(low, phrase.end)
        if low < high:
            stretches.append((low, high))
    return stretches


class ListeningLayer:
    """Shows how somebody listens, over frames that any model made; a function of time alone.

    Args:
        responses: in the order of their times.
        listening: stretches in seconds, in order, that do not overlap.
        seed: of the take.
        intensity: size of all of it, 0 … 2.
        shifts: at whom the character looks, and when; at least one. An angle of 0 is straight ahead.
        turns_head: whether the body is one of the parts that move; without it, the eyes and the face do all.

    Raises:
        InputError: an angle out of range.
    """

    def __init__(
        self,
        responses: Iterable[Response],
        listening: Iterable[tuple[float, float]],
        *,
        seed: int = 0,
        intensity: float = 1.0,
        shifts: Sequence[AttentionShift] = (AHEAD,),
        turns_head: bool = True,
    ) -> None:
        for shift in shifts:
            _check_angle(shift.angle)
        self._responses, self._listening = list(responses), list(listening)
        self._seed, self._attention = seed, Attention(shifts)
        self._intensity = (intensity, intensity, 0.0)  # before, after, and the time of the change
        self._turns_head = turns_head

    def add(self, response: Response) -> None:
        """One more response, which begins after all others."""
        self._responses.append(response)

    def begin(self, time: float) -> None:
        """From this moment on, in seconds, this person listens."""
        self._listening.append((time, np.inf))

    def end(self, time: float) -> None:
        """At this moment, in seconds, this person ceases to listen."""
        low, _ = self._listening[-1]
        self._listening[-1] = (low, max(time, low))

    def set_intensity(self, intensity: float, time: float) -> None:
        """Another size, faded in from this moment on, in seconds."""
        before = float(self._find_intensity(np.array([time]))[0])
        self._intensity = (before, intensity, time)

    def go_back(self, time: float) -> None:
        """Drop what was to come from this moment on, in seconds."""
        self._responses = [each for each in self._responses if each.time < time]
        self._listening = [(low, min(high, time)) for low, high in self._listening if low < time]

    def forget(self, time: float) -> None:
        """Drop what only frames far before this moment, in seconds, need."""
        self._responses = [each for each in self._responses if each.time > time - _MEMORY]
        self._listening = [each for each in self._listening if each[1] > time - _MEMORY]

    def apply(self, motion: Motion) -> Motion:
        """The same frames of our humanoid, of somebody who listens."""
        times = motion.times
        share, near = self._find_share(times), self._near(times)
        nods = np.zeros(len(times))
        for each in near:
            nods += nod_curve(times, each.time, each.nods, each.size, each.pace)
        intensity = self._find_intensity(times)
        turns = (intensity * share)[:, None] * _ASLANT * smooth_noise(self._seed + _STREAM, 3, times, _SLOW, octaves=2)
        turns[:, _PITCH] += intensity * nods
        eyes, head = self._attention.find_angles(times)
        rotations = self._turn(motion.rotations, turns, head) if self._turns_head else motion.rotations
        if motion.face is None:
            return replace(motion, rotations=rotations)
        rotations, face = _look_at(eyes, motion.rotations, rotations, self._show(motion.face, times, share, intensity, near))
        return replace(motion, rotations=rotations, face=face)

    def _find_intensity(self, times: Array) -> Array:
        """(n,) size of all that is shown."""
        before, after, start = self._intensity
        return before + (after - before) * smoothstep((times - start) / FADE)

    def _near(self, times: Array) -> list[Response]:
        """Responses that may show in these frames."""
        longest = max(3 * _PACE[1], _SMILE_LASTS[1] + 3 * _RISE, _BROW_LASTS[1] + 3 * _RISE)
        key = float(times[0]) - longest, float(times[-1])
        first, last = (bisect_left(self._responses, moment, key=lambda each: each.time) for moment in key)
        return self._responses[first : last + 1]

    def _find_share(self, times: Array) -> Array:
        """(n,) 0 … 1: how far this person listens."""
        share = np.zeros(len(times))
        for low, high in self._listening:
            if high > times[0] - _TURNS and low < times[-1]:
                share = np.maximum(share, _course(times, low, high, _TURNS, _TURNS))
        return share

    def _turn(self, rotations: Array, turns: Array, towards: Array) -> Array:
        """Neck and head with (n, 3) turns of listening, and towards the other person, who is (n,) radians to the left."""
        out, joint = rotations.copy(), humanoid().index
        aside = _limit_turn(rotations, towards)
        for name, own, share in (("neck", 0.3, _NECK), ("head", 0.7, _HEAD)):
            angles = np.stack([turns[:, _YAW] * own + aside * share, turns[:, _PITCH] * own, turns[:, _ROLL] * own], -1)
            rotation = quat_multiply(rotations[:, joint[name]].astype(float), euler_to_quat(angles, "YXZ"))
            out[:, joint[name]] = rotation
        return out

    def _show(self, face: Array, times: Array, share: Array, intensity: Array, near: Sequence[Response]) -> Array:
        """The face with smiles and brows."""
        out = face.copy()
        smile, brows = np.zeros(len(times)), _ATTENDS * share
        for each in near:
            end = each.time + each.smile_seconds
            smile = np.maximum(smile, each.smile * _course(times, each.time, end, _RISE, 2 * _RISE))
            end = each.time + each.brow_seconds
            brows = np.maximum(brows, each.brows * _course(times, each.time, end, _RISE, 2 * _RISE))
        smile, brows = (intensity * smile)[:, None], (intensity * brows)[:, None]
        out[:, _SMILE_COLUMNS] = np.maximum(out[:, _SMILE_COLUMNS], smile)
        out[:, _CHEEK_COLUMNS] = np.maximum(out[:, _CHEEK_COLUMNS], 0.6 * smile)
        out[:, _BROW_COLUMNS] = np.maximum(out[:, _BROW_COLUMNS], brows)
        return np.clip(out, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class DialogueRole:
    """One person of a conversation.

    Args:
        own: this person.
        others: those whom this person talks and listens to.
        bearings: degrees to the left at which each of them is, -60 … 60; all are straight ahead where not given.
        mixed: whether a transcript has the words of all persons; those in own stretches are then taken.
    """

    own: HeardSpeaker
    others: tuple[HeardSpeaker, ...]
    bearings: tuple[float, ...] = ()
    mixed: bool = False

    def open(self, transcript: File | None = None, language: str = "") -> SpeechSource:
        """The voice of this person alone, with the words of a transcript.

        Raises:
            InputError: see `cospeech.audio.speech.open_speech`.
        """
        source = self.own.open()
        if not self.mixed:
            return add_words(source, transcript, language)
        with open_speech(self.own.track.path, transcript=transcript, language=language) as whole:
            source.words = whole.words and tuple(word for word in whole.words if self.own.owns(word))
        return source

    def listen(self, moving: Iterable[list[Motion]], options: GenerationOptions, takes: range) -> Iterator[list[Motion]]:
        """Some takes of a motion as they come, of somebody who listens."""
        other, turns_head = merge_speakers(self.others), "body" in options.parts
        stretches, bearings = find_listening(self.own, other), self.bearings or (0.0,) * len(self.others)
        layers = [
            ListeningLayer(
                plan_responses(self.own, other, seed), stretches, seed=seed, intensity=options.intensity,
                shifts=plan_attention(self.own, self.others, bearings, seed), turns_head=turns_head,
            )
            for seed in (options.seed + take for take in takes)
        ]  # fmt: skip
        for pieces in moving:
            yield [layer.apply(piece) for layer, piece in zip(layers, pieces, strict=True)]


def _look_at(towards: Array, before: Array, after: Array, face: Array) -> tuple[Array, Array]:
    """Eyes that look at another person, whatever the head did; and the face that shows it.

    Args:
        towards: (n,) radians to the left: that person.
        before: (n, J, 4) with eyes that look at somebody straight ahead.
        after: the same with another head.
        face: (n, 52).
    """
    joint = humanoid().index
    eyes = [joint["leftEye"], joint["rightEye"]]
    about = euler_to_quat(np.stack([towards, np.zeros_like(towards), np.zeros_like(towards)], -1), "YXZ")
    back = quat_multiply(quat_conjugate(head_rotation(after)), quat_multiply(about, head_rotation(before)))
    angles = [limit_eyes(direction_of(quat_multiply(back, before[:, eye].astype(float)))) for eye in eyes]
    both = np.stack(angles, 1)
    return look(after, both), np.clip(write_looks(face, both), 0.0, 1.0).astype(face.dtype)


def _limit_turn(rotations: Array, towards: Array) -> Array:
    """(n,) radians to the left: another person, as far as a neck can turn there beside what the model turned it already."""
    if not np.any(towards):
        return towards
    joint, share = humanoid().index, _NECK + _HEAD
    head = quat_multiply(rotations[:, joint["neck"]].astype(float), rotations[:, joint["head"]].astype(float))
    turn = share * np.abs(towards)
    room = (_MOST_YAW - np.sign(towards) * direction_of(head)[:, 0] - turn) / _EASES
    less = _EASES * np.logaddexp(0.0, -room)  # 0 where there is room; else what is missing
    return np.asarray(np.sign(towards) * np.maximum(turn - less, 0.0) / share)


def _check_angle(angle: object) -> None:
    """Check that a head can look there.

    Raises:
        InputError: it cannot.
    """
    if not isinstance(angle, Real) or not ANGLE_RANGE[0] <= float(angle) <= ANGLE_RANGE[1]:
        number = f"{angle:g}" if isinstance(angle, Real) else f"{angle!r:.40}"
        raise InputError(f"an angle of {number} degrees", "-60 … 60; for more, turn the character itself")


def _course(times: Array, start: float, end: float, rise: float, fall: float) -> Array:
    """(n,) 0 … 1: comes within ``rise`` seconds after the start, and goes within ``fall`` after the end."""
    return smoothstep(np.minimum((times - start) / rise, (end + fall - times) / fall))
