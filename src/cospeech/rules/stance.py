"""Weight, pelvis, steps and breath: what a body does below the ribs while its hands and head do other things.

A stance writes onto a body's track (`cospeech.motion.kinematics.body.Body`), but on no channel of torso, head and gaze. So it
may carry a planned performance (`posture`), or lie under the motion of another system (`stance_layer`). All of it is ours, set
by eye and by the statistics of `cospeech.metrics.body`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np

from ..motion.kinematics.body import BODY_CHANNELS, Body
from ..motion.kinematics.legs import BALL, STANCE, TOE_OUT
from ..motion.rotations import Array
from .minimum_jerk import MinimumJerkTrack

__all__ = [
    "BREATH_PITCH",
    "CONTRAPPOSTO",
    "DRIFT",
    "DRIFT_HZ",
    "PELVIS_SHARE",
    "Stance",
    "StanceAmounts",
    "first_body",
    "time_along",
]

BREATH_PITCH = 1.7
"""Degrees by which a breath opens the chest. Ours: about 1 cm."""
PELVIS_SHARE = 0.6
"""Share of the pelvis' turn that the chest takes over. Ours, by eye."""
CONTRAPPOSTO = 31.0
"""Degrees that the chest leans to the loaded side per metre of weight shift. [ours: 31 of a recorded speaker]"""
DRIFT_HZ, DRIFT = 0.25, 0.012
"""How often, and how far in metres, hips drift between shifts of the weight. [ours: a recorded hip never waits: in its
slowest tenth it has a fifth of its mean speed]"""
_MOST_TURN = 17.0  # degrees that pelvis and feet turn away from the listener
_KEEPS = 0.5  # share of that turn that a step keeps [ours: without it, somebody stands turned away for minutes]
_OVER = 0.175  # metres above the floor of the sole of a leg that lies over the other's knee: thigh over thigh
_WIDTHS = (1.0, 1.7)  # of a stance, over `STANCE`: ankles .21 to .36 m apart (CMU's takes that stand: .24 to .59)
_BEFORE = 0.02  # metres by which hips are before the ankles, beside the skeleton's own: weight lies on the middle of the foot
_SHIFTS = (6.0, 10.0)  # seconds between shifts of the weight while hands rest (ours)
_TURNS = (4.0, 8.0)  # seconds between turns of the pelvis while hands rest (ours)
_LARGE = 0.5
"""Arm lengths of a gesture that always brings a shift; smaller ones bring one by the square of that. [ours: a recorded speaker
sways while he gestures: below .5 Hz, the speeds of hips and wrists have an r of .4, above it of 0]"""
_EARLIER = 0.2  # seconds by which weight and trunk begin before the hands (ours)
_APART = (0.9, 1.6)  # seconds from the beginning of a shift, or turn, to the next one that a gesture brings (ours)
_LASTS, _GLIDES = (1.4, 2.8), (2.8, 4.2)
"""Seconds of a shift that a gesture brings, and of one while hands rest. [ours: a recorded speaker's hips glide: nine tenths of
the power of their speed sideways are below .35 Hz, one hundredth is above .7 Hz]"""
_OVERLAP = 1.6  # times the gesture that its shift lasts (ours)
_LEANS = 0.8  # seconds in which the weight goes over the foot that stays, before the other one steps (ours)
_PIVOTS = 10.0  # degrees of tip from which a free foot may turn about its ball (ours)
_ROOM = (0.18, 0.16)  # metres sideways and in depth that feet keep around the first place
_FREE = {False: Body.LEFT_TIP, True: Body.RIGHT_TIP}  # the free foot's tip, by whether the weight is on the left


@dataclass(frozen=True)
class StanceAmounts:
    """How much somebody moves below the ribs.

    Args:
        sway: factor on weight shifts and turns of the pelvis; 1 is a person at ease.
        steps: per minute.
        seated: on a chair: no steps and no weight shifts, the pelvis rolls and tilts, feet are put elsewhere.
    """

    sway: float = 1.0
    steps: float = 7.0
    seated: bool = False


_TIMES = ("_next", "_begun")
_SCHEDULE = ("_left", "_heading", "_breathed", "_lasts", "_follow", "_down", "_settled")


