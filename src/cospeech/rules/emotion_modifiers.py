"""The effect of an emotion on movement, as a small, readable set of factors and offsets. Sizes are ours, set by eye."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType

import numpy as np

from ..motion.rotations import Array

__all__ = ["MANNERS", "EmotionModifier", "blend_modifiers"]


@dataclass(frozen=True)
class EmotionModifier:
    """The effect of an emotion on movement: factors (1 = unchanged) and offsets (0 = unchanged).

    After the third paper's observations (Xu et al. 2024, section 4): happiness and surprise expand outward and quicken;
    fear and sadness turn inward with fewer variations; anger is fast, large and abrupt; contempt and disgust are alike,
    averted and small. Sizes are ours.
    """

    amplitude: float = 1.0
    rate: float = 1.0
    tempo: float = 1.0
    breadth: float = 0.0
    """Arm lengths outward."""
    height: float = 0.0
    variety: float = 1.0
    """Of forms and places: below 1 the repertoire narrows."""
    abrupt: float = 0.0
    """0 … 1: strokes shorter and stopped harder."""
    tension: float = 0.0
    bow: float = 0.0
    """Degrees: torso forward (chest sinks)."""
    chin: float = 0.0
    """Degrees: head up."""
    shrug: float = 0.0
    """Degrees: shoulders up."""
    turn: float = 0.0
    """Degrees: head and torso averted."""
    tilt: float = 0.0
    """Degrees: head on one side."""
    averted: float = 0.0
    """Added share of averted gaze."""
    torso: float = 1.0
    head: float = 1.0


MANNERS: Mapping[str, EmotionModifier] = MappingProxyType(
    {
        "neutral": EmotionModifier(),
        "happiness": EmotionModifier(1.34, 1.4, 1.25, breadth=0.18, height=0.08, chin=3, bow=-2, torso=1.25, head=1.15),
        "anger": EmotionModifier(
            1.28, 1.3, 1.32, breadth=0.0, height=0.05, abrupt=0.9, tension=0.5, bow=4, chin=-3, shrug=3, torso=1.2
        ),
        "sadness": EmotionModifier(
            0.62,
            0.6,
            0.74,
            breadth=-0.08,
            height=-0.10,
            variety=0.4,
            tension=-0.3,
            bow=7,
            chin=-9,
            averted=0.3,
            torso=0.65,
            head=0.75,
        ),
        "contempt": EmotionModifier(
            0.72,
            0.65,
            0.9,
            breadth=-0.03,
            height=-0.05,
            variety=0.7,
            bow=-3,
            chin=5,
            turn=9,
            tilt=4,
            averted=0.2,
            torso=0.8,
            head=0.9,
        ),
        "surprise": EmotionModifier(
            1.25, 1.15, 1.2, breadth=0.08, height=0.09, abrupt=0.35, tension=0.2, bow=-4, chin=4, shrug=5, torso=1.2
        ),
        "fear": EmotionModifier(
            0.68,
            0.8,
            0.92,
            breadth=-0.09,
            height=0.0,
            variety=0.5,
            tension=0.45,
            bow=4,
            chin=-3,
            shrug=8,
            averted=0.3,
            torso=0.75,
            head=1.0,
        ),
        "disgust": EmotionModifier(
            0.72,
            0.68,
            0.92,
            breadth=-0.03,
            height=-0.04,
            variety=0.7,
            tension=0.2,
            bow=-2,
            chin=-2,
            turn=11,
            tilt=-4,
            averted=0.3,
            torso=0.8,
            head=0.95,
        ),
    }
)
_MANNER_FIELDS = tuple(f.name for f in fields(EmotionModifier))
_MANNER_TABLE = np.array([[getattr(m, name) for name in _MANNER_FIELDS] for m in MANNERS.values()])


def blend_modifiers(probabilities: Array) -> EmotionModifier:
    """The mixture of all manners under ``probabilities (8,)``."""
    return EmotionModifier(*(float(v) for v in np.asarray(probabilities) @ _MANNER_TABLE))
