"""Gaze: the directions in which a speaker looks, and the eyes of a finished body that look there.

The plan is a list of saccades in the world, relative to the direction of the listener. It knows phrases only, never a head. The
eyes are computed last, against the head that the motion ends up with, whichever system turned it: the eyes then stay on the
listener while the head moves (the vestibulo-ocular reflex).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from random import Random
from typing import NamedTuple, Protocol

import numpy as np

from ..audio.prosodic_events import Phrase
from ..motion.curves import clip
from ..motion.rotations import Array, euler_to_quat, quat_conjugate, quat_multiply, quat_rotate, quat_to_euler
from ..motion.skeleton import humanoid
from ..motion.skeletons.arkit import ARKIT_INDEX

__all__ = [
    "LISTENER", "Gaze", "GazePlanner", "Saccade", "complete_looks", "direction_of", "eye_angles", "head_rotation",
    "limit_eyes", "look", "read_looks", "toward", "write_looks",
]  # fmt: skip

LISTENER = 2.0
"""Metres from the speaker to the listener, in front of where the speaker stands at rest: social distance (Hall 1966)."""
_EYE = 0.0315  # m from the middle of the face to a pupil: half of 63 mm (Dodgson 2004, mean of adults)
_LIMIT = np.radians([38.0, 28.0])  # [ours] eyes in the head, sideways, up and down: 45° is the most that people reach
_FREE = 0.75  # [ours] share of the limit up to which eyes turn as far as is asked
_FULL = (0.56, 0.44)  # rad of yaw and pitch at weight 1 of eyeLook* [ours: what ARKit reports near the limits of comfort]
_LID_FOLLOWS, _LID_LIFTS = 0.28, 0.15  # [ours] lid lowered per unit of eyeLookDown, widened per unit of eyeLookUp

_PLANS = 0.36  # [ours] chance, at a share of .25 averted, that a speaker looks away as a phrase begins (Kendon 1967: most do)
_BACK = 0.30  # s before the end of a phrase at which the eyes are back (Kendon 1967: speakers look up as they end)
_GLANCE = 0.09  # [ours] chance of a glance away at a change of fixation within a phrase, at a share of .25 averted
_USUAL = 0.25  # the share averted that the two chances above hold for
_MOST = 0.75  # [ours] no chance is larger
_GAP = 0.12  # s between saccades at least: the refractory time is 100–200 ms (Becker 1991)


class Saccade(NamedTuple):
    """The eyes jump."""

    time: float
    """Seconds."""
    yaw: float
    """Degrees to the character's left of the listener."""
    up: float
    """Degrees above the listener's eyes."""
    length: float
    """Seconds that the jump takes."""


class Gaze(Protocol):
    """Who says where the eyes go: a `GazePlanner`, or a plan."""

    averted: float
    away: bool

    def decide(self, now: float, phrases: Sequence[Phrase], averted: float = 0.0) -> Saccade | None:
        """One tick: a saccade that begins now, or none."""
        ...


