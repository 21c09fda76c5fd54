"""The form of a single movement: how far its path leaves the chord, where its speed peaks, how the hand drags behind.

The chord of a person's stroke is about nine tenths of its path, and its speed peaks anywhere between the first and the last
third (measured on two people, see docs/models/rules.md). A straight reach with a symmetric speed looks artificial. All sizes
are ours, to those figures and by eye.
"""

from __future__ import annotations

from random import Random

import numpy as np

from ..motion.kinematics.hands import CHANNELS, Channel
from ..motion.rotations import Array

__all__ = ["LOWEST", "draw_arc", "draw_beat", "draw_skew", "draw_twist", "recoil"]

_LONGEST = 0.22  # arm lengths off the chord at most
_OUT_UP_AHEAD = np.array([0.45, 0.30, 0.75])  # where paths bulge: around the body, as arms turn about the shoulder
_DRAG = 85.0  # degrees of wrist per arm length of way up or down that a hand trails behind its forearm
_MOST_DRAG = 36.0  # degrees of it at most
LOWEST, _FURTHEST = -0.76, 0.60
"""Arm lengths up and forward that a raised hand stays at: its arm stays bent. [ours]"""
_BESIDE, _BEFORE, _COMES_IN = 0.22, 0.42, 0.3
"""Arm lengths outward and forward of its shoulder that a hand beats at for long; and the share of what is more that it loses
with every beat: nobody holds an arm out for a whole sentence. [ours]"""
_AHEAD = 0.30  # arm lengths forward of its shoulder at which a raised hand still is halfway [ours]
_LEAST_CHORD = 0.03  # arm lengths; shorter ways have no direction


def draw_arc(random: Random, way: Array, pose: Array, size: float) -> Array:
    """(CHANNELS,) by which a movement leaves its chord halfway.

    Args:
        random: of the planner.
        way: (CHANNELS,) from where the hand is to where it goes.
        pose: (CHANNELS,) where it goes; its pronation says how the wrist drags.
        size: share of the chord's length; negative: the path bulges to the body's side, as in a wind-up.
    """
    arc = np.zeros(CHANNELS)
    chord = way[:3]
    length = float(np.sqrt(chord @ chord))
    if length < _LEAST_CHORD:
        return arc
    bulge = _OUT_UP_AHEAD + np.array([random.gauss(0, 0.55), random.gauss(0, 0.55), random.gauss(0, 0.35)])
    across = bulge - chord * (bulge @ chord) / length**2
    across /= max(float(np.sqrt(across @ across)), 1e-6)
    arc[:3] = across * min(max(size * length, -_LONGEST), _LONGEST)
    start = float(pose[2] - chord[2])
    arc[2] += max(min(_AHEAD, start, float(pose[2])) - (start + 0.5 * float(chord[2]) + arc[2]), 0.0)
    turn = np.radians(pose[Channel.PRONATION])
    drag = min(max(_DRAG * float(chord[1]), -_MOST_DRAG), _MOST_DRAG)
    arc[Channel.FLEXION] = drag * np.sin(turn)
    arc[Channel.DEVIATION] = 0.7 * drag * np.cos(turn)
    arc[Channel.SWIVEL] = random.gauss(0, 5)
    return arc


def draw_skew(random: Random, middle: float, spread: float) -> float:
    """A skew of a movement's speed; see `cospeech.rules.minimum_jerk.minimum_jerk`."""
    return min(max(random.gauss(middle, spread), -0.6), 0.6)


def draw_twist(random: Random, way: Array, size: float) -> Array:
    """(CHANNELS,) of a small loop in front of the body: beats go down on one side and come back on the other."""
    arc = np.zeros(CHANNELS)
    length = float(np.sqrt(way[:3] @ way[:3]))
    arc[0] = size * length * random.choice((-1, 1)) * random.uniform(0.6, 1.3)
    arc[2] = 0.6 * size * length * random.uniform(-0.4, 1.2)
    return arc


def draw_beat(random: Random, size: float) -> tuple[Array, Array]:
    """(CHANNELS,) each: up before a beat, and down and a little forward.

    Args:
        random: of the planner.
        size: arm lengths of the way down.
    """
    up, down = np.zeros(CHANNELS), np.zeros(CHANNELS)
    up[:7] = (random.gauss(0, 0.03), 0.28 * size, -0.1 * size, 0, 0, -75 * size, -45 * size)
    down[:7] = (random.gauss(0.02, 0.03), -1.0 * size, 0.38 * size, 0, 0, 130 * size, 75 * size)
    return up, down


def recoil(way: Array, target: Array) -> Array:
    """(CHANNELS,) that follow a beat of a raised hand: it sinks a little with every beat, but never beside the hip.

    Args:
        way: (CHANNELS,) of the beat, there and down.
        target: (CHANNELS,) where the hand is after it.
    """
    back = -way
    back[:3] *= 0.65
    back[0] -= _COMES_IN * max((target + back)[0] - _BESIDE, 0.0)
    back[2] -= _COMES_IN * max((target + back)[2] - _BEFORE, 0.0)
    back[1] += max(LOWEST - (target + back)[1], 0.0)
    back[2] -= max((target + back)[2] - _FURTHEST, 0.0)
    return back
