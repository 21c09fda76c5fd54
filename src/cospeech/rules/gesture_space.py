"""Where this speaker, in this mood, puts the poses of a gesture form this time; and how long hands take to get there."""

from __future__ import annotations

from itertools import pairwise
from random import Random

import numpy as np

from ..motion.kinematics.arms import arm_lengths
from ..motion.kinematics.hands import HAND_SHAPES, HAND_VARIANTS
from ..motion.rotations import Array
from .emotion_modifiers import EmotionModifier
from .gesture import GestureOverride
from .minimum_jerk import PEAK
from .repertoire import FORMS, Form, HandPose
from .rest_poses import RESTS
from .styles import Style

__all__ = [
    "SHAPES", "GesturePlacement", "keep_beside_face", "reach_time", "shortest_reach_time", "stroke_time", "stroke_times",
]  # fmt: skip

_WORD_SCORE = 0.5  # semantic score from which the hand shape of a form is part of what it says (ours)
_LEFT = 0  # row of `RESTS`
_SPACE = np.array([0.09, 0.055, -0.13])  # arm lengths from the table's places to where speakers gesture most (motion.md §1)
_ROOM = np.array([0.95, 1.5, 1.1])  # strokes of speakers are higher than those of the table (motion.md: SD of height)
_OWN_SIDE = -0.18  # arm lengths outward of its shoulder: the other hand comes no further inward, to the leader's side (ours)
_LAP = -0.42
"""Arm lengths above the shoulder at which the strokes of a seated body end, at the lowest. Ours: palms touch the mannequin's
thighs at -.60, and a beat from there needs room."""
_BOX = np.array([(-0.30, -0.76, 0.06), (0.62, 0.32, 0.84)])  # arm lengths: where strokes may go at all (ours)
_BESIDE = np.array([(-0.40, -0.30), (-0.12, 0.22), (0.15, 0.38)])
"""Arm lengths above and outward of the shoulder: how far inward a hand may go at what height. Ours: a hand as high as the
mouth is beside it, or it hides the mouth."""

_FASTEST = 2.0  # m/s; no single move peaks above it (ours: 99 % of wrist speeds of people are below 2.8, motion.md §1)
_HURRY = 2.3  # m/s at which the fastest reach peaks (ours, from the same figure)
_HAND_VARIETY = (11.0, 12.0, 7.0)
"""Degrees of pronation, flexion and deviation by which a hand is turned otherwise than in the table. [ours: the wrist of a
recorded speaker turns twice as far and as fast as one that keeps to the table]"""
_MOST_HIGHER = 0.3  # arm lengths by which a gesture is higher or lower than usual, at most (ours)
_PARALLEL, _ALONG = 0.5, -0.7
"""How often both hands go to the same side, and how far the other hand goes there, to the leader (ours: two recorded speakers
move both hands at once, but mirror them little)."""

SHAPES = HAND_SHAPES | HAND_VARIANTS
SHAPE_KIN: dict[str, tuple[str, ...]] = {
    "relaxed": ("curl", "cradle"),
    "soft_open": ("fan", "cradle", "curl"),
    "open": ("fan", "wide", "cradle"),
    "spread": ("wide",),
    "bowl": ("cup", "cradle", "claw"),
    "frame": ("tent", "cup"),
    "ring": ("purse", "pinch"),
    "point": ("lazy_point",),
    "point_soft": ("lazy_point",),
    "loose_fist": ("half_fist", "curl"),
    "fist": ("half_fist", "purse"),
    "flat": ("tent", "fan"),
}
"""Hand shape -> others that serve as well in a form that carries no word; ours."""


