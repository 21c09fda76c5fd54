"""Hands after a gesture: they tire, and come down all the way to a resting place, or a part of the way."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

import numpy as np

from ..motion.rotations import Array
from .emotion_modifiers import EmotionModifier
from .gesture_space import SHAPES, keep_beside_face, reach_time
from .hand_state import HandState, effort_of
from .minimum_jerk import peak_share
from .rest_poses import RESTS
from .strokes import LOWEST, draw_arc, draw_skew
from .styles import Style

__all__ = ["retract", "sink"]

_PACE = 0.80  # of the speaker's tempo: hands come down without hurry (ours)
_EASE = (0.25, 0.55)  # share of the way to rest that a hand goes if it stays ready (ours)
_INWARD = 0.4  # share of the way inward on top: an arm does not wait stretched out to the side (ours)
_READY = (0.2, 0.7)  # seconds for which it then stays (ours)
_DRIFT = (0.04, 0.06, 0.04)  # arm lengths by which a raised hand drifts after a stroke (ours)
_WAITS = 0.4  # seconds that a hand waits for an accent to come down with (ours)


def retract(
    state: HandState, hand: int, place: str, style: Style, modifier: EmotionModifier, draw: Random, earliest: float,
    beats: Sequence[float],
) -> None:  # fmt: skip
    """Move a hand to a resting place, or a part of the way there.

    Args:
        state: of the hand.
        hand: row of `RESTS`.
        place: "rest" or "idle"; "up": a part of the way to "rest", so that the hand stays ready for the next stroke.
        style, modifier: the speaker and the mood.
        draw: random numbers.
        earliest: seconds at which it may begin.
        beats: seconds at which its speed had better peak.
    """
    goal = RESTS[style.idle if place == "idle" else style.rest][hand].values()
    goal = _part_of_the_way(state, goal, draw) if place == "up" else _resting_place(goal, style, place, modifier, draw)
    length = reach_time(state.track.target, goal, _PACE * style.tempo * modifier.tempo) * (1.0 if place == "up" else 1.15)
    swing = draw_arc(draw, goal - state.track.target, goal, draw.uniform(0.05, 0.22))
    skew = draw_skew(draw, 0.2, 0.2)
    start = _on_the_beat([beat - length * peak_share(skew) for beat in beats], earliest, draw)
    state.track.move(start, length, goal, skew=skew, arc=swing)
    state.busy = start + 0.4 * length
    if place == "up":
        state.pose, state.has_eased, state.up_until = goal, True, start + length + draw.uniform(*_READY)
    else:
        state.place, state.home, state.form = place, goal, ""


def sink(state: HandState, hand: int, pose: Array, style: Style, draw: Random, end: float, tempo: float) -> None:
    """Let a raised hand tire after a stroke: it drifts, and down towards its resting place.

    Args:
        state, hand, style, draw: as of `retract`.
        pose: (CHANNELS,) where the stroke ends.
        end: seconds from which on it does so.
        tempo: of the speaker in this mood.
    """
    hold, effort = pose.copy(), effort_of(pose)
    share = max((1.05 - style.hold) * draw.uniform(0.03, 0.35), 0.45 * effort * draw.uniform(0.8, 1.2))
    way = RESTS[style.rest][hand].values()[:3] - hold[:3]
    hold[:3] += way * np.array([0.3 + 0.6 * effort, 0.55, 0.4]) * share
    hold[:3] += [draw.gauss(0, size) for size in _DRIFT]
    hold[1] = max(hold[1], LOWEST)
    keep_beside_face(hold)
    hold[5] *= 0.6
    state.track.move(end + draw.uniform(0.05, 0.35) * (1.0 - 0.7 * effort), draw.uniform(0.8, 1.6) / tempo, hold)
    state.pose = pose


def _resting_place(goal: Array, style: Style, place: str, modifier: EmotionModifier, draw: Random) -> Array:
    """(CHANNELS,) near a pose of `RESTS`, never twice the same."""
    free = 0.35 if style.seated or place == "idle" else 1.0
    goal[:3] += [draw.gauss(0, size) * free for size in (0.035, 0.03, 0.025)]
    if draw.random() < 0.5 and not style.seated:
        goal[7:19] = SHAPES["curl"].values()
    goal[7:19] += [draw.gauss(0, 4) for _ in range(12)]
    goal[19] += modifier.shrug
    return goal


def _part_of_the_way(state: HandState, home: Array, draw: Random) -> Array:
    """(CHANNELS,) between where a hand is and where it would rest."""
    goal = state.track.target.copy()
    share = draw.uniform(*_EASE)
    goal[0] += (home - goal)[0] * (share + _INWARD)
    goal[1:7] += (home - goal)[1:7] * share
    goal[:3] += [draw.gauss(0, 0.03) for _ in range(3)]
    goal[1] = max(goal[1], LOWEST)
    goal[4:7] += [draw.gauss(0, size) for size in (10, 8, 5)]
    goal[7:19] += (home - goal)[7:19] * draw.uniform(0.2, 0.7)
    return goal


def _on_the_beat(starts: Sequence[float], earliest: float, draw: Random) -> float:
    """When a move begins: at the first of these times that is soon, so that hands fall back in the rhythm of the speech."""
    soon = next((start for start in starts if earliest <= start <= earliest + _WAITS), None)
    return earliest + draw.uniform(0, 0.12) if soon is None else soon
