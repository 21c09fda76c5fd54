"""Torso, head and gaze over a stance: they follow the rhythm of the hands, and slowly move by themselves."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from random import Random
from typing import Any

import numpy as np

from ..audio.prosodic_events import Accent, Phrase
from ..face.expressions import couple
from ..face.gaze import Gaze, GazePlanner
from ..motion.kinematics.body import BODY_CHANNELS, Body
from ..motion.rotations import Array
from .emotion_modifiers import EmotionModifier
from .minimum_jerk import MinimumJerkTrack
from .stance import Stance, StanceAmounts, first_body, time_along
from .styles import Style

__all__ = ["Posture"]

_MEMORY = 16.0  # seconds after which a shift of the gaze moves no face [ours: twelve seconds are made at once, at most]


_TURNS = np.array([14.0, 0.0, 0.0, 20.0])
"""Degrees of yaw to the left per arm length of `_place`. [ours: of one recorded speaker, 32°/m aside and 65°/m one before the
other explain .79 of the yaw of his shoulders; a part of ours comes from the clavicles]"""
_LEANS = np.array([0.0, -1.0, -8.0, 0.0])
"""Degrees of pitch forward. [ours: the same speaker leans back by 6°/m as his hands go forward]"""
_ANSWERS = np.array([14.0, 6.0, 0.02])
"""Degrees of pitch, degrees of roll and metres of hips, either way, with which a body answers a stroke of an arm length. [ours:
mid-shoulder and wrist of people move fast together (r .3 to .5), but a recorded trunk does not go where the hands go]"""
_SEATED_SHARE = 1.15  # share of a standing trunk's part in a stroke that a seated one has (ours)
_ANSWER_COLUMNS = [Body.PITCH, Body.ROLL, Body.HIPS_X, Body.HIPS_Z]
_SPINE_AND_PELVIS = np.array([0.65, 1.5])
"""Shares of a stroke's turn that spine and pelvis of a standing body have. [ours: a recorded pelvis turns nearly as fast as its
chest]"""
_LONGER = 0.16  # seconds by which an answer takes longer than its stroke (ours)
_LARGE = 0.4  # arm lengths of a stroke that always brings another place of the torso, smaller ones by the square (ours)
_APART = (0.7, 1.4)  # seconds from one place of the torso to the next one that a stroke brings (ours)
_MOST = 10.0  # degrees that a stroke turns or bends the trunk (ours)


def _place(poses: Mapping[int, Array]) -> Array:
    """(4,) where hands are: to the left, up and ahead, in the mean of both, and how far the right is before the left.

    Arm lengths. A hand that does not stroke stays at its shoulder.
    """
    left, right = (poses[hand][:3] if hand in poses else np.zeros(3) for hand in (0, 1))
    mean = (left + right) / 2
    return np.array([(left[0] - right[0]) / 2, mean[1], mean[2], right[2] - left[2]])


class Posture:
    """Plans the body's track for one take."""

    def __init__(self, style: Style, random: Random, intensity: float) -> None:
        self.style, self._random = style, random
        self.size = max(intensity, 0.25) ** 0.5  # stillness of the hands does not freeze the body (ours)
        base = first_body(random, seated=style.seated, lean=style.lean)
        self.track = MinimumJerkTrack(base)
        amounts = StanceAmounts(style.sway * self.size, style.steps, style.seated)
        self.stance = Stance(self.track, random, amounts)
        self._next = {"lean": random.uniform(0.2, 1.0), "head": 0.3, "seat": 0.0 if style.seated else np.inf}
        self._seat = np.zeros(3)  # pitch, roll and yaw that a seated torso adds to its usual place
        self.gaze: Gaze = GazePlanner(random.getrandbits(32), style.averted)
        self.gaze_shifts: deque[tuple[float, float]] = deque()
        """Recent ones: time in seconds, size in radians."""
        self._phrase = self._leaned = -1.0
        self._modifier: EmotionModifier | None = None

    def schedule(self) -> dict[str, Any]:
        """Times and states of the plan, without the place of the body."""
        own = {"_seat": self._seat, "_phrase": self._phrase, "_leaned": self._leaned}
        return own | {"_next": dict(self._next), "stance": self.stance.schedule()}

    def follow(self, schedule: Mapping[str, Any]) -> None:
        """Go on from the schedule of another posture."""
        self._next = dict(schedule["_next"])
        self._seat, self._phrase, self._leaned = (schedule[name] for name in ("_seat", "_phrase", "_leaned"))
        self.stance.follow(schedule["stance"])

    @property
    def random(self) -> Random:
        """The random numbers that it draws from."""
        return self._random

    def restyle(self, style: Style, intensity: float) -> None:
        """Set another style and size for what is planned from now on; a body that stands goes on standing."""
        self.style, self.size = style, max(intensity, 0.25) ** 0.5
        self.stance.amounts = StanceAmounts(style.sway * self.size, style.steps, style.seated)
        self.gaze.averted = style.averted

    def decide(self, now: float, *, phrases: Sequence[Phrase], modifier: EmotionModifier, speaking: bool) -> None:
        """One tick."""
        if self._modifier is None:
            self._settle(-5.0, 1.0, modifier)  # where it stands before the first frame
        self._modifier = modifier
        for phrase in phrases:
            if phrase.start > self._phrase and phrase.start <= now + 0.6:
                self._phrase = phrase.start
                self._on_phrase(now, phrase.start)
        if now >= self._next["seat"]:
            self._sit(now)
        if now >= self._next["lean"]:
            self._settle(now, self._random.uniform(0.9, 1.8), modifier)
            self._leaned = now
            self._next["lean"] = now + self._random.uniform(3.5, 7.0) * (1.0 if speaking else 1.8)
        if now >= self._next["head"]:
            self._turn_head(now, modifier, speaking)
        self.look(now, phrases, modifier)
        self.stance.decide(now, speaking=speaking)

    def _gauss(self, size: float) -> float:
        return min(max(self._random.gauss(0, size), -2.2 * size), 2.2 * size)

    def _settle(self, now: float, length: float, modifier: EmotionModifier) -> None:
        """A new place for the torso around the speaker's usual one."""
        torso = self.style.torso * modifier.torso * self.size
        goal = (
            self.style.lean + modifier.bow + self._gauss(1.7 * torso) + self._seat[0],
            self._gauss(1.9 * torso) + self._seat[1],
            modifier.turn + self._gauss(5.0 * torso) + self._seat[2],
            self._gauss(1.6 * torso),
        )
        columns = [Body.PITCH, Body.ROLL, Body.YAW, Body.SHOULDERS]
        self.track.move(now + 0.02, length, np.array(goal), columns, skew=self._gauss(0.25))

    def _sit(self, now: float) -> None:
        """Another way to sit for a while: bent forward, upright, or sunk back, and to a side."""
        kind, bend = self._random.random(), self._random.uniform(6.0, 15.0)
        pitch = 0.8 * bend if kind < 0.4 else 0.3 * (bend - 10.5) if kind < 0.7 else -0.45 * bend
        size = self.style.torso * self.size * max(self.style.sway, 0.3) ** 0.5 / 1.4
        self._seat = np.array([pitch, self._gauss(3.0), self._gauss(5.0)]) * size
        self._next["seat"] = now + self._random.uniform(3.5, 9.0)
        self._next["lean"] = now

    def _on_phrase(self, now: float, start: float) -> None:
        self._next["lean"] = min(self._next["lean"], now + self._random.uniform(0, 0.3))
        self.stance.begin_phrase(now, start)
        if self._random.random() < 0.55:
            self._next["head"] = now

    def _turn_head(self, now: float, modifier: EmotionModifier, speaking: bool) -> None:
        head = self.style.head * modifier.head * self.size
        goal = (
            -modifier.chin + self._gauss(4.6 * head),
            modifier.tilt + self._gauss(5.5 * head),
            modifier.turn * 0.5 + self._gauss(8.4 * head) + 0.45 * self._gaze_yaw(),
        )
        length = self._random.uniform(0.45, 0.85)
        self.track.move(now + 0.02, length, np.array(goal), [Body.HEAD_PITCH, Body.HEAD_ROLL, Body.HEAD_YAW])
        self._next["head"] = now + self._random.uniform(0.9, 2.2) * (1.0 if speaking else 1.7)

    def _gaze_yaw(self) -> float:
        return float(self.track.target[Body.GAZE_YAW])

    def look(self, now: float, phrases: Sequence[Phrase], modifier: EmotionModifier) -> None:
        """One tick of the eyes: they jump as the gaze plans; the head follows far jumps.

        The gaze depends on nothing else that is planned. If only the gaze is wanted, call this in place of `decide`.
        """
        away = self.gaze.away
        saccade = self.gaze.decide(now, phrases, modifier.averted)
        if saccade is None:
            return
        columns = [Body.GAZE_YAW, Body.GAZE_UP]
        way = float(np.hypot(*(np.array([saccade.yaw, saccade.up]) - self.track.target[columns])))
        self.gaze_shifts.append((saccade.time + 0.03, float(np.radians(way))))
        while self.gaze_shifts[0][0] < now - _MEMORY:
            self.gaze_shifts.popleft()
        self.track.move(saccade.time, saccade.length, np.array([saccade.yaw, saccade.up]), columns)
        if self.gaze.away != away and (self.gaze.away or self._random.random() < 0.6):
            self._next["head"] = now + 0.05

    def on_accent(self, now: float, accent: Accent, modifier: EmotionModifier, has_stroke: bool = False) -> None:
        """Nods and tilts of the head on accents; with a stroke of the hands more often, without one less often."""
        emphasis = self.style.emphasis
        chance = couple(
            (0.45 + 0.5 * accent.strength) * min(emphasis, 1.0), has_stroke, self.style.coupling * min(emphasis, 1.0)
        )
        if accent.time < now + 0.2 or self._random.random() > chance:
            return
        size = (2.5 + 6.0 * accent.strength) * self.style.head * modifier.head * self.size * self._random.uniform(0.6, 1.25)
        size *= 0.4 + 0.6 * emphasis
        down, up = self._random.uniform(0.20, 0.28), self._random.uniform(0.30, 0.44)
        onset = max(now + 0.02, accent.time + 0.02 - down)
        nod = np.zeros(BODY_CHANNELS)
        nod[Body.HEAD_PITCH], nod[Body.HEAD_ROLL], nod[Body.HEAD_YAW] = size, self._gauss(0.3 * size), self._gauss(0.35 * size)
        nod[Body.PITCH] = 0.10 * size * self.style.torso
        self.track.add(onset, down, nod)
        self.track.add(onset + down * 0.8, up, -nod)

    def _move_along(self, now: float, start: float, length: float, poses: Mapping[int, Sequence[Array]]) -> None:
        """With a stroke that is large for this style, torso, pelvis and weight go elsewhere."""
        size = max(float(np.linalg.norm(own[1][:3] - own[0][:3])) for own in poses.values()) / self.style.amplitude**0.5
        self.stance.begin_gesture(now, start, length, size)
        if self._random.random() < (size / _LARGE) ** 2:
            self._next["lean"] = min(self._next["lean"], time_along(self._random, now, start, self._leaned, _APART))

    def on_stroke(
        self, now: float, times: tuple[float, float, float], poses: Mapping[int, Sequence[Array]], modifier: EmotionModifier
    ) -> None:
        """The trunk winds up while the hands prepare, leads the stroke, and comes back when it is over.

        It turns to where the hands go, and hardly leans there. With a large stroke the weight goes elsewhere, too.

        Args:
            now: of the tick, seconds.
            times: when the preparation begins, when the stroke begins, and how long the stroke takes, seconds.
            poses: of each hand that strokes (0 left, 1 right): the first one is prepared, the second one stroked to.
            modifier: of the emotion.
        """
        start, onset, stroke = times
        torso = min(self.style.torso * modifier.torso * self.size, 1.8) * (0.6 if self.style.seated else 1.0)
        before, after = (_place({hand: own[k] for hand, own in poses.items()}) for k in (0, 1))
        way, both = after - before, len(poses) == 2
        self._move_along(now, start, onset + stroke - start, poses)
        far = float(np.hypot(way[1], way[2])) ** 0.5
        part = np.zeros(BODY_CHANNELS)
        columns = [Body.YAW, Body.PITCH, Body.ROLL]
        part[Body.YAW] = float((after if both else way) @ _TURNS) * torso + self._gauss(0.7 * torso)
        part[Body.PITCH] = (way @ _LEANS + self._gauss(_ANSWERS[0] * far)) * torso
        part[Body.ROLL] = self._gauss(_ANSWERS[1] * far) * torso
        part[columns] = np.minimum(np.maximum(part[columns], -_MOST), _MOST)
        head = self.style.head * modifier.head * self.size
        part[Body.HEAD_YAW] = 0.65 * part[Body.YAW] + self._gauss(4.3 * head)
        part[Body.HEAD_PITCH] = 0.65 * part[Body.PITCH] + self._gauss(4.0 * head)
        part[Body.HEAD_ROLL] = 0.5 * part[Body.ROLL] + self._gauss(3.0 * head)
        part[Body.HIPS_YAW] = part[Body.YAW]
        if self.style.seated:  # on a chair the head goes along, and the trunk hardly
            part[columns] *= _SEATED_SHARE
        else:
            part[[Body.YAW, Body.HIPS_YAW]] *= _SPINE_AND_PELVIS
            part[Body.HIPS_X] = min(max(-0.01 * way[0] + self._gauss(_ANSWERS[2] * far), -0.007), 0.007) * torso
            part[Body.HIPS_Z] = min(max(-0.01 * way[2] + self._gauss(_ANSWERS[2] * far), -0.007), 0.007) * torso
            part[Body.SINK] = min(max(-0.02 * way[1], -0.003), 0.011) * torso
        lead = self._random.uniform(0.06, 0.13)
        wind = -self._random.uniform(0.2, 0.5) * part
        if both:  # two hands that are equally before the body turn nobody, others turn it from the preparation on
            turn = min(max(float(before @ _TURNS) * torso, -_MOST), _MOST)
            spine, pelvis = (_SEATED_SHARE, _SEATED_SHARE) if self.style.seated else _SPINE_AND_PELVIS
            wind[[Body.YAW, Body.HIPS_YAW, Body.HEAD_YAW]] = spine * turn, pelvis * turn, 0.65 * turn
        ready = onset - lead
        begin = max(start, ready - 0.7)
        self.track.add(begin, max(ready - begin, 0.25) * 1.2, wind)
        self.track.add(ready, stroke + _LONGER, part - wind, skew=0.15)
        back = np.full(BODY_CHANNELS, self._random.uniform(0.2, 0.4))
        back[_ANSWER_COLUMNS] = self._random.uniform(0.45, 0.8)
        self.track.add(onset + stroke * 0.9, 0.34, -back * part)
        self.track.add(onset + stroke + self._random.uniform(0.3, 1.1), self._random.uniform(0.7, 1.2), -(1 - back) * part)