def first_body(random: Random, *, seated: bool, lean: float = 0.0) -> Array:
    """(channels,) of a body that stands or sits before anything moves."""
    base = np.zeros(BODY_CHANNELS)
    forward = 0.05
    aside = STANCE * random.uniform(*_WIDTHS)
    base[Body.LEFT_FOOT] = (aside, forward * random.uniform(-1, 1), TOE_OUT + random.uniform(-3, 9))
    base[Body.RIGHT_FOOT] = (-aside, forward * random.uniform(-1, 1), -TOE_OUT - random.uniform(-3, 9))
    base[Body.PITCH] = lean
    base[Body.SINK] = 0.0 if seated else 0.002
    return base


def time_along(random: Random, now: float, start: float, last: float, apart: tuple[float, float]) -> float:
    """When a part of the body moves along with a gesture: a little before it, and not too soon after its last move.

    Args:
        random: drawn from once.
        now: of the tick, seconds.
        start: of the gesture.
        last: when the part began to move last.
        apart: least and most seconds from there on.
    """
    return max(now, start - _EARLIER, last + random.uniform(*apart))


def _leg_columns(left: bool) -> tuple[slice, int, int]:
    """Columns of a foot: place, lift, tip."""
    foot = (Body.LEFT_FOOT, Body.LEFT_LIFT, Body.LEFT_TIP)
    return foot if left else (Body.RIGHT_FOOT, Body.RIGHT_LIFT, Body.RIGHT_TIP)


def _hump(columns: int | slice, height: float | Array) -> Array:
    """(channels,) of an arc on some of them."""
    arc = np.zeros(BODY_CHANNELS)
    arc[columns] = height
    return arc


def _pivot(foot: Array, yaw: float) -> tuple[Array, Array]:
    """Where a foot ``(x, z, yaw)`` is after it has turned about its ball, and by how much its way there leaves the chord."""
    angles = np.radians([foot[2], (foot[2] + yaw) / 2, yaw])
    offsets = BALL * np.stack([np.sin(angles), np.cos(angles)], 1)
    middle = offsets[0] - offsets[1] - (offsets[0] - offsets[2]) / 2
    return np.array([*(foot[:2] + offsets[0] - offsets[2]), yaw]), np.array([*middle, 0.0])


