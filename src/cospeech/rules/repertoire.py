"""The gesture forms: where a hand goes, how it is turned, which shape it takes.

All for the left hand in its gesture space (see `hands`): outward of the own shoulder, above it, in front of it, in arm
lengths; degrees. A form is a preparation and one or more stroke poses; the stroke is the movement between them. Names
and kinds follow gesture annotation practice (McNeill 1992; Kendon 2004); the poses are ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..motion.kinematics.hands import HAND_SHAPES
from ..motion.rotations import Array

__all__ = ["FORMS", "LEXICAL_FORMS", "Form", "HandPose", "weigh_forms"]


class HandPose(NamedTuple):
    """One hand: wrist place (arm lengths), pronation, flexion, deviation (degrees), hand shape, elbow swivel, shrug."""

    out: float
    up: float
    forward: float
    pronation: float = 0.0
    flexion: float = 0.0
    deviation: float = 0.0
    shape: str = "relaxed"
    swivel: float = 0.0
    shrug: float = 0.0

    def values(self) -> Array:
        """(20,) in channel order."""
        head = (self.out, self.up, self.forward, self.swivel, self.pronation, self.flexion, self.deviation)
        return np.array([*head, *HAND_SHAPES[self.shape].values().tolist(), self.shrug])


class Form(NamedTuple):
    """A gesture form."""

    what: str
    poses: tuple[HandPose, ...]
    """Preparation first, then one pose per stroke."""
    weight: float = 1.0
    """In everybody's repertoire; a style's own weights multiply it."""
    hands: str = "any"
    """"one", "both" or "any": who may perform it."""
    beats: bool = True
    """Further accents may be beaten in place while the form is held."""
    score: float = 0.1
    """Semantic score: 0.1 for beats … 1 (after BEAT's annotation: class / 10)."""
    anchored: bool = False
    """At the own body: the same place whatever the style and the effort."""


P = HandPose
FORMS: dict[str, Form] = {
    "beat": Form("a small downward beat", (P(0.10, -0.50, 0.42, 22, -12, -6), P(0.13, -0.66, 0.48, 30, 6, 6)), 1.5),
    "offer": Form(
        "palm turned up and forward, offering a point",
        (P(0.02, -0.58, 0.36, 15, 8, 0, "soft_open"), P(0.20, -0.50, 0.56, -62, -6, 4, "open")),
        1.5,
    ),
    "toss": Form(
        "a flick of the hand outward and up",
        (P(0.00, -0.58, 0.38, -5, 22, 0, "loose_fist"), P(0.26, -0.40, 0.50, -58, -22, 0, "open")),
        0.8,
        beats=False,
    ),
    "spread": Form(
        "hands apart, opening a space",
        (P(-0.12, -0.54, 0.44, 12, 4, 0, "soft_open"), P(0.34, -0.50, 0.46, -30, -14, 4, "open")),
        0.9,
        "both",
    ),
    "gather": Form(
        "hands drawn in, collecting",
        (P(0.36, -0.50, 0.50, -25, -10, 0, "open"), P(-0.06, -0.52, 0.38, -12, 14, 0, "bowl")),
        0.6,
    ),
    "push": Form(
        "palm forward, keeping something off",
        (P(0.06, -0.46, 0.28, 50, -30, 0, "soft_open"), P(0.12, -0.34, 0.60, 66, -52, 0, "flat")),
        0.45,
    ),
    "chop": Form(
        "edge of the hand comes down",
        (P(0.04, -0.30, 0.42, 4, 0, -16, "flat"), P(0.06, -0.60, 0.52, 8, 2, 14, "flat")),
        0.5,
    ),
    "frame": Form(
        "hands hold a box of air",
        (P(-0.02, -0.58, 0.40, 10, 0, 0, "soft_open"), P(-0.06, -0.44, 0.58, 4, -4, 4, "frame")),
        0.6,
        "both",
    ),
    "precision": Form(
        "thumb and index meet: a fine point",
        (P(0.04, -0.40, 0.38, 22, -14, -6, "soft_open"), P(0.07, -0.54, 0.48, 30, 2, 6, "ring")),
        0.7,
    ),
    "point": Form(
        "index finger at something in front",
        (P(0.08, -0.46, 0.34, 35, -8, -4, "point_soft"), P(0.10, -0.42, 0.66, 52, 4, 4, "point")),
        0.35,
        "one",
    ),
    "fist": Form(
        "a fist for emphasis", (P(0.08, -0.34, 0.38, 8, -8, -8, "loose_fist"), P(0.10, -0.56, 0.50, 18, 2, 8, "fist")), 0.15
    ),
    "count": Form(
        "a finger up for each point",
        (P(0.06, -0.46, 0.36, 0, 0, 0, "loose_fist"), P(0.04, -0.30, 0.46, -4, -12, 0, "point")),
        0.12,
        "one",
    ),
    "sweep": Form(
        "a hand sweeps sideways",
        (P(-0.16, -0.46, 0.46, 42, 8, -8, "soft_open"), P(0.40, -0.44, 0.46, 20, -16, 10, "open")),
        0.5,
        "one",
        False,
    ),
    "arc": Form(
        "up, over and out",
        (
            P(-0.10, -0.58, 0.42, 30, 6, 0, "relaxed"),
            P(0.12, -0.24, 0.52, 20, -16, -8, "soft_open"),
            P(0.40, -0.46, 0.48, -35, -8, 6, "open"),
        ),
        0.4,
        beats=False,
    ),
    "bowl": Form(
        "palms up, carrying an idea",
        (P(0.04, -0.62, 0.36, 0, 6, 0, "relaxed"), P(0.04, -0.48, 0.52, -56, 2, 0, "bowl")),
        0.7,
        "both",
    ),
    "roll": Form(
        "hands turn over each other: and so on",
        (
            P(-0.08, -0.50, 0.40, 30, 8, 0, "relaxed"),
            P(-0.08, -0.34, 0.48, 18, -8, 0, "soft_open"),
            P(-0.06, -0.46, 0.60, -8, -4, 0, "soft_open"),
            P(-0.04, -0.58, 0.46, 12, 6, 0, "relaxed"),
        ),
        0.35,
        beats=False,
    ),
    "shrug": Form(
        "palms up and out, shoulders lift",
        (P(0.12, -0.68, 0.32, 10, 4, 0, "relaxed"), P(0.34, -0.60, 0.40, -68, -20, 0, "open", 0, 9)),
        0.25,
        "both",
        False,
    ),
}
"""Everybody's repertoire."""

LEXICAL_FORMS: dict[str, Form] = {
    "me": Form(
        "hand to the own chest",
        (P(0.05, -0.55, 0.36, 8, 6, 0, "soft_open"), P(-0.20, -0.34, 0.36, 4, 22, 0, "soft_open")),
        1,
        "one",
        False,
        0.7,
        True,
    ),
    "you": Form(
        "open hand towards the listener",
        (P(0.05, -0.56, 0.36, 10, 4, 0, "soft_open"), P(0.14, -0.46, 0.68, -48, -6, 4, "open")),
        1,
        "one",
        True,
        0.7,
    ),
    "we": Form(
        "from oneself in a circle outward",
        (P(-0.16, -0.44, 0.38, 6, 14, 0, "soft_open"), P(0.34, -0.46, 0.52, -30, -8, 4, "open")),
        1,
        "any",
        False,
        0.7,
    ),
    "here": Form(
        "index at the ground in front",
        (P(0.06, -0.44, 0.42, 40, -10, 0, "point_soft"), P(0.06, -0.66, 0.56, 60, 16, 4, "point")),
        1,
        "one",
        True,
        0.7,
    ),
    "there": Form(
        "arm out at a distant place",
        (P(0.06, -0.48, 0.40, 30, -4, 0, "point_soft"), P(0.42, -0.24, 0.74, 45, -4, 0, "point")),
        1,
        "one",
        False,
        0.8,
    ),
    "big": Form(
        "hands far apart",
        (P(-0.10, -0.46, 0.44, 4, 0, 0, "soft_open"), P(0.52, -0.34, 0.46, 4, -8, 0, "spread")),
        1,
        "both",
        False,
        0.9,
    ),
    "small": Form(
        "a little between the fingertips",
        (P(0.02, -0.48, 0.40, 16, -6, 0, "soft_open"), P(-0.06, -0.36, 0.52, 8, -10, 0, "pinch")),
        1,
        "one",
        True,
        0.9,
    ),
    "high": Form(
        "flat hand up high",
        (P(0.08, -0.50, 0.42, 40, 0, 0, "soft_open"), P(0.16, 0.02, 0.58, 74, 6, 0, "flat")),
        1,
        "one",
        False,
        0.9,
    ),
    "low": Form(
        "flat hand down low",
        (P(0.10, -0.42, 0.44, 50, 0, 0, "soft_open"), P(0.14, -0.76, 0.50, 80, -6, 0, "flat")),
        1,
        "one",
        False,
        0.9,
    ),
    "rise": Form(
        "hand climbs",
        (P(0.06, -0.72, 0.40, -20, 0, 0, "soft_open"), P(0.14, -0.22, 0.54, -44, -12, 0, "open")),
        1,
        "any",
        False,
        0.8,
    ),
    "fall": Form(
        "hand sinks",
        (P(0.08, -0.28, 0.46, 50, 0, 0, "soft_open"), P(0.12, -0.72, 0.48, 72, 8, 0, "flat")),
        1,
        "any",
        False,
        0.8,
    ),
    "no": Form(
        "palms down, wiped apart",
        (P(-0.16, -0.54, 0.46, 70, 0, 0, "flat"), P(0.34, -0.54, 0.46, 76, -8, 8, "flat")),
        1,
        "both",
        False,
        0.8,
    ),
    "stop": Form(
        "palm up against it",
        (P(0.06, -0.48, 0.30, 50, -24, 0, "soft_open"), P(0.12, -0.26, 0.62, 70, -56, 0, "flat")),
        1,
        "one",
        True,
        0.8,
    ),
    "all": Form(
        "a wide circle that takes in everything",
        (
            P(-0.10, -0.36, 0.54, 20, 0, 0, "soft_open"),
            P(0.48, -0.38, 0.46, 8, -18, 6, "spread"),
            P(0.20, -0.56, 0.48, -36, 0, 0, "open"),
        ),
        1,
        "both",
        False,
        0.9,
    ),
    "nothing": Form(
        "empty hands turned out",
        (P(0.04, -0.54, 0.40, 30, 10, 0, "loose_fist"), P(0.34, -0.54, 0.46, -66, -18, 0, "spread", 0, 5)),
        1,
        "both",
        False,
        0.9,
    ),
    "one": Form(
        "one finger",
        (P(0.06, -0.44, 0.36, 0, 0, 0, "loose_fist"), P(0.04, -0.26, 0.46, -4, -12, 0, "point")),
        1,
        "one",
        True,
        0.9,
    ),
    "two": Form(
        "two fingers",
        (P(0.06, -0.44, 0.36, 0, 0, 0, "loose_fist"), P(0.04, -0.26, 0.46, -2, -12, 0, "two")),
        1,
        "one",
        True,
        0.9,
    ),
    "three": Form(
        "three fingers",
        (P(0.06, -0.44, 0.36, 0, 0, 0, "loose_fist"), P(0.04, -0.26, 0.46, -2, -12, 0, "three")),
        1,
        "one",
        True,
        0.9,
    ),
    "many": Form(
        "all fingers spread",
        (P(0.04, -0.52, 0.38, 10, 4, 0, "loose_fist"), P(0.18, -0.36, 0.52, -14, -14, 0, "spread")),
        1,
        "any",
        True,
        0.8,
    ),
    "now": Form(
        "both hands press down on this moment",
        (P(0.04, -0.44, 0.44, 60, -6, 0, "soft_open"), P(0.06, -0.66, 0.50, 74, -10, 0, "flat")),
        1,
        "both",
        True,
        0.7,
    ),
    "past": Form(
        "thumb and hand back over the shoulder",
        (P(0.08, -0.40, 0.44, 0, 0, 0, "soft_open"), P(0.26, -0.04, 0.22, -22, -22, -8, "thumb")),
        1,
        "one",
        False,
        0.8,
    ),
    "future": Form(
        "a hop forward",
        (
            P(0.04, -0.54, 0.30, 30, 0, 0, "soft_open"),
            P(0.08, -0.30, 0.50, 46, -8, 0, "soft_open"),
            P(0.12, -0.44, 0.72, 56, 0, 0, "flat"),
        ),
        1,
        "one",
        False,
        0.8,
    ),
    "between": Form(
        "back and forth",
        (
            P(-0.06, -0.48, 0.46, 8, 0, 0, "soft_open"),
            P(0.24, -0.46, 0.48, 4, -8, 0, "frame"),
            P(-0.06, -0.48, 0.50, 8, 6, 0, "frame"),
        ),
        1,
        "one",
        False,
        0.7,
    ),
    "think": Form(
        "hand turns beside the temple",
        (P(0.04, -0.34, 0.38, 10, 0, 0, "point_soft"), P(0.10, 0.16, 0.30, -8, -8, 0, "point_soft")),
        1,
        "one",
        False,
        0.8,
        True,
    ),
    "heart": Form(
        "both hands to the chest",
        (P(0.04, -0.54, 0.40, 0, 6, 0, "soft_open"), P(-0.16, -0.36, 0.40, 2, 24, 0, "soft_open")),
        1,
        "both",
        False,
        0.8,
        True,
    ),
    "wave": Form(
        "an open hand raised in greeting",
        (
            P(0.14, -0.46, 0.36, 30, 0, 0, "soft_open"),
            P(0.26, -0.02, 0.42, 48, -18, -8, "open"),
            P(0.34, -0.04, 0.40, 44, -16, 12, "open"),
            P(0.24, -0.02, 0.42, 48, -16, -10, "open"),
        ),
        1,
        "one",
        False,
        0.9,
    ),
}
"""Forms that words call for (`lexicon`)."""


def weigh_forms(factors: Mapping[str, float]) -> dict[str, float]:
    """Weight of each of the common forms, times the factor that a style gives it."""
    return {name: form.weight * factors.get(name, 1.0) for name, form in FORMS.items()}
