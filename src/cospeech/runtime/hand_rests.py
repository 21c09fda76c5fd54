"""Hands that come down while somebody speaks, between bouts of gestures, as people's do; ours.

The hands of a network hover in front of the body for as long as there is speech. People gesture for some seconds, let the hands
down, and take them up again. Here bouts are drawn as the rules draw them (`cospeech.rules.bouts`), and the speech says when
exactly they end and begin: hands go down where no accent is near, and come up on an accent. Often one hand goes down, and the
other one goes on.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

import numpy as np

from ..audio.prosodic_events import Accent
from ..motion.part_joints import arm_joints
from ..motion.rotations import Array, quat_slerp
from ..motion.skeleton import humanoid
from ..rules.minimum_jerk import minimum_jerk
from .beat_alignment import LEAD, AccentTrack
from .frame_decisions import DECISION_RATE, FrameDecisions
from .rest_in_silence import resting_pose

__all__ = ["HandRests"]

_BUSY, _QUIET = (4.5, 10.0), (1.4, 3.2)
"""Seconds of a bout, and between bouts. [ours: about those of `cospeech.rules.bouts`; with longer rests, still spells are
longer than people's]"""
_DOWN, _UP = 1.2, 0.65
"""Seconds in which hands come to rest, and from there. [ours: with a quicker way down, beat lift falls; with a quicker way up,
the wrists of the chain jerk more]"""
_COMES = _UP / 2 + LEAD  # seconds before an accent at which hands begin to come up, to be fastest on it
_CLEAR = 0.7
"""Seconds without an accent that is no weak one, in which hands go down. [ours: with more, streams would have more lag]"""
_PAUSE = 1.6
"""Seconds without any accent after which a bout begins. [ours: hands have rested in silence then, see `RestInSilence`]"""
_LATE = 2.0  # seconds by which a bout ends later, at most, because accents follow; and begins later, until one comes [ours]
_WEAK = 0.3  # strength up to which an accent counts for nothing here [ours]
_BOTH = 0.5
"""How often both hands go down, and not one of them. [both hands of two recorded people are at rest for one half of the time in
which some hand is: `cospeech.metrics.REFERENCE`]"""
_MOST = 0.9  # how far hands come to rest [ours: as hands that are held, they live a little]


class HandRests:
    """Lets hands rest, in frames that come in pieces of any size; these come back the same.

    Args:
        fps: of the frames.
        track: of the accents; it is pushed first.
        seed: of the take.
    """

    look_ahead = 0.0
    """Seconds of motion after a frame that it waits for."""
    _foresight = max(_CLEAR, _COMES + 1 / DECISION_RATE)
    sound_ahead = _foresight + AccentTrack.delay
    """Seconds of 16 kHz sound after a frame that must have been heard."""

    def __init__(self, fps: float, track: AccentTrack, seed: int) -> None:
        self._track = track
        self._decisions = FrameDecisions(fps), FrameDecisions(fps)  # of the left hand, and of the right one
        self._random = Random(f"{seed}/rests")
        self._joints = arm_joints()
        self._side = np.array([humanoid().names[joint].startswith("right") for joint in self._joints], int)
        self._resting, self._until = [False, False], self._random.uniform(*_BUSY)  # which hands; until when, seconds
        self._places, self._last_accent = [0.0, 0.0], 0.0  # of the hands on their way; of the last accent, seconds
        self._rotations, self._root = np.zeros((0, len(humanoid()), 4), np.float32), np.zeros((0, 3), np.float32)

    def push(self, rotations: Array, root: Array) -> tuple[Array, Array]:
        """See `MotionLayer.push`."""
        self._rotations, self._root = np.concatenate([self._rotations, rotations]), np.concatenate([self._root, root])
        return self._give()

    def finish(self) -> tuple[Array, Array]:
        """See `MotionLayer.finish`."""
        return self._give()

    def _give(self) -> tuple[Array, Array]:
        """The frames of which it is known whether hands rest."""
        left = self._decisions[0]
        while left.lack(len(self._rotations)):
            now = left.count / DECISION_RATE
            if self._track.known < now + self._foresight:
                break
            self._decide(now)
            for decisions, place in zip(self._decisions, self._places, strict=True):
                decisions.add(place)
        places = np.stack([decisions.take(len(self._rotations)) for decisions in self._decisions], 1)
        share = _MOST * minimum_jerk(places)[:, self._side]  # (n, joints)
        rotations, root = self._rotations[: len(share)], self._root[: len(share)]
        if share.any():
            rotations = rotations.copy()
            rest = np.broadcast_to(resting_pose()[self._joints], (len(rotations), len(self._joints), 4)).astype(float)
            own = rotations[:, self._joints]
            blend = quat_slerp(own.astype(float), rest, share)
            rotations[:, self._joints] = np.where(share[..., None] > 0, blend, own)  # the bits of frames without a rest stay
        self._rotations, self._root = self._rotations[len(share) :], self._root[len(share) :]
        return rotations, root

    def _decide(self, now: float) -> None:
        """Move each hand on its way to rest, 0 … 1, to where it is at this time."""
        horizon = now + _COMES
        coming = self._track.between(horizon - 1 / DECISION_RATE, horizon)
        if coming:
            if horizon - self._last_accent > _PAUSE:
                self._resting, self._until = [False, False], now + self._random.uniform(*_BUSY)
            self._last_accent = horizon
        if now >= self._until and self._is_time(now, coming):
            ends = any(self._resting)
            self._until = now + self._random.uniform(*(_BUSY if ends else _QUIET))
            self._resting = [False, False] if ends else self._draw_hands()
        steps = [1 / _DOWN if rests else -1 / _UP for rests in self._resting]
        self._places = [min(max(p + s / DECISION_RATE, 0.0), 1.0) for p, s in zip(self._places, steps, strict=True)]

    def _draw_hands(self) -> list[bool]:
        """Which hands go down: left, right."""
        if self._random.random() < _BOTH:
            return [True, True]
        left = self._random.random() < 0.5
        return [left, not left]

    def _is_time(self, now: float, coming: Sequence[Accent]) -> bool:
        """Whether the speech lets hands go down, or up, now; ``coming`` are the accents on which they can come up."""
        if now >= self._until + _LATE:
            return True
        if any(self._resting):
            return _strong(coming)
        return not _strong(self._track.between(now, now + _CLEAR))


def _strong(accents: Sequence[Accent]) -> bool:
    return any(accent.strength > _WEAK for accent in accents)