class Stance:
    """Plans hips, feet and breath of one take.

    Args:
        track: of the body; moves are set on it.
        random: drawn from in tick order.
        amounts: how much.
    """

    def __init__(self, track: MinimumJerkTrack, random: Random, amounts: StanceAmounts) -> None:
        self.track, self._random, self.amounts = track, random, amounts
        self._left = random.random() < 0.5
        self._heading = 0.0
        self._breathed = -9.0
        self._lasts = 0.0
        self._begun = {"shift": -9.0, "turn": -9.0}
        self._next = {
            "shift": random.uniform(0.2, 1.5),
            "turn": random.uniform(0.5, 2.0),
            "breath": random.uniform(0.0, 2.0),
            "step": self._step_gap(),
            "legs": random.uniform(1.0, 5.0) if amounts.seated else np.inf,
        }
        self._top_leg = ""  # the leg that lies over the other's knee
        self._follow: float | None = None
        self._down = 0.0  # when the foot that steps, or turns about its ball, stands again
        self._settled = False

    def decide(self, now: float, *, speaking: bool = True) -> None:
        """One tick, at ``now`` seconds; every move that it sets begins later."""
        if not self._settled:
            self._settled = True
            self._shift(-5.0)
            self._turn(-5.0)
        calm = 1.0 if speaking else 2.4
        if now >= self._next["breath"]:
            self._breathe(now, now + 0.02, self._random.uniform(0.9, 1.3), self._random.uniform(1.5, 2.4))
        if now >= self._next["turn"]:
            self._turn(now)
            self._next["turn"] = now + self._random.uniform(*_TURNS) * calm
        if now >= max(self._next["shift"], self._down):
            self._shift(now)
            self._next["shift"] = now + self._random.uniform(*_SHIFTS) * calm / min(max(self.amounts.sway, 0.4), 1.0)
        if now >= max(self._next["step"], self._down):
            self._step(now)
        if now >= self._next["legs"]:
            self._move_legs(now)

    def schedule(self) -> dict[str, Any]:
        """Times and states of the plan, without the place of the body."""
        own = {name: getattr(self, name) for name in _SCHEDULE}
        return own | {name: dict(getattr(self, name)) for name in _TIMES}

    def follow(self, schedule: Mapping[str, Any]) -> None:
        """Go on from the schedule of another stance."""
        for name, value in schedule.items():
            setattr(self, name, dict(value) if name in _TIMES else value)

    def begin_phrase(self, now: float, start: float) -> None:
        """Speech begins at ``start`` seconds: before it comes a quick breath, and often a shift of the weight."""
        if start - self._breathed > 1.6:
            self._breathe(now, max(now + 0.02, start - 0.5), self._random.uniform(0.42, 0.6), self._random.uniform(2.2, 3.6))
        if self._random.random() < 0.35:
            self._next["shift"] = min(self._next["shift"], now + self._random.uniform(0, 0.5))

    def begin_gesture(self, now: float, start: float, length: float, size: float) -> None:
        """Hands begin to move: often weight and pelvis move with them.

        Args:
            now: of the tick, seconds.
            start: of the movement, seconds.
            length: of the movement, seconds.
            size: of the movement, arm lengths.
        """
        if self._random.random() < (size / _LARGE) ** 2:
            self._lasts = min(max(_OVERLAP * length, _LASTS[0]), _LASTS[1])
            for move in ("shift", "turn"):
                self._next[move] = min(self._next[move], time_along(self._random, now, start, self._begun[move], _APART))

    def _gauss(self, size: float) -> float:
        return min(max(self._random.gauss(0, size), -2.2 * size), 2.2 * size)

    def _breathe(self, now: float, onset: float, inward: float, outward: float) -> None:
        """In and out; speech begins on full lungs and lets them go slowly."""
        depth = self._random.uniform(0.75, 1.15)
        self.track.move(onset, inward, np.array([depth]), [Body.BREATH], skew=-0.2)
        self.track.move(onset + inward * 0.95, outward, np.array([0.0]), [Body.BREATH], skew=0.3)
        self._breathed = onset
        self._next["breath"] = onset + inward + outward + self._random.uniform(0.1, 0.5)

    def _feet(self) -> tuple[Array, Array]:
        """Where the left and the right foot come to stand."""
        return self.track.target[Body.LEFT_FOOT], self.track.target[Body.RIGHT_FOOT]

    def _turn(self, now: float) -> None:
        """The pelvis turns and tilts a little."""
        self._begun["turn"] = now
        sway = 0.8 * self.amounts.sway if self.amounts.seated else self.amounts.sway**0.5
        goal = (self._gauss(7.0 * sway), self._gauss(2.2 * sway))
        length = self._random.uniform(0.7, 1.4)
        self.track.move(now + 0.02, length, np.array(goal), [Body.HIPS_YAW, Body.HIPS_PITCH], skew=self._gauss(0.25))
        steps = not self.amounts.seated and self.amounts.steps > 0
        if steps and abs(goal[0]) > 8.0 and self._random.random() < 0.25:  # turned far: the feet come after
            self._next["step"] = min(self._next["step"], now + 0.8 * length)

    def _shift(self, now: float) -> None:
        """Onto one leg, or in between: the pelvis goes over the foot, its free side sinks, the free knee bends."""
        self._begun["shift"] = now
        if self.amounts.seated:
            self._shift_seat(now)
            return
        left, right = self._feet()
        sway = min(self.amounts.sway, 1.35)
        kind = self._random.random()
        depth = self._random.uniform(0.7, 1.0) if kind < 0.75 else self._random.uniform(0.2, 0.5) if kind < 0.92 else 0.05
        self._left = not self._left if self._random.random() < 0.85 else self._left
        side = 1.0 if self._left else -1.0
        width = min((left[0] - right[0]) / 2, 0.14)
        goal = np.array(
            [
                (left[0] + right[0]) / 2 + side * width * depth * min(0.35 + 0.65 * sway, 1.1),
                (left[1] + right[1]) / 2 + _BEFORE + self._gauss(0.024 * sway),
                self._random.uniform(0.0, 0.003) + (1 - depth) * self._random.uniform(0.0, 0.036) * sway,
                -side * self._random.uniform(0.0, 1.5) * sway,
            ]
        )
        length = self._lasts or self._random.uniform(*_GLIDES)
        self._lasts = 0.0
        columns = [Body.HIPS_X, Body.HIPS_Z, Body.SINK, Body.HIPS_ROLL]
        self.track.move(now + 0.02, length, goal, columns, skew=self._gauss(0.25))
        self._free_heel(now, length, depth)

    def _free_heel(self, now: float, length: float, depth: float) -> None:
        """Where the weight leaves a foot, its heel often rises, and the foot turns about its ball."""
        self.track.move(now + 0.02, 0.5, np.array([0.0]), [_FREE[not self._left]])
        tip = self._random.uniform(6, 24) * min(self.amounts.sway, 1.2) if self._random.random() < 1.2 * depth - 0.1 else 0.0
        self.track.move(now + 0.35 * length, 0.7, np.array([tip]), [_FREE[self._left]])
        if tip < _PIVOTS or self.amounts.steps <= 0 or self._random.random() < 0.3:
            return
        foot, _, _ = _leg_columns(not self._left)
        side = -1.0 if self._left else 1.0
        goal, arc = _pivot(self.track.target[foot], self._heading + side * (TOE_OUT + self._random.uniform(-8, 14)))
        begin, turning = now + 0.35 * length + 0.3, self._random.uniform(0.45, 0.75)
        self.track.move(begin, turning, goal, foot, arc=_hump(foot, arc))
        self._down = begin + turning

    def _shift_seat(self, now: float) -> None:
        """From one side of the seat to the other, upright or sunk."""
        sway = max(self.amounts.sway, 0.3)
        self._left = not self._left
        side = 1.0 if self._left else -1.0
        slump = self._random.uniform(-5.0, 9.0) * sway
        goal = (
            side * self._random.uniform(0.002, 0.011),
            self._gauss(0.004),
            side * self._random.uniform(0.5, 5.5) * sway,
            -slump,
        )
        columns = [Body.HIPS_X, Body.HIPS_Z, Body.HIPS_ROLL, Body.HIPS_PITCH]
        self.track.move(now + 0.02, self._random.uniform(1.0, 1.8), np.array(goal), columns, skew=self._gauss(0.25))

    def _move_legs(self, now: float) -> None:
        """A seated body crosses its legs, takes them apart again, stretches one, draws one in, or puts a foot elsewhere."""
        self._next["legs"] = now + self._random.uniform(3.5, 9.0) / max(self.amounts.sway, 0.4) ** 0.5
        if self._top_leg:
            self._uncross(now)
            return
        left = self._random.random() < 0.5
        kind = self._random.random()
        if kind < 0.3 and self.amounts.sway > 0.5:
            self._cross(now, left)
            return
        reach = self._random.uniform(0.12, 0.2) if kind < 0.5 else self._random.uniform(-0.17, 0.1)
        self._put(now, left, self._random.uniform(0.9, 2.0) * STANCE, reach, self._random.uniform(-6, 10))

    def _put(self, now: float, left: bool, aside: float, ahead: float, out: float) -> None:
        """Move a seated body's foot to another place on the floor."""
        side = 1.0 if left else -1.0
        goal = np.array([side * aside, ahead, side * (TOE_OUT + out)])
        self._swing(now + 0.38, Body.LEFT_FOOT if left else Body.RIGHT_FOOT, goal, 0.4, 0.022)

    def _cross(self, now: float, left: bool) -> None:
        """One leg over the other's knee: it rises in front, goes across, and comes to lie."""
        side, other = (1.0, Body.RIGHT_FOOT) if left else (-1.0, Body.LEFT_FOOT)
        begin = now + 0.1
        if np.abs(self.track.target[other] - [-side * STANCE, 0.03, -side * TOE_OUT]).max() > 0.05:  # below the other knee
            self._put(now, not left, STANCE, 0.03, 0.0)
            begin = now + 0.9
        foot, lift, tip = _leg_columns(left)
        self.track.move(begin, 0.9, np.array([_OVER]), [lift], arc=_hump(lift, 0.04))
        self.track.move(begin, 0.8, np.array([self._random.uniform(4.0, 12.0)]), [tip])
        across = np.array([-side * self._random.uniform(0.13, 0.17), self._random.uniform(0.04, 0.08), -side * 17.0])
        self.track.move(begin + 0.35, 0.8, across, foot)
        self._top_leg = "left" if left else "right"
        self._next["legs"] = begin + self._random.uniform(8.0, 20.0)
        self._next["turn"] = min(self._next["turn"], now)

    def _uncross(self, now: float) -> None:
        left = self._top_leg == "left"
        side = 1.0 if left else -1.0
        foot, lift, tip = _leg_columns(left)
        place = np.array([side * STANCE * self._random.uniform(0.9, 1.3), self._random.uniform(-0.06, 0.1), side * TOE_OUT])
        self.track.move(now + 0.1, 0.8, place, foot)
        self.track.move(now + 0.25, 0.95, np.array([0.0]), [lift], arc=_hump(lift, 0.04))
        self.track.move(now + 0.4, 0.7, np.array([0.0]), [tip])
        self._top_leg = ""

    def _step_gap(self) -> float:
        per_minute = 0.0 if self.amounts.seated else self.amounts.steps
        return self._random.expovariate(per_minute / 100) + 1.5 if per_minute > 0 else 1e12  # three in five bring a second one

    def _step(self, now: float) -> None:
        """The unloaded foot steps towards where the pelvis is turned; the weight follows, and often the other foot."""
        self._next["step"] = now + self._step_gap()
        if self._follow is None:
            heading = _KEEPS * self._heading + 0.7 * float(self.track.target[Body.HIPS_YAW]) + self._gauss(5.0)
            self._heading = float(np.clip(heading, -_MOST_TURN, _MOST_TURN))
            self._follow = self._heading if self._random.random() < 0.6 else None
            if self._follow is not None:
                self._next["step"] = now + self._random.uniform(1.5, 2.2)
        else:
            self._follow = None
            self._left = not self._left
        left_goes = not self._left
        foot, other = (Body.LEFT_FOOT, Body.RIGHT_FOOT) if left_goes else (Body.RIGHT_FOOT, Body.LEFT_FOOT)
        side, still = (1 if left_goes else -1), self.track.target[other]
        apart, ahead = 2 * STANCE * self._random.uniform(*_WIDTHS), self._random.uniform(-0.13, 0.13)
        turn = np.radians(self._heading)
        goal = np.array(
            [
                np.clip(still[0] + side * apart * np.cos(turn) + ahead * np.sin(turn), -_ROOM[0] - STANCE, _ROOM[0] + STANCE),
                np.clip(still[1] - side * apart * np.sin(turn) + ahead * np.cos(turn), -_ROOM[1], _ROOM[1]),
                self._heading + side * (TOE_OUT + self._random.uniform(-5, 8)),
            ]
        )
        if side * (goal[0] - still[0]) < 0.17:  # never across the other foot
            goal[0] = still[0] + side * 0.17
        self.track.move(now + 0.02, 1.1, np.array([0.72 * still[0] + 0.28 * goal[0], 0.006]), [Body.HIPS_X, Body.SINK])
        self.track.move(now + 0.02, 0.4, np.array([0.0]), [_FREE[not self._left]])
        length, lifts = self._random.uniform(0.36, 0.48), now + _LEANS
        self._down = lifts + length + 0.3
        self._swing(lifts, foot, goal, length, 0.04)
        middle = (goal[:2] + still[:2]) / 2 + np.array([side * 0.02, _BEFORE])
        columns = [Body.HIPS_X, Body.HIPS_Z, Body.SINK]
        self.track.move(lifts + 0.55 * length, 1.5, np.array([*middle, 0.002]), columns, skew=0.2)
        self._next["shift"] = max(self._next["shift"], lifts + length + 0.9)

    def _swing(self, onset: float, foot: slice, goal: Array, length: float, height: float) -> None:
        """Heel off, foot through the air, heel down, sole down; the foot travels only while it is off the floor.

        The heel comes off .34 s before ``onset``, and that must not be in the past.
        """
        _, lift, tip = _leg_columns(foot == Body.LEFT_FOOT)
        self.track.move(onset - 0.34, 0.50, np.array([16.0]), [tip])
        self.track.move(onset - 0.11, 0.30, np.array([height]), [lift])
        self.track.move(onset + 0.06, length, goal, foot)
        self.track.move(onset + 0.12, length * 0.8, np.array([-7.0]), [tip])
        self.track.move(onset + length - 0.06, 0.30, np.array([0.0]), [lift])
        self.track.move(onset + length + 0.14, 0.28, np.array([0.0]), [tip])