class GesturePlacement:
    """The gesture space of one take.

    Args:
        style: the speaker.
        random: drawn from in the order of planning.
        intensity: overall size.
        temperature: freedom, 0 … 2.
    """

    def __init__(self, style: Style, random: Random, intensity: float, temperature: float) -> None:
        self.style, self._random, self.intensity, self.temperature = style, random, intensity, temperature

    def of(self, form: Form, effort: float, modifier: EmotionModifier) -> list[Array]:
        """Poses of a form where this speaker, in this mood, would put them this time."""
        style, free = self.style, self.temperature * (0.5 + 0.5 * modifier.variety)
        table = [self._with_hand(p, form) for p in form.poses]
        if form.anchored:
            return [self._shape_pose(t, 0.0, effort, modifier, free) for t in table]
        middle = np.mean([t[:3] for t in table], axis=0)
        low = self._random.uniform
        higher = min(max(self._random.gauss(0.09, 0.19), -_MOST_HIGHER), _MOST_HIGHER)
        shift = np.array([self._random.gauss(0, 0.045), higher, self._random.gauss(0, 0.04)]) * free
        centre = middle + shift
        centre += (style.breadth + modifier.breadth, style.height + modifier.height, style.forward)
        centre += _SPACE
        scale = effort * low(1 - 0.15 * free, 1 + 0.18 * free)
        spread = min(1.0, 0.3 + 0.7 * modifier.amplitude * style.amplitude * self.intensity)  # small movers stay near the body
        home = np.array([0.04, -0.52, 0.34])
        centre = home + (centre - home) * spread
        turn = self._random.gauss(0, 7) * free
        out = []
        for t in table:
            pose = self._shape_pose(t, turn, effort, modifier, free)
            pose[:3] = centre + (t[:3] - middle) * scale * _ROOM
            pose[:3] = np.minimum(np.maximum(pose[:3], _BOX[0]), _BOX[1])
            keep_beside_face(pose)
            in_front = 0.06 + 0.42 * min(max(float(pose[1]) + 0.75, 0.0), 1.0)  # raised hands stay in front of the shoulder
            pose[2] = max(pose[2], in_front)
            out.append(pose)
        if style.seated:  # strokes end above the thighs, or their peaks of speed would be where the thighs stop them
            rise = max(_LAP - min(pose[1] for pose in out), 0.0)
            for pose in out:
                pose[1] += rise
        return out

    def _with_hand(self, pose: HandPose, form: Form) -> Array:
        """The values of a pose; where no word asks for its hand shape, often with one that serves as well."""
        values, kin = pose.values(), SHAPE_KIN.get(pose.shape, ())
        if form.score < _WORD_SCORE and kin and self._random.random() < 0.6 * min(self.temperature, 1.0):
            values[7:19] = SHAPES[self._random.choice(kin)].values()
        return values

    def _shape_pose(self, table: Array, turn: float, effort: float, modifier: EmotionModifier, free: float) -> Array:
        """A pose where the table has it, turned and shaped by this speaker's hand."""
        tension = min(max(self.style.tension + modifier.tension, 0.0), 1.0)
        pose = table.copy()
        pose[4:7] += [self._random.gauss(0, size) * free for size in _HAND_VARIETY]
        pose[4] += turn
        pose[5:7] *= min(1.2, 0.7 + 0.3 * effort)
        pose[7:19] = self._shape(pose[7:19], tension, free)
        pose[3] += self._random.gauss(0, 10) * free
        pose[19] += modifier.shrug
        return pose

    def _shape(self, shape: Array, tension: float, free: float) -> Array:
        """Finger angles loosened or stiffened, and never twice the same."""
        base = FORMS["beat"].poses[0].values()[7:19]
        loose = 0.15 * (1 - tension)
        out = shape + (base - shape) * loose
        return out + np.array([self._random.gauss(0, 3.0) * free for _ in out])

    def follower(self, poses: list[Array], strength: float, *, mirrors: bool) -> list[Array]:
        """The other hand of a two-handed gesture: smaller, lower, and not exactly mirrored.

        Args:
            poses: of the leader.
            strength: of the accent, 0 … 1.
            mirrors: it never goes to the same side as the leader, because the gesture says something with both hands.
        """
        side = _ALONG if not mirrors and self._random.random() < _PARALLEL else 1.0
        loose = 1 - self.style.symmetry
        rest = RESTS[self.style.rest][_LEFT].values()
        less = 1 - self._random.uniform(0.0, 0.25 + 0.5 * loose)  # of the way from the first pose on
        drop = loose * 0.3 * (1.2 - strength)
        off = np.array([self._random.gauss(0, 0.035 + 0.06 * loose) for _ in range(3)])
        soft, slack = SHAPES[self._random.choice(("relaxed", "curl", "cradle"))].values(), self._random.uniform(0, 0.6) * less
        out = []
        for pose in poses:
            own = pose.copy()
            way = (pose - poses[0])[:7] * less
            way[0] *= side
            own[:7] = poses[0][:7] + way
            own[:3] += (rest[:3] - own[:3]) * drop + off + [self._random.gauss(0, 0.02 + 0.05 * loose) for _ in range(3)]
            own[4:7] += [self._random.gauss(0, size) for size in (12, 10, 6)]
            own[0], own[1] = max(own[0], _OWN_SIDE), max(own[1], _BOX[0][1])
            keep_beside_face(own)
            own[7:19] += (soft - own[7:19]) * slack
            out.append(own)
        return out


def stroke_time(a: Array, b: Array, tempo: float, modifier: EmotionModifier) -> float:
    """Seconds for a stroke: longer ways take longer, but less than in proportion (ours, to motion.md's stroke rows)."""
    way = _metres(a, b)
    usual = (0.36 + 0.56 * way) / tempo * (1 - 0.26 * modifier.abrupt)
    return max(0.26, usual, PEAK * way / _FASTEST)


def stroke_times(
    usual: float, poses: list[Array], tempo: float, modifier: EmotionModifier, override: GestureOverride | None
) -> list[float]:
    """Seconds of each stroke; ``usual`` are those of the first, if there is no override."""
    lengths = [usual, *(stroke_time(a, b, tempo, modifier) for a, b in pairwise(poses[1:]))]
    return override.slow_down(lengths) if override else lengths


def keep_beside_face(pose: Array) -> None:
    """Move a high hand outward if it is in front of the face."""
    pose[0] = max(pose[0], float(np.interp(pose[1], *_BESIDE.T)))


def reach_time(a: Array, b: Array, tempo: float) -> float:
    """Seconds for an unhurried reach, peak speed about 1.2 m/s."""
    way = _metres(a, b)
    turn = abs(float(b[4] - a[4])) / 90
    return max(max(0.40, 0.38 + 0.72 * way**0.8, 0.36 * turn + 0.28) / tempo**0.7, PEAK * way / _FASTEST)


def shortest_reach_time(a: Array, b: Array, tempo: float) -> float:
    """Seconds of the fastest reach."""
    return PEAK * _metres(a, b) / (_HURRY * tempo**0.7)


def _metres(a: Array, b: Array) -> float:
    """From one pose of a hand to another."""
    return float(np.linalg.norm(b[:3] - a[:3])) * arm_lengths().total