class GazePlanner:
    """Plans the gaze of one take, tick by tick.

    While the speaker plans what to say, the eyes glance away; before a phrase ends they return to the listener, and in between
    they go from one of the listener's eyes to the other and to the mouth every 1–4 s (motion.md §1).

    Args:
        seed: of the take.
        averted: 0 … 1, how much the speaker looks away; see `cospeech.rules.styles.Style.averted`.
    """

    def __init__(self, seed: int, averted: float) -> None:
        self._random, self.averted = Random(seed), averted
        self.away = False
        """Whether the eyes are off the listener."""
        self._at = (0.0, 0.0)
        self._next, self._last = 0.4, -1.0
        self._phrase, self._ended = -1.0, -1.0

    def decide(self, now: float, phrases: Sequence[Phrase], averted: float = 0.0) -> Saccade | None:
        """One tick: a saccade that begins now, or none.

        Args:
            now: seconds.
            phrases: those that are known, in order; the end of the last may still move.
            averted: added to the speaker's own share; of the emotion.
        """
        chance = (min(max(self.averted + averted, 0.0), 1.0) / _USUAL) ** 0.5  # a shy speaker looks away more, not all the time
        for phrase in phrases:
            if phrase.start > self._phrase and phrase.start <= now + 0.35:
                self._phrase = phrase.start
                if self._random.random() < min(_PLANS * chance, _MOST):
                    return self._glance(now, self._random.uniform(0.4, 0.9))
            if self.away and self._ended < phrase.start and now < phrase.end <= now + _BACK:
                self._ended = phrase.start
                return self._return(now)
        if now < self._next:
            return None
        if self.away:
            return self._return(now)
        if self._random.random() < min(_GLANCE * chance, _MOST):
            return self._glance(now, self._random.uniform(0.3, 0.8))
        return self._return(now)

    def _glance(self, now: float, lasts: float) -> Saccade | None:
        """Away from the listener, mostly to a side and down, now and then up."""
        side = self._random.choice((-1, 1)) * self._random.uniform(13, 24)
        return self._jump(now, (side, self._random.choice((-12.0, -9.0, -6.0, -3.0, 6.0, 9.0))), lasts, away=True)

    def _return(self, now: float) -> Saccade | None:
        """To one of the listener's eyes or the mouth, which lie within 2°."""
        place = (self._random.choice((-1.0, 1.0)) * self._random.uniform(0.3, 1.2), self._random.choice((0.0, 0.3, -1.6)))
        return self._jump(now, place, self._random.uniform(0.9, 3.6), away=False)

    def _jump(self, now: float, goal: tuple[float, float], lasts: float, *, away: bool) -> Saccade | None:
        if now < self._last + _GAP:
            return None
        way = float(np.hypot(goal[0] - self._at[0], goal[1] - self._at[1]))
        self.away, self._at, self._last, self._next = away, goal, now, now + lasts
        return Saccade(now + 0.02, *goal, 0.025 + 0.0025 * way)  # main sequence: 2.2 ms per degree and 21 ms (Carpenter 1988)


def direction_of(rotations: Array) -> Array:
    """(N, 4) of an eye → (N, 2) yaw to the left and pitch up, radians."""
    ahead = quat_rotate(rotations, np.array([0.0, 0.0, 1.0]))
    return np.stack([np.arctan2(ahead[:, 0], ahead[:, 2]), np.arcsin(clip(ahead[:, 1], -1.0, 1.0))], -1)


def toward(gaze: Array) -> Array:
    """(…, 2) yaw to the left and pitch up, radians → (…, 4) rotation."""
    angles = np.zeros((*gaze.shape[:-1], 3))
    angles[..., 0], angles[..., 1] = gaze[..., 0], -gaze[..., 1]
    return euler_to_quat(angles, "YXZ")


@cache
def _chain() -> tuple[list[int], list[int]]:
    joint = humanoid().index
    return [joint[n] for n in ("hips", "spine", "chest", "upperChest", "neck", "head")], [joint["leftEye"], joint["rightEye"]]


def head_rotation(rotations: Array) -> Array:
    """(N, 4) of the head in the world, of a body (N, J, 4) of our humanoid."""
    locals_ = rotations[:, _chain()[0]].astype(float)
    head = locals_[:, 0]
    for k in range(1, locals_.shape[1]):
        head = quat_multiply(head, locals_[:, k])
    return head


def eye_angles(rotations: Array, root: Array, gaze: Array) -> Array:
    """The angles of both eyes in a head, so that they look where it is planned.

    Args:
        rotations: (N, J, 4) of a body of our humanoid, local.
        root: (N, 3) places of its hips, metres.
        gaze: (N, 2) planned, relative to the listener: yaw to the left and pitch up, radians.

    Returns:
        (N, 2, 2) radians: left and right eye; yaw to the left and pitch up. Both meet at the distance of the listener.
    """
    head = head_rotation(rotations)
    shift = root.astype(float) - humanoid().offsets[0]
    yaw, up = gaze[:, 0] + np.arctan2(-shift[:, 0], LISTENER - shift[:, 2]), gaze[:, 1]
    aim = np.stack([np.sin(yaw) * np.cos(up), np.sin(up), np.cos(yaw) * np.cos(up)], -1)
    aim = quat_rotate(quat_conjugate(head), aim)
    angles = np.stack([np.arctan2(aim[:, 0], aim[:, 2]), np.arcsin(clip(aim[:, 1], -1.0, 1.0))], -1)
    angles = limit_eyes(angles)
    inward = np.arctan(_EYE / LISTENER)
    return np.stack([angles - [inward, 0.0], angles + [inward, 0.0]], 1)


