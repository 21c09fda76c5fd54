"""Hips, torso, head, gaze and feet: they carry the hands' rhythm and have a slow life of their own."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from random import Random

import numpy as np

from ..audio.prosodic_events import Accent, Phrase
from ..face.gaze import GazePlanner
from ..motion.kinematics.body import BODY_CHANNELS, Body
from ..motion.kinematics.legs import STANCE, TOE_OUT
from ..motion.rotations import Array
from .emotion_modifiers import EmotionModifier
from .minimum_jerk import MinimumJerkTrack
from .styles import Style

__all__ = ["Posture"]


class Posture:
    """Plans the body's track for one take."""

    def __init__(self, style: Style, random: Random, intensity: float) -> None:
        self.style, self._random = style, random
        self.size = max(intensity, 0.25) ** 0.5  # stillness of the hands does not freeze the body (ours)
        base = np.zeros(BODY_CHANNELS)
        forward = 0.0 if style.seated else 0.03
        base[Body.LEFT_FOOT] = (STANCE, forward * random.uniform(-1, 1), TOE_OUT)
        base[Body.RIGHT_FOOT] = (-STANCE, forward * random.uniform(-1, 1), -TOE_OUT)
        base[Body.PITCH] = style.lean
        self.track = MinimumJerkTrack(base)
        self._next = {
            "shift": random.uniform(0.5, 3),
            "lean": random.uniform(0.2, 1.0),
            "head": 0.3,
            "step": self._step_gap(),
        }
        self.gaze = GazePlanner(random.getrandbits(32), style.averted)
        self.gaze_shifts: deque[tuple[float, float]] = deque(maxlen=64)
        """Recent ones: time in seconds, size in radians."""
        self._phrase = -1.0
        self._side = random.choice((-1, 1))
        self._modifier: EmotionModifier | None = None

    def decide(self, now: float, *, phrases: Sequence[Phrase], modifier: EmotionModifier, speaking: bool) -> None:
        """One tick."""
        if self._modifier is None:
            self._settle(-5.0, 1.0, modifier)  # where it stands before the first frame
        self._modifier = modifier
        for phrase in phrases:
            if phrase.start > self._phrase and phrase.start <= now + 0.4:
                self._phrase = phrase.start
                self._on_phrase(now, modifier)
        if now >= self._next["lean"]:
            self._settle(now, self._random.uniform(0.9, 1.8), modifier)
            self._next["lean"] = now + self._random.uniform(1.2, 3.4) * (1.0 if speaking else 1.8)
        if now >= self._next["head"]:
            self._turn_head(now, modifier, speaking)
        self._look(now, phrases, modifier)
        if now >= self._next["shift"]:
            self._shift_weight(now)
        if now >= self._next["step"]:
            self._step(now)

    def _gauss(self, size: float) -> float:
        return float(np.clip(self._random.gauss(0, size), -2.2 * size, 2.2 * size))

    def _settle(self, now: float, length: float, modifier: EmotionModifier) -> None:
        """A new place for the torso around the speaker's usual one."""
        torso = self.style.torso * modifier.torso * self.size
        goal = (
            self.style.lean + modifier.bow + self._gauss(2.6 * torso),
            self._gauss(1.8 * torso),
            modifier.turn + self._gauss(4.2 * torso),
        )
        self.track.move(now + 0.02, length, np.array(goal), [Body.PITCH, Body.ROLL, Body.YAW])
        self.track.move(now + 0.05, length * 1.1, np.array([self._gauss(2.0 * torso)]), [Body.HIPS_YAW])

    def _on_phrase(self, now: float, modifier: EmotionModifier) -> None:
        self._next["lean"] = min(self._next["lean"], now + self._random.uniform(0, 0.3))
        if self._random.random() < 0.55:
            self._next["head"] = now

    def _turn_head(self, now: float, modifier: EmotionModifier, speaking: bool) -> None:
        head = self.style.head * modifier.head * self.size
        goal = (
            -modifier.chin + self._gauss(4.3 * head),
            modifier.tilt + self._gauss(5.2 * head),
            modifier.turn * 0.5 + self._gauss(7.9 * head) + 0.45 * self._gaze_yaw(),
        )
        length = self._random.uniform(0.45, 0.85)
        self.track.move(now + 0.02, length, np.array(goal), [Body.HEAD_PITCH, Body.HEAD_ROLL, Body.HEAD_YAW])
        self._next["head"] = now + self._random.uniform(0.6, 1.5) * (1.0 if speaking else 1.7)

    def _gaze_yaw(self) -> float:
        return float(self.track.target[Body.GAZE_YAW])

    def _look(self, now: float, phrases: Sequence[Phrase], modifier: EmotionModifier) -> None:
        """The eyes jump where the plan of the gaze wants; the head follows far jumps."""
        away = self.gaze.away
        saccade = self.gaze.decide(now, phrases, modifier.averted)
        if saccade is None:
            return
        columns = [Body.GAZE_YAW, Body.GAZE_UP]
        way = float(np.hypot(*(np.array([saccade.yaw, saccade.up]) - self.track.target[columns])))
        self.gaze_shifts.append((saccade.time + 0.03, float(np.radians(way))))
        self.track.move(saccade.time, saccade.length, np.array([saccade.yaw, saccade.up]), columns)
        if self.gaze.away != away and (self.gaze.away or self._random.random() < 0.6):
            self._next["head"] = now + 0.05

    def _shift_weight(self, now: float) -> None:
        if self.style.seated:
            self._next["shift"] = now + 30
            return
        self._side = -self._side if self._random.random() < 0.75 else self._side
        sway = self.style.sway * self.size
        goal = (self._side * self._random.uniform(0.012, 0.042) * sway, self._gauss(0.012 * sway))
        feet = (self.track.target[Body.LEFT_FOOT][0] + self.track.target[Body.RIGHT_FOOT][0]) / 2
        depth = (self.track.target[Body.LEFT_FOOT][1] + self.track.target[Body.RIGHT_FOOT][1]) / 2
        length = self._random.uniform(1.0, 1.9)
        self.track.move(now + 0.02, length, np.array([feet + goal[0], depth + goal[1]]), [Body.HIPS_X, Body.HIPS_Z])
        self._next["shift"] = now + self._random.uniform(2.2, 6.0) / max(sway, 0.3)

    def _step_gap(self) -> float:
        per_minute = 0.0 if self.style.seated else self.style.steps
        return self._random.expovariate(per_minute / 60) + 1.5 if per_minute > 0 else 1e12

    def _step(self, now: float) -> None:
        """The unloaded foot takes a small step; the weight follows."""
        self._next["step"] = now + self._step_gap()
        left_free = self._side < 0  # weight on the right (−x): the left foot may go
        foot, other = (Body.LEFT_FOOT, Body.RIGHT_FOOT) if left_free else (Body.RIGHT_FOOT, Body.LEFT_FOOT)
        lift = Body.LEFT_LIFT if left_free else Body.RIGHT_LIFT
        side = 1 if left_free else -1
        still = self.track.target[other]
        goal = np.array(
            [still[0] + side * 2 * STANCE * self._random.uniform(0.85, 1.25), self._random.uniform(-0.07, 0.09), 0.0]
        )
        goal[0] = np.clip(goal[0], -0.24, 0.24)
        goal[2] = side * (TOE_OUT + self._random.uniform(-4, 8))
        length = self._random.uniform(0.42, 0.55)
        onset = now + 0.34
        self._lean_over(now, other)
        self.track.move(onset, length, goal, foot)
        self.track.move(onset - 0.15, 0.26, np.array([0.05]), [lift])
        self.track.move(onset + length - 0.09, 0.26, np.array([0.0]), [lift])
        middle = (goal[:2] + still[:2]) / 2
        self.track.move(onset + 0.35 * length, 0.8, middle + np.array([side * 0.015, 0.0]), [Body.HIPS_X, Body.HIPS_Z])
        self._next["shift"] = max(self._next["shift"], onset + length + 1.0)
        self._side = side

    def _lean_over(self, now: float, foot: slice) -> None:
        goal = self.track.target[foot][0] * 0.36 + self.track.target[Body.HIPS_X] * 0.64
        self.track.move(now + 0.02, 0.5, np.array([goal]), [Body.HIPS_X])

    def on_accent(self, now: float, accent: Accent, modifier: EmotionModifier) -> None:
        """Nods and tilts of the head on accents."""
        tied = self.style.emphasis
        if accent.time < now + 0.2 or self._random.random() > (0.45 + 0.5 * accent.strength) * min(tied, 1.0):
            return
        size = (2.5 + 6.0 * accent.strength) * self.style.head * modifier.head * self.size * self._random.uniform(0.6, 1.25)
        size *= 0.4 + 0.6 * tied
        down, up = self._random.uniform(0.20, 0.28), self._random.uniform(0.30, 0.44)
        onset = max(now + 0.02, accent.time + 0.02 - down)
        nod = np.zeros(BODY_CHANNELS)
        nod[Body.HEAD_PITCH], nod[Body.HEAD_ROLL], nod[Body.HEAD_YAW] = size, self._gauss(0.3 * size), self._gauss(0.35 * size)
        nod[Body.PITCH] = 0.10 * size * self.style.torso
        self.track.add(onset, down, nod)
        self.track.add(onset + down * 0.8, up, -nod)

    def on_stroke(
        self, start: float, onset: float, stroke: float, poses: list[Array], hands: list[int], modifier: EmotionModifier
    ) -> None:
        """The torso goes along with the hands: towards what one hand does, forward or up with both."""
        way = poses[1][:3] - poses[0][:3]
        torso = self.style.torso * modifier.torso * self.size
        part = np.zeros(BODY_CHANNELS)
        if len(hands) == 1:
            side = 1 if hands[0] == 0 else -1
            part[Body.YAW] = side * (5.0 * way[0] - 5.5 * way[2]) * torso
            part[Body.ROLL] = -side * 2.2 * way[0] * torso
        part[Body.PITCH] = (4.5 * way[2] - 4.0 * way[1]) * torso
        part[Body.HIPS_Z] = 0.012 * way[2] * torso
        part[Body.HEAD_YAW] = 0.5 * part[Body.YAW]
        part[[Body.YAW, Body.PITCH, Body.ROLL]] = np.clip(part[[Body.YAW, Body.PITCH, Body.ROLL]], -7, 7)
        self.track.add(onset - 0.05, stroke + 0.12, part)
        self.track.add(onset + stroke + 0.2, 0.9, -part)