def limit_eyes(angles: Array) -> Array:
    """(…, 2) yaw and pitch of an eye in the head, radians, as far as eyes turn."""
    size, free = np.abs(angles), _FREE * _LIMIT
    beyond = np.maximum(size - free, 0.0)
    return np.asarray(np.sign(angles) * (np.minimum(size, free) + (_LIMIT - free) * np.tanh(beyond / (_LIMIT - free))))


def look(rotations: Array, angles: Array) -> Array:
    """(N, J, 4) of a body with its eyes turned by (N, 2, 2) `eye_angles`; the same type of numbers."""
    body = rotations.copy()
    body[:, _chain()[1]] = toward(angles)
    return body


def _columns(name: str) -> slice:
    """Those of the left and the right side."""
    left, right = (ARKIT_INDEX[name + side] for side in ("Left", "Right"))
    return slice(left, right + 1, right - left)


_OUT, _IN, _UP, _DOWN = (_columns("eyeLook" + way) for way in ("Out", "In", "Up", "Down"))
_BLINK, _WIDE = _columns("eyeBlink"), _columns("eyeWide")
_SIDES = np.array([1.0, -1.0])


def write_looks(weights: Array, angles: Array) -> Array:
    """(N, 52) weights whose eyeLook* are those of eyes at (N, 2, 2) `eye_angles`; large angles give weights above 1."""
    out = weights.copy()
    outward = angles[:, :, 0] / _FULL[0] * _SIDES
    up = angles[:, :, 1] / _FULL[1]
    out[:, _OUT], out[:, _IN] = np.maximum(outward, 0.0), np.maximum(-outward, 0.0)
    out[:, _UP], out[:, _DOWN] = np.maximum(up, 0.0), np.maximum(-up, 0.0)
    return out


def complete_looks(weights: Array, rotations: Array) -> Array:
    """A face (N, 52); where it has no eyeLook*, it gets those of two eyes that have the same rotations (N, 4)."""
    if any(weights[:, columns].any() for columns in (_OUT, _IN, _UP, _DOWN)):
        return weights
    angles = quat_to_euler(rotations, "YXZ")[:, None, :2] * (1, -1)
    return np.clip(write_looks(weights, np.repeat(angles, 2, 1)), 0, 1)  # type: ignore[no-any-return]


def read_looks(weights: Array) -> Array:
    """(N, 2, 2) `eye_angles` that the eyeLook* of (N, 52) weights say."""
    outward, up = weights[:, _OUT] - weights[:, _IN], weights[:, _UP] - weights[:, _DOWN]
    return np.stack([outward * _SIDES * _FULL[0], up * _FULL[1]], -1)


def lids_and_looks(weights: Array, angles: Array) -> Array:
    """Add the direction of the eyes to a face, and lids that follow them.

    Args:
        weights: (N, 52), with the lids of eyes that look straight ahead.
        angles: (N, 2, 2), see `eye_angles`.

    Returns:
        (N, 52) with eyeLook*. The upper lids come down as the gaze falls, as far as a blink leaves them open, and open wider
        as it rises.
    """
    out = write_looks(weights, angles)
    shut = out[:, _BLINK].copy()
    out[:, _BLINK] = 1 - (1 - shut) * (1 - _LID_FOLLOWS * np.minimum(out[:, _DOWN], 1.0))
    out[:, _WIDE] += _LID_LIFTS * out[:, _UP] * (1 - shut)
    return clip(out, 0.0, 1.0)
